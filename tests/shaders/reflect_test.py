"""Tests of bitr_reflect (cmake/reflect): what it says of small shaders, and what it refuses."""

import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

GLSLC = os.environ.get("GLSLC", "glslc")
REFLECT = os.environ["REFLECT"]

SHADER = """\
#version 450
#extension GL_EXT_samplerless_texture_functions : require
struct BlurParameters {
  uint first;
  float scale;
  int count;
};
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const int K = 24;
layout(constant_id = 2) const bool NEAR = false;
layout(constant_id = 3) const float UNUSED = 1.0;
layout(set = 0, binding = 0) readonly buffer Values { uint count; float values[]; };
layout(set = 0, binding = 4) buffer Sums { float sums[]; };
layout(set = 0, binding = 2) writeonly buffer Result { float result[]; };
layout(set = 0, binding = 3) uniform Weights { vec4 weights[4]; };
layout(set = 0, binding = 1) uniform textureBuffer Texels;
layout(set = 0, binding = 5) readonly buffer Unused { float unused[]; };
layout(set = 0, binding = 6) buffer Half { readonly uint length; float half_read[]; };
layout(push_constant) uniform Push { BlurParameters p; };
void main() {
  const uint i = gl_GlobalInvocationID.x + p.first;
  sums[i] += values[i] * texelFetch(Texels, int(i)).x * weights[NEAR ? 1 : 0].x;
  half_read[i] = K * p.scale * length;
  result[i] = sums[i];
}
"""

# What becomes what, and why it is refused.
WRONG = [
    ("binding = 5", "binding = 8", "binding 5 is missing"),
    ("set = 0, binding = 5", "set = 1, binding = 5", "a binding outside of set 0"),
    ("binding = 5", "binding = 4", "two buffers of one binding"),
    ("layout(local_size_x_id = 0) in;", "layout(local_size_x = 8) in;", "layout(local_size_x_id = 0) is missing"),
    ("local_size_x_id = 0", "local_size_x_id = 4", "layout(local_size_x_id = 0) is missing"),
    ("constant_id = 3", "constant_id = 4", "specialization constants with gaps between them"),
    ("uniform Push { BlurParameters p; }", "uniform Push { BlurParameters p; uint more; }",
     "push constants that are no structure"),
    ("  float scale;", "  vec2 offset;\n  float scale;", "push constants with gaps"),
    ("  uint first;", "  vec2 offset;\n  uint first;", "push constants other than numbers"),
    ("readonly buffer Unused { float unused[]; }", "readonly writeonly buffer Unused { float unused[]; }",
     "a buffer neither read nor written"),
    ("readonly buffer Unused { float unused[]; }", "readonly buffer Unused { float unused[]; } several[2]",
     "a binding that is no single buffer"),
    ("readonly buffer Unused { float unused[]; }", "uniform texture2D unused",
     "a binding that is neither a buffer nor a texel buffer"),
]


class ReflectTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        self.plain, self.shipped, self.header = (self.root / name for name in ("plain", "shipped", "header"))

    def compile(self, text):
        source = self.root / "blur.comp"
        source.write_text(text)
        for flag, path in (("-O0", self.plain), ("-O", self.shipped)):
            subprocess.run([GLSLC, "--target-env=vulkan1.2", flag, "-o", path, source], check=True)

    def reflect(self):
        done = subprocess.run([REFLECT, "blur", self.plain, self.shipped, self.header], text=True, capture_output=True)
        return done.returncode, done.stderr

    def test_declares_what_the_source_declares(self):
        self.compile(SHADER)
        self.assertEqual(self.reflect(), (0, ""))
        text = self.header.read_text()
        self.assertEqual(re.findall(r"Access::(\w+)", text),
                         ["read", "texels", "write", "constant", "modify", "read", "modify"])
        self.assertIn('ShaderOf<BlurParameters, 4> blur{"blur", blur_spirv, blur_bindings};', text)
        self.assertIn("static_assert(sizeof(BlurParameters) == 12);", text)
        words = re.search(r"blur_spirv\[\] = \{([\d,\n]+)\};", text)[1].replace("\n", "").rstrip(",").split(",")
        self.assertEqual(b"".join(int(word).to_bytes(4, "little") for word in words), self.shipped.read_bytes())

    def test_no_parameters(self):
        self.compile("#version 450\nlayout(local_size_x_id = 0) in;\nvoid main() {}\n")
        self.assertEqual(self.reflect(), (0, ""))
        text = self.header.read_text()
        self.assertIn("ShaderOf<NoParameters, 1> blur{", text)
        self.assertNotIn("Access::", text)
        self.assertNotIn("static_assert", text)

    def test_refuses_what_the_library_cannot_bind(self):
        for before, after, why in WRONG:
            with self.subTest(after=after):
                self.assertEqual(SHADER.count(before), 1, before)
                self.compile(SHADER.replace(before, after))
                self.assertEqual(self.reflect(), (1, f"bitr_reflect: {self.plain}: {why}\n"))
                self.assertFalse(self.header.exists())

    def test_leaves_a_header_that_is_right(self):
        self.compile(SHADER)
        self.reflect()
        os.utime(self.header, (1, 1))
        self.reflect()
        self.assertEqual(self.header.stat().st_mtime, 1)
        self.compile(SHADER.replace("p.scale", "p.count"))
        self.reflect()
        self.assertNotEqual(self.header.stat().st_mtime, 1)

    def test_unreadable(self):
        self.compile(SHADER)
        for path in (self.shipped, self.plain):
            for damage in (b"", b"not SPIR-V at all...", path.read_bytes()[:-12], path.read_bytes()[:-2]):
                path.write_bytes(damage)
                status, errors = self.reflect()
                self.assertEqual(status, 1)
                self.assertRegex(errors, rf"^bitr_reflect: {path}: \w+")
        self.assertFalse(self.header.exists())


if __name__ == "__main__":
    unittest.main()
