"""Checks what every shader's header says against its SPIR-V, and against the work groups that src/vk asks for."""

import argparse
import re
import sys
from pathlib import Path

from shader_header import Problems, read_header
from spirv_module import Module

MOST_STORAGE_BUFFERS = 8  # the least that Vulkan promises


def snake_case(name):
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def check_bindings(header, plain, problems):
    buffers = plain.bindings()
    for number, stated in enumerate(header.bindings):
        if number not in buffers:
            problems.add(header.path, stated.line, f"binding {number}", "none, as in the shader", stated.name)
            continue
        buffer = buffers[number]
        for what, expected, found in (("kind", buffer.kind, stated.kind), ("element", buffer.element, stated.element)):
            if expected != found:
                problems.add(header.path, stated.line, f"binding {number}'s {what}", expected, found)
        if stated.name not in (names := set(map(snake_case, buffer.names))):
            problems.add(header.path, stated.line, f"binding {number}'s name", " or ".join(sorted(names)), stated.name)
    for number in sorted(buffers.keys() - range(len(header.bindings))):
        buffer = buffers[number]
        problems.add(header.path, 1, f"binding {number}",
                     f"'{buffer.kind} {number} {min(buffer.names)} {buffer.element}[…]'", "none in the header")
    if sum(buffer.kind != "con" for buffer in buffers.values()) > MOST_STORAGE_BUFFERS:
        problems.add(header.path, 1, "storage buffers", f"at most {MOST_STORAGE_BUFFERS}", len(buffers))


def check_specializations(header, plain, problems):
    constants = plain.specializations()
    for number, (name, sign, bound) in enumerate(header.specializations):
        what = f"specialization constant {number}"
        if number not in constants:
            problems.add(header.path, header.spec_line, what, "none, as in the shader", name)
            continue
        names, default = constants[number]
        if name not in (names or ["WORKGROUP"]):
            problems.add(header.path, header.spec_line, what, " or ".join(names) or "WORKGROUP", name)
        if number and sign == "=" and bound is not None and default != bound:
            problems.add(header.path, header.spec_line, f"default of {name}", default, bound)
        if sign in ("≤", "<") and bound is not None and not default <= bound - (sign == "<"):
            problems.add(header.path, header.spec_line, f"bound of {name}", f"at least its default {default}", bound)
    for number in sorted(constants.keys() - range(len(header.specializations))):
        problems.add(header.path, header.spec_line, f"specialization constant {number}",
                     f"'{number} {' or '.join(constants[number][0])}'", "none in the header")


def check_rest(header, plain, problems):
    given = {0: header.specializations[0][2]}
    shared = plain.shared_bytes(given)
    if shared > 1024 * header.shared_kib or (shared == 0) != (header.shared_kib == 0):
        problems.add(header.path, header.spec_line, "shared memory", f"{shared} bytes, as in the shader",
                     f"{header.shared_kib:g} KiB")
    if plain.loops and not header.has_loops:
        problems.add(header.path, header.loops_line, "loops", "a bound: the shader has loops", "none")
    if wide := plain.float_widths() - {32}:
        problems.add(header.path, header.loops_line, "precision", f"fp{max(wide)}, as in the shader", "fp32")


def read_group_sizes(folder):
    """{name of a shader: work group sizes that a file of src/vk which names it asks for}."""
    def numbers(text):
        return {name: int(value) for name, value in re.findall(r"constexpr [\w:]+ (\w+) = (\d+);", text)}
    shared = numbers((folder / "kernel.hpp").read_text(encoding="utf-8"))
    sizes = {}
    for path in sorted(folder.glob("*.cpp")):
        text = path.read_text(encoding="utf-8")
        known = shared | numbers(text)
        firsts = re.findall(r"(?:std::array|return )\{\s*(?:number\()?(\w+)", text)
        for name in re.findall(r"\bshaders::(\w+)", text):
            sizes.setdefault(name, set()).update(known[first] for first in firsts if first in known)
    return sizes


def check_group_size(header, name, sizes, problems):
    size = header.specializations[0][2]
    if name not in sizes:
        problems.add(header.path, 1, name, f"'shaders::{name}' in src/vk", "none")
    elif size not in sizes[name]:
        problems.add(header.path, header.spec_line, f"work group size of {name}",
                     " or ".join(map(str, sorted(sizes[name]))) or "a named constant in src/vk", size)


def check(root, modules):
    problems = Problems(root)
    shaders = root / "shaders"
    headers = {path.stem: read_header(path, problems) for path in sorted(shaders.glob("*.comp"))}
    sizes = read_group_sizes(root / "src" / "vk")
    for path in modules:
        name = path.name.removesuffix(".plain.spv")
        stem = name if name in headers else name.rpartition("_")[0]  # a variant is of that
        if stem not in headers:
            raise ValueError(f"{path}: no such shader in {shaders}")
        if header := headers[stem]:
            plain = Module(path)
            check_bindings(header, plain, problems)
            check_specializations(header, plain, problems)
            check_rest(header, plain, problems)
            check_group_size(header, name, sizes, problems)
    return list(dict.fromkeys(problems.lines))  # variants share a header


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--source", type=Path, required=True, help="the project")
    parser.add_argument("modules", type=Path, nargs="+", metavar="NAME.plain.spv", help="SPIR-V as written")
    args = parser.parse_args()
    try:
        problems = check(args.source.resolve(), args.modules)
    except (OSError, ValueError) as failure:
        sys.exit(f"check_headers: {failure}")
    print("\n".join(problems) or f"{len(args.modules)} shaders: headers and SPIR-V agree")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
