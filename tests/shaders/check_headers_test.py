"""Tests of check_headers.py on a small project of two shaders: right, it passes; wrong in one place, it is refused."""

import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

CHECK = Path(__file__).resolve().parent / "check_headers.py"
GLSLC = os.environ.get("GLSLC", "glslc")

PROJECT = {
    "shaders/blur.comp": """\
// blur.comp: a mean over neighbours, for the tests of check_headers.py; two lines of
// prose, mod and all.
// in  0 values   f32[P,4]
// in  1 index    u32[P,K]   unused without NEAR: optimised away
// mod 2 sums     f32[P,4]
// out 3 result   f32[P,4]
// con 4 weights  f32[W,4]   of vectors
//                           and more
// spec 0 WORKGROUP=64  1 K≤64  2 W=8
//      3 NEAR  4–6 OUT≤4 | grid tiles
// shared 12·WORKGROUP + … ≤ 1.5 KiB
// loops ≤ P/2 + K = 640 < 65535 | error: 1e-6 of
//   the largest entry | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const int K = 24;
layout(constant_id = 2) const int W = 8;
layout(constant_id = 3) const bool NEAR = false;
layout(constant_id = 4) const int OUT0 = 1;
layout(constant_id = 5) const int OUT1 = 2;
layout(constant_id = 6) const int OUT2 = 3;
const int W2 = W;
shared vec3 tile[gl_WorkGroupSize.x + 2 * (K + 7) / 31 * W];
shared float edge[K];
layout(set = 0, binding = 0) readonly buffer Values { vec4 values[]; };
layout(set = 0, binding = 1) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 2) buffer Sums { vec4 sums[]; };
layout(set = 0, binding = 3) writeonly buffer Result { float result[]; };
layout(set = 0, binding = 4) uniform Weights { vec4 weights[W]; };
layout(push_constant) uniform Push { BlurParameters p; };
void main() {
  const uint i = gl_GlobalInvocationID.x + p.first;
  tile[gl_LocalInvocationID.x] = values[i].xyz;
  barrier();
  vec3 sum = vec3(p.scale);
  for (uint j = 0; j < p.count; ++j) sum += tile[j] * weights[W2 - 1].xyz;
  sums[i] += vec4(sum, 0);
#ifdef FAST
  result[i] = sum.y;
#else
  result[i] = sum.x;
#endif
}
""",
    "shaders/clear.comp": """\
// clear.comp: zeros.
// out 0 zeros u32[N]
// spec 0 WORKGROUP=32 | grid ceil(N / WORKGROUP) | shared 0 KiB
// loops none | error: none | fp32
#version 450
layout(local_size_x_id = 0) in;
layout(set = 0, binding = 0) writeonly buffer Zeros { uint zeros[]; };
void main() { zeros[gl_GlobalInvocationID.x] = 0; }
""",
    "shaders/common/parameters.glsl": """\
struct BlurParameters {
  uint first, count;  // rows
  float scale;
};
""",
    "src/vk/kernel.hpp": "constexpr std::uint32_t tile_rows = 32;\n",
    "src/vk/blur.cpp": """\
constexpr std::uint32_t work_group = 64;
auto pipeline = context.pipeline(fast ? shaders::blur_fast : shaders::blur, std::array{work_group, 24u, 8u, 0u});
""",
    "src/vk/clear.cpp": """\
auto pipeline = context.pipeline(shaders::clear, std::array{tile_rows});
""",
}

