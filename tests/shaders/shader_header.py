"""Reads what a shader's header says.

A header, of shaders/STEM.comp:
  // STEM.comp: what it does
  // in|out|mod|con N name f32|u32[shape] …   storage buffer read, written, or both; uniform buffer
  // spec I NAME[=default or ≤bound] … | grid … | shared [… ≤] N KiB
  //   (I–J NAME: NAME0, NAME1, …; a new line may stand for a |)
  // loops none, ≤ … N or ≤ … < 65535 | error: … | fp32
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

# The least that Vulkan promises, and lavapipe's silent end of loops.
MOST_INVOCATIONS, MOST_SHARED_KIB, LOOP_LIMIT = 128, 16, 65535


class Problems:
    def __init__(self, root):
        self.root, self.lines = root, []

    def add(self, path, line, what, expected, found):
        path = path.relative_to(self.root) if path.is_relative_to(self.root) else path
        self.lines.append(f"{path}:{line}: {what}: expected {expected}, found {found}")


@dataclass
class HeaderBinding:
    line: int
    kind: str
    name: str
    element: str


@dataclass
class Header:
    path: Path
    bindings: list = field(default_factory=list)         # HeaderBinding
    specializations: list = field(default_factory=list)  # (name, sign, bound)
    spec_line: int = 0
    loops_line: int = 0
    shared_kib: float = 0
    has_loops: bool = True


def read_header(path, problems):
    """None if it cannot be made sense of."""
    before = len(problems.lines)
    lines = path.read_text(encoding="utf-8").splitlines()
    header = Header(path)
    if not lines or not lines[0].startswith(f"// {path.name}: "):
        problems.add(path, 1, "first line", f"'// {path.name}: …'", f"'{lines[0] if lines else ''}'")
        return None

    paragraphs = {}  # spec and loops: their line, and all their text on one
    open_paragraph = None
    for number, line in enumerate(lines, 1):
        if not line.startswith("//"):
            break
        line = line[2:].strip()
        if re.match(r"(in|out|mod|con) +\d", line):
            open_paragraph = None
            found = re.match(r"(in|out|mod|con) +(\d+) +(\w+) +([fu]32)\[[^\[\]]+\]", line)
            if not found:
                problems.add(path, number, "binding", "'in|out|mod|con N name f32|u32[shape]'", f"'{line}'")
            elif int(found[2]) != len(header.bindings):
                problems.add(path, number, "binding's number", len(header.bindings), found[2])
            else:
                header.bindings.append(HeaderBinding(number, found[1], found[3], found[4]))
        elif start := re.match(r"(spec|loops)\b", line):
            open_paragraph = start[1]
            paragraphs[open_paragraph] = (number, line)
        elif open_paragraph:
            at, text = paragraphs[open_paragraph]
            between = " | " if re.match("grid |shared |error:", line) and not text.endswith("|") else "  "
            paragraphs[open_paragraph] = (at, text + between + line)
    for name, form in (("spec", "'spec I NAME … | grid … | shared [… ≤] N KiB'"),
                       ("loops", "'loops … | error: … | fp32'")):
        if name not in paragraphs:
            problems.add(path, 1, "header", f"a line {form}", "none")
    if len(problems.lines) > before:
        return None
    read_spec(header, *paragraphs["spec"], problems)
    read_loops(header, *paragraphs["loops"], problems)
    return header if len(problems.lines) == before else None


def read_spec(header, line, text, problems):
    header.spec_line = line
    form = re.fullmatch(r"spec +(.+?) +\| +grid +\S.*? +\| +shared (?:\S.* ≤ )?(\d+(?:\.\d+)?) KiB", text)
    if not form:
        problems.add(header.path, line, "header", "'spec I NAME … | grid … | shared [… ≤] N KiB'", f"'{text}'")
        return
    header.shared_kib = float(form[2])
    if header.shared_kib > MOST_SHARED_KIB:
        problems.add(header.path, line, "shared memory", f"at most {MOST_SHARED_KIB} KiB", f"{form[2]} KiB")
    constant = r"(?:^| )(\d+)(?:–(\d+))? +([A-Z]\w*)(?:([=≤<])(\S+))?(?= |$)"
    if rest := re.sub(constant, "", form[1]).strip():
        problems.add(header.path, line, "specialization constants", "'I NAME[=default or ≤bound]' each",
                     f"'{rest}'")
    for first, last, name, sign, bound in re.findall(constant, form[1]):
        if int(first) != len(header.specializations):
            problems.add(header.path, line, f"id of {name}", len(header.specializations), first)
        names = [f"{name}{i}" for i in range(int(last) - int(first) + 1)] if last else [name]
        header.specializations += [(each, sign, int(bound) if bound.isdigit() else None) for each in names]
    name, sign, size = (header.specializations or [("nothing", "", None)])[0]
    if name != "WORKGROUP" or sign != "=" or not size or size > MOST_INVOCATIONS:
        problems.add(header.path, line, "specialization constant 0", f"WORKGROUP=N, at most {MOST_INVOCATIONS}",
                     f"{name}{sign}{size or ''}")


def read_loops(header, line, text, problems):
    header.loops_line = line
    form = re.fullmatch(r"loops +(\S.*?) +\| +error: *(\S.*?) +\| +fp32", text)
    if not form:
        problems.add(header.path, line, "header", "'loops … | error: … | fp32'", f"'{text}'")
        return
    header.has_loops = form[1] != "none"
    bound, limit, _ = form[1].partition(f" < {LOOP_LIMIT}")
    last = re.split("[=≤]", bound)[-1].strip()
    if header.has_loops and not (int(last) < LOOP_LIMIT if last.isdigit() else last and limit):
        problems.add(header.path, line, "loops", f"'none', '≤ … N' or '≤ … < {LOOP_LIMIT}'", f"'{form[1]}'")
