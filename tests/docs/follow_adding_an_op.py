#!/usr/bin/env python3
"""Follows docs/adding-an-op.md to the letter.

follow_adding_an_op.py ROOT: every file that the page names is there; its steps are numbered, each names a file and shows
lines of it, in the order in which they stand there; and the example occurs in no file that the page does not name, so that no
step can be left out.
"""
import pathlib
import re
import sys

from check_excerpts import EXCERPT, lines
from check_names import missing_files, named_files

STEM, EXAMPLE = "merge_pairs", re.compile(r"merge_pairs|\bMerge(Pairs|Parameters)")
STEPS = 8
STEP = re.compile(r"^## (\d+)\. [^\n]*`([^`\n]+)`\n(.*?)(?=^## )", re.M | re.S)
SEARCHED = ("src", "shaders", "include", "cmake", "bench", "tests", "tools", "examples")
# Recorded times, data, and the documentation's own tests.
NOT_SEARCHED = ("bench/results/", "tests/data/", "tests/docs/")


def occurrences(root):
    """Files of the project in which the example occurs, by its name or in its text."""
    for folder in SEARCHED:
        for path in sorted((root / folder).rglob("*")):
            name = path.relative_to(root).as_posix()
            if not path.is_file() or name.startswith(NOT_SEARCHED) or path.suffix == ".pyc":
                continue
            text = path.read_text(encoding="utf-8", errors="replace")
            if STEM in name or EXAMPLE.search(text):
                yield name


def out_of_order(root, text):
    """Excerpts that do not follow, in their file, the one that the page shows before them."""
    reached = {}
    for name, code in EXCERPT.findall(text):
        path = root / name
        whole = lines(path.read_text(encoding="utf-8")) if path.is_file() else []
        part, begin = lines(code), reached.get(name, 0)
        at = next((i for i in range(begin, len(whole)) if whole[i : i + len(part)] == part), None)
        if at is None:
            yield f"{name} does not have these lines, or not behind those shown before:\n{code}"
        else:
            reached[name] = at + len(part)


def faults(root):
    page = root / "docs" / "adding-an-op.md"
    text = page.read_text(encoding="utf-8")
    yield from missing_files(root, page)
    steps = STEP.findall(text)
    if [int(number) for number, _, _ in steps] != list(range(1, STEPS + 1)):
        yield f"the steps are {[int(number) for number, _, _ in steps]}, not 1 … {STEPS}, a file in the title of each"
    found = set(occurrences(root))
    for number, name, body in steps:
        shown = {excerpt for excerpt, _ in EXCERPT.findall(body)}
        if shown != {name}:
            yield f"step {number} is about {name} and shows {', '.join(sorted(shown)) or 'nothing'}"
        if name not in found:
            yield f"step {number}: the example does not occur in {name}"
    yield from out_of_order(root, text)
    named = named_files(text)
    yield from (f"the page does not name {name}, in which the example occurs" for name in sorted(found - named))


if __name__ == "__main__":
    found = list(faults(pathlib.Path(sys.argv[1])))
    print("\n".join(found))
    sys.exit(1 if found else 0)
