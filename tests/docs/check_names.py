#!/usr/bin/env python3
"""Files that the documentation names in `backquotes` or links to are there.

check_names.py ROOT: looks at every page of the project. A name with STEM in it stands for many.
"""
import pathlib
import re
import sys

TOP = "src|shaders|include|tests|tools|bench|cmake|docs|examples|models|viewer|\\.ci"
NAMED = re.compile(rf"`((?:{TOP})(?:/[\w./-]+)?)`")
LINK = re.compile(r"\]\(([^):#]+)(?:#[^)]*)?\)")


def named_files(text):
    """Files and folders of the project that a page names in backquotes, but for what npm installs."""
    names = {name.rstrip("/") for name in NAMED.findall(text)}
    return {name for name in names if "STEM" not in name and "node_modules" not in name}


def missing_files(root, page):
    """What a page names or links to and is not there."""
    text = page.read_text(encoding="utf-8")
    yield from (f"{page.name}: no {name}" for name in sorted(named_files(text)) if not (root / name).exists())
    for link in sorted(set(LINK.findall(text))):
        if not (page.parent / link).exists():
            yield f"{page.name}: a link to {link}, which is not there"


def faults(root):
    pages = [*root.glob("*.md"), *root.glob("docs/*.md"), *root.glob("models/*.md"), *root.glob("bench/results/*.md")]
    if not pages:
        yield f"{root}: no pages"
    for page in sorted(pages):
        yield from missing_files(root, page)


if __name__ == "__main__":
    found = list(faults(pathlib.Path(sys.argv[1])))
    print("\n".join(found))
    sys.exit(1 if found else 0)
