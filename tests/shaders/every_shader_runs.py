#!/usr/bin/env python3
"""Whether every shader ran in some test: each run has left a file with the names of those that it ran."""
import argparse
import sys
from pathlib import Path

arguments = argparse.ArgumentParser(description=__doc__)
arguments.add_argument("folder", type=Path)
arguments.add_argument("--runs", nargs="+", required=True, help="names of tests, and of their files in the folder")
arguments.add_argument("--shaders", nargs="+", required=True, help="names of all that are built")
given = arguments.parse_args()

ran = set()
for run in given.runs:
    try:
        names = (given.folder / run).read_text().split()
    except OSError as error:
        sys.exit(f"{run} has left no list: {error}")
    print(f"{run}: {len(names)} shaders")
    ran.update(names)

if unknown := ran - set(given.shaders):
    sys.exit(f"not among the shaders that are built: {', '.join(sorted(unknown))}")
if missing := set(given.shaders) - ran:
    sys.exit(f"no test runs: {', '.join(sorted(missing))}")
print(f"all {len(given.shaders)} run")
