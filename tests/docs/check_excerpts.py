#!/usr/bin/env python3
"""Code in the documentation that names the file it is from must be in that file, line by line.

check_excerpts.py ROOT: looks at every Markdown file for
    <!-- path/of/file -->
    ```cpp
"""
import pathlib
import re
import sys

EXCERPT = re.compile(r"<!-- (\S+) -->\n```\w*\n(.*?)```", re.S)


def lines(text):
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]


def faults(root):
    checked = 0
    for page in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        for name, code in EXCERPT.findall(page.read_text()):
            checked += 1
            source = root / name
            if not source.is_file():
                yield f"{page}: {name} does not exist"
                continue
            whole, part = lines(source.read_text()), lines(code)
            if not any(whole[i : i + len(part)] == part for i in range(len(whole))):
                yield f"{page}: these lines are not in {name}:\n{code}"
    if checked == 0:
        yield f"{root}: no excerpt found"


if __name__ == "__main__":
    found = list(faults(pathlib.Path(sys.argv[1])))
    print("\n".join(found))
    sys.exit(1 if found else 0)
