#!/usr/bin/env python3
"""The tour of the sources leaves no room out, and its arrows are the sources'.

check_tour.py ROOT: docs/tour.md names every folder of src in `backquotes`; the table under "What may include what" has each
once, with the other folders of src that its files may include, all of them above it, so that there are no circles.
"""
import pathlib
import re
import sys

ROW = re.compile(r"^\| `src/(\w+)` \|([\w, ]*)\|$", re.M)
INCLUDE = re.compile(r'^#include "(\w+)/', re.M)


def includes(folder):
    """The other folders beside it that its sources include."""
    found = set()
    for path in sorted(folder.rglob("*.[ch]pp")):
        found.update(INCLUDE.findall(path.read_text(encoding="utf-8")))
    return {name for name in found if name != folder.name and (folder.parent / name).is_dir()}


def faults(root):
    text = (root / "docs" / "tour.md").read_text(encoding="utf-8")
    story, _, table = text.partition("## What may include what")
    rooms = {path.name for path in (root / "src").iterdir() if path.is_dir()}
    rows = ROW.findall(table)
    for room in sorted(rooms):
        if not re.search(rf"`src/{room}[`/]", story):
            yield f"tour.md: nothing is said of src/{room}"
        if (times := sum(name == room for name, _ in rows)) != 1:
            yield f"tour.md: the table has src/{room} {times} times"
    above = set()
    for name, cell in rows:
        allowed = {word.strip() for word in cell.split(",") if word.strip()}
        if name not in rooms or allowed - rooms:
            yield f"tour.md: no src/{' or src/'.join(sorted({name, *allowed} - rooms))}"
            continue
        for other in sorted(allowed - above):
            yield f"tour.md: the table has src/{other} below src/{name}, which may include it"
        above.add(name)
        for other in sorted(includes(root / "src" / name) - allowed):
            yield f"src/{name} includes {other}, which the table of tour.md does not allow"


if __name__ == "__main__":
    found = list(faults(pathlib.Path(sys.argv[1])))
    print("\n".join(found))
    sys.exit(1 if found else 0)