# (file, what becomes what, the problem reported)
WRONG_HEADERS = [
    ("// blur.comp:", "// blurr.comp:",
     "blur.comp:1: first line: expected '// blur.comp: …', found '// blurr.comp:"),
    ("// in  0 values   f32[P,4]\n", "", "blur.comp:3: binding's number: expected 0, found 1"),
    ("// in  0 ", "// mod 0 ", "blur.comp:3: binding 0's kind: expected in, found mod"),
    ("// mod 2 ", "// in  2 ", "blur.comp:5: binding 2's kind: expected mod, found in"),
    ("// out 3 ", "// mod 3 ", "blur.comp:6: binding 3's kind: expected out, found mod"),
    ("// con 4 ", "// in  4 ", "blur.comp:7: binding 4's kind: expected con, found in"),
    ("// in  1 index    u32", "// in  1 index    f32",
     "blur.comp:4: binding 1's element: expected u32, found f32"),
    ("// in  1 index    u32", "// in  1 index    u16",
     "blur.comp:4: binding: expected 'in|out|mod|con N name"),
    ("// in  1 index", "// in  1 tiles", "blur.comp:4: binding 1's name: expected index, found tiles"),
    ("// con 4 weights  f32[W,4]   of vectors\n//                           and more\n", "",
     "blur.comp:1: binding 4: expected 'con 4 Weights f32[…]', found none in the header"),
    ("and more\n", "and more\n// in  5 more f32[1]\n",
     "blur.comp:9: binding 5: expected none, as in the shader, found"),
    ("// spec 0", "// specs 0", "blur.comp:1: header: expected a line 'spec I NAME"),
    ("spec 0 WORKGROUP=64", "spec 0 WORKGROUP",
     "blur.comp:9: specialization constant 0: expected WORKGROUP=N"),
    ("spec 0 WORKGROUP=64", "spec 0 WORKGROUP=256",
     "blur.comp:9: specialization constant 0: expected WORKGROUP=N"),
    ("spec 0 WORKGROUP=64", "spec 0 WORKGROUP=32", "blur.comp:9: work group size of blur: expected 64, found 32"),
    ("  1 K≤64", "  1 KEYS≤64", "blur.comp:9: specialization constant 1: expected K, found KEYS"),
    ("  1 K≤64", "  2 K≤64", "blur.comp:9: id of K: expected 1, found 2"),
    ("  1 K≤64", "  1 K≤16", "blur.comp:9: bound of K: expected at least its default 24, found 16"),
    ("  2 W=8", "  2 W=16", "blur.comp:9: default of W: expected 8, found 16"),
    ("  2 W=8", "  2 W = 8",
     "blur.comp:9: specialization constants: expected 'I NAME[=default or ≤bound]' each"),
    ("//      3 NEAR", "//     ", "blur.comp:9: id of OUT: expected 3, found 4"),
    ("  4–6 OUT≤4 |", " |", "blur.comp:9: specialization constant 5: expected '5 OUT1', found none"),
    ("4–6 OUT≤4", "4–6 OUT≤2", "blur.comp:9: bound of OUT2: expected at least its default 3, found 2"),
    ("4–6 OUT≤4 |", "4–6 OUT≤4  7 FAR |",
     "blur.comp:9: specialization constant 7: expected none, as in the shader, found FAR"),
    (" | grid tiles\n", "\n", "blur.comp:9: header: expected 'spec I NAME"),
    ("… ≤ 1.5 KiB", "… ≤ 1 KiB",
     "blur.comp:9: shared memory: expected 1376 bytes, as in the shader, found 1 KiB"),
    ("… ≤ 1.5 KiB", "… ≤ 0 KiB",
     "blur.comp:9: shared memory: expected 1376 bytes, as in the shader, found 0 KiB"),
    ("… ≤ 1.5 KiB", "… ≤ 32 KiB", "blur.comp:9: shared memory: expected at most 16 KiB, found 32 KiB"),
    ("// loops ≤ P/2 + K = 640 < 65535", "// loops none",
     "blur.comp:12: loops: expected a bound: the shader has loops, found none"),
    ("= 640 <", "= 70000 <", "blur.comp:12: loops: expected 'none', '≤ … N' or '≤ … < 65535'"),
    ("= 640 < 65535", "",
     "blur.comp:12: loops: expected 'none', '≤ … N' or '≤ … < 65535', found '≤ P/2 + K'"),
    ("error: 1e-6 of", "", "blur.comp:12: header: expected 'loops … | error: … | fp32'"),
    (" | fp32", "", "blur.comp:12: header: expected 'loops … | error: … | fp32'"),
]
WRONG_SOURCES = [
    ("shaders/blur.comp", "readonly buffer Values", "buffer Values",
     "blur.comp:3: binding 0's kind: expected mod, found in"),
    ("shaders/blur.comp", "binding = 3) writeonly", "binding = 7) writeonly",
     "blur.comp:1: binding 7: expected 'out 7 Result f32[…]', found none in the header"),
    ("shaders/blur.comp", "const int W = 8;", "const int W = 9;",
     "blur.comp:9: default of W: expected 9, found 8"),
    ("shaders/blur.comp", "  result[i] = sum.y;", "  result[i] = float(double(sum.y) * 2.1lf);",
     "blur.comp:12: precision: expected fp64, as in the shader, found fp32"),
    ("src/vk/blur.cpp", "work_group = 64", "work_group = 128",
     "blur.comp:9: work group size of blur_fast: expected 128, found 64"),
    ("src/vk/blur.cpp", "{work_group,", "{lanes,",
     "blur.comp:9: work group size of blur: expected a named constant in src/vk, found 64"),
    ("src/vk/clear.cpp", "shaders::clear", "shaders::wipe",
     "clear.comp:1: clear: expected 'shaders::clear' in src/vk, found none"),
]


class CheckHeadersTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        for path, text in PROJECT.items():
            self.write(path, text)
        self.build()

    def write(self, path, text):
        (self.root / path).parent.mkdir(parents=True, exist_ok=True)
        (self.root / path).write_text(text, encoding="utf-8")

    def build(self):
        self.modules = []
        for name, stem, *flags in (("blur", "blur"), ("blur_fast", "blur", "-DFAST"), ("clear", "clear")):
            self.modules.append(self.root / f"{name}.plain.spv")
            subprocess.run([GLSLC, "--target-env=vulkan1.2", "-O0", *flags, "-I", self.root / "shaders", "-o",
                            self.modules[-1], self.root / f"shaders/{stem}.comp"], check=True)

    def check(self):
        done = subprocess.run([sys.executable, "-B", "-X", "utf8", CHECK, "--source", self.root, *self.modules],
                              text=True, encoding="utf-8", capture_output=True)
        return done.returncode, done.stdout.splitlines(), done.stderr

    def change(self, path, before, after):
        self.assertEqual(PROJECT[path].count(before), 1, before)
        self.write(path, PROJECT[path].replace(before, after))

    def refused(self, problem):
        status, lines, errors = self.check()
        self.assertEqual((status, errors), (1, ""), lines)
        self.assertTrue(any(problem in line for line in lines), f"no '{problem}' in {lines}")
        for line in lines:
            self.assertRegex(line, r"^[\w/.]+:\d+: .+: expected .+, found .+")

    def test_right(self):
        self.assertEqual(self.check(), (0, ["3 shaders: headers and SPIR-V agree"], ""))

    def test_wrong_header(self):
        for before, after, problem in WRONG_HEADERS:
            with self.subTest(before=before, after=after):
                self.change("shaders/blur.comp", before, after)
                self.refused(problem)

    def test_wrong_source(self):
        for path, before, after, problem in WRONG_SOURCES:
            with self.subTest(path=path, before=before, after=after):
                self.change(path, before, after)
                if path == "shaders/blur.comp":
                    self.build()
                self.refused(problem)
                self.write(path, PROJECT[path])
                if path == "shaders/blur.comp":
                    self.build()

    def test_loops_that_are_unrolled_or_bounded_by_an_expression(self):
        clear = "shaders/clear.comp"
        unrolled = "#extension GL_EXT_control_flow_attributes : require\nlayout(local_size_x_id"
        self.write(clear, PROJECT[clear].replace("layout(local_size_x_id", unrolled).replace(
            "{ zeros", "{ [[unroll]] for (int i = 0; i < 3; ++i) zeros"))
        self.build()
        self.assertEqual(self.check()[0], 0)
        for loops in ("≤ 12", "≤ N/32 < 65535", "≤ N ≤ 128 < 65535 for N ≤ 70000"):
            self.write(clear, PROJECT[clear].replace("loops none", f"loops {loops}"))
            self.assertEqual(self.check()[0], 0, loops)

    def test_unreadable(self):
        clear = self.modules[-1]
        for damage in (b"", b"not SPIR-V at all...", clear.read_bytes()[:-12]):
            clear.write_bytes(damage)
            status, lines, errors = self.check()
            self.assertEqual((status, lines), (1, []))
            self.assertRegex(errors, re.compile(r"^check_headers: .*clear\.plain\.spv: \w+"))
        clear.unlink()
        self.assertIn("clear.plain.spv", self.check()[2])

    def test_module_of_no_shader(self):
        self.modules[-1] = self.modules[-1].rename(self.root / "wipe.plain.spv")
        status, lines, errors = self.check()
        self.assertEqual((status, lines), (1, []))
        self.assertIn("wipe.plain.spv: no such shader in ", errors)


if __name__ == "__main__":
    unittest.main()
