"""Checks every shader's header against its SPIR-V and against what src/vk declares, so that none of them drifts."""

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from shader_sources import KINDS, Problems, read_builds, read_declarations, read_header, read_parameters
from spirv_module import Module

MOST_PUSH_BYTES, MOST_STORAGE_BUFFERS = 128, 8  # the least that Vulkan promises


def snake_case(name):
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def check_bindings(header, plain, problems):
    buffers = plain.bindings()
    for number, stated in enumerate(header.bindings):
        if number not in buffers:
            problems.add(header.path, stated.line, f"binding {number}", "none, as in the shader", stated.name)
            continue
        buffer = buffers[number]
        for what, expected, found in (("set", 0, buffer.descriptor_set), ("kind", buffer.kind, stated.kind),
                                      ("element", buffer.element, stated.element)):
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
    if plain.workgroup_specialization() != 0:
        problems.add(header.path, header.spec_line, "work group size", "layout(local_size_x_id = 0) in the shader",
                     f"id {plain.workgroup_specialization()}")


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


def check_shipped(header, name, shipped, plain, problems):
    """The optimised SPIR-V may lack what is not used; the rest is as the source has it."""
    def facts(module):
        yield from ((f"binding {number}", f"{b.kind} {b.element} of set {b.descriptor_set}")
                    for number, b in module.bindings().items())
        yield from ((f"specialization constant {number}'s default", default)
                    for number, (_, default) in module.specializations().items())
        yield from (("push constants' bytes", push[1]) for push in [module.push_constants()] if push)
    source = dict(facts(plain))
    for what, fact in facts(shipped):
        if source.get(what) != fact:
            problems.add(header.path, 1, f"{what} in {name}.spv (built from another source?)", source.get(what), fact)


def check_declaration(header, declaration, plain, parameters, problems):
    def add(line, what, expected, found):
        problems.add(declaration.path, line, f"{declaration.name}'s {what}", expected, found)
    stated = [binding.kind for binding in header.bindings]
    if stated != declaration.accesses:
        to_access = {kind: access for access, kind in KINDS.items()}
        add(declaration.bindings_line, "bindings",
            *(" ".join(to_access.get(kind, kind) for kind in kinds) for kinds in (stated, declaration.accesses)))
    if len(header.specializations) != declaration.specializations:
        add(declaration.line, "specialization constants", len(header.specializations), declaration.specializations)
    name, size = plain.push_constants() or ("", 0)
    if name != (declaration.parameters or ""):
        add(declaration.line, "push constants", name or "0", declaration.parameters or "0")
    elif size != parameters.get(name, 0):
        add(declaration.line, "push constants' bytes", size, parameters.get(name, "none in parameters.glsl"))
    if size > MOST_PUSH_BYTES:
        add(declaration.line, "push constants' bytes", f"at most {MOST_PUSH_BYTES}", size)
    if (size := header.specializations[0][2]) not in declaration.group_sizes:
        add(declaration.line, "work group size", f"{size}, a named constant, as first specialization",
            " or ".join(map(str, sorted(declaration.group_sizes))) or "none")


def compile_plain(glslc, shaders, build, folder):
    """A copy with names and with all that is declared, used or not."""
    path = folder / f"{build.name}.spv"
    definitions = [f"-D{build.definition}"] if build.definition else []
    subprocess.run([glslc, "--target-env=vulkan1.2", "-O0", "-g", *definitions, "-I", shaders, "-o", path,
                    shaders / f"{build.stem}.comp"], check=True)
    return Module(path)


def check(root, spirv, glslc):
    problems = Problems(root)
    shaders, vk = root / "shaders", root / "src" / "vk"
    cmake = vk / "CMakeLists.txt"
    builds = read_builds(cmake, problems)
    parameters = read_parameters(shaders / "common" / "parameters.glsl", problems)
    declarations = {}
    for declaration in read_declarations(vk, problems):
        if declaration.name in declarations:
            problems.add(declaration.path, declaration.line, declaration.name, "one declaration", "a second")
        declarations[declaration.name] = declaration
        if declaration.name not in (build.name for build in builds):
            problems.add(declaration.path, declaration.line, declaration.name, f"bitr_shader in {cmake.name}", "none")
    headers = {path.stem: read_header(path, problems) for path in sorted(shaders.glob("*.comp"))}
    for stem in sorted(headers.keys() - {build.stem for build in builds}):
        problems.add(shaders / f"{stem}.comp", 1, stem, f"bitr_shader in {cmake.name}", "none")

    with tempfile.TemporaryDirectory() as folder:
        for build in builds:
            if build.stem not in headers:
                problems.add(cmake, build.line, build.name, f"shaders/{build.stem}.comp", "none")
            if build.name not in declarations:
                problems.add(cmake, build.line, build.name, "a Shader in src/vk", "none")
            elif header := headers.get(build.stem):
                plain = compile_plain(glslc, shaders, build, Path(folder))
                check_bindings(header, plain, problems)
                check_specializations(header, plain, problems)
                check_rest(header, plain, problems)
                check_shipped(header, build.name, Module(spirv / f"{build.name}.spv"), plain, problems)
                check_declaration(header, declarations[build.name], plain, parameters, problems)
    return builds, list(dict.fromkeys(problems.lines))  # variants share a header


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--source", type=Path, required=True, help="the project")
    parser.add_argument("--spirv", type=Path, required=True, help="folder of the built STEM.spv")
    parser.add_argument("--glslc", default="glslc")
    args = parser.parse_args()
    try:
        builds, problems = check(args.source.resolve(), args.spirv.resolve(), args.glslc)
    except (OSError, ValueError, subprocess.CalledProcessError) as failure:
        sys.exit(f"check_headers: {failure}")
    print("\n".join(problems) or f"{len(builds)} shaders: headers, SPIR-V and src/vk agree")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
