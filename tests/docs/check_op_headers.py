#!/usr/bin/env python3
"""Every operation's header begins with its contract, a tensor a line.

check_op_headers.py FOLDER: the opening comment of each header there, but for those that hold no operation, is
    // STEM: what it is, and formulas
    // in  NAME SHAPE  …     one line per input; lines indented further go on
    // out NAME SHAPE  …     one line per output
    // error …               float_error() where the header has it, and what it is relative to; no number
    // source …              optional
A shape (T[…] or u32[…]) in any other line, or a second one in the same line, is a table that was reflowed.
"""
import pathlib
import re
import sys

NO_OPERATION = {"constants", "op"}
ENTRY = re.compile(r"// (in |out|error|source) \S")
CONTINUED = re.compile(r"//     +\S")
SHAPE = re.compile(r"\b(?:T|u32)\[")
REFLOWED = re.compile(r"\S +(?:in  |out |error )[^.;]*\b(?:T|u32)\[|[.\])] (?:error|source) (?:\(|\S+\()")


def opening(text):
    """[(number, line)] of the comment before the first line that is none."""
    lines = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.startswith("//"):
            break
        lines.append((number, line))
    return lines


def faults(stem, text):
    """(line, what is wrong) of one header."""
    lines, order, in_table = opening(text), [], False
    if not lines or not lines[0][1].startswith(f"// {stem}: "):
        yield 1, f"the first line is not '// {stem}: …'"
    for number, line in lines:
        entry = ENTRY.match(line)
        if entry:
            order.append(entry[1].strip())
        elif in_table and not CONTINUED.match(line):
            yield number, "prose behind the table"
        in_table = in_table or bool(entry)
        tensor = in_table and order[-1] in ("in", "out")
        if entry and entry[1] == "error" and (line.startswith("// error float_error()") != ("double float_error()" in text)
                                              or re.search(r"\de-\d", line)):
            yield number, "the error is not float_error(), and that alone"
        if len(SHAPE.findall(line)) > (1 if tensor else 0) or REFLOWED.search(line[2:]):
            yield number, "a tensor or entry that does not begin its line"
    if not in_table:
        yield 1, "no table"
    for key in ("in", "out", "error"):
        if key not in order:
            yield 1, f"no line '// {key} …'"
    ranks = [("in", "out", "error", "source").index(key) for key in order]
    if ranks != sorted(ranks) or order.count("error") > 1:
        yield 1, "entries out of order: inputs, outputs, one error, source"


def check(folder):
    headers = [path for path in sorted(folder.glob("*.hpp")) if path.stem not in NO_OPERATION]
    if not headers:
        yield f"{folder}: no headers"
    for path in headers:
        for line, fault in faults(path.stem, path.read_text(encoding="utf-8")):
            yield f"{path}:{line}: {fault}"


if __name__ == "__main__":
    found = list(check(pathlib.Path(sys.argv[1])))
    print("\n".join(found))
    sys.exit(1 if found else 0)
