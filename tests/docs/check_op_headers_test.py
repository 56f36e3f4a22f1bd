"""Tests of check_op_headers.py: a contract in form passes, and each way to lose its form is found."""
import unittest

from check_op_headers import faults

GOOD = """// blur: a mean over neighbours.
//   out_i = Σ_j f_j / k
// in  features T[P, width]      one or more
//       of the same width
// in  index u32[Q, k]
// out means T[Q, width]
// error float_error(), relative to the largest entry of the output
// source §4 of the paper
#pragma once
// in  anything T[P]   in  else T[Q]
  double float_error() const { return 1e-6; }
"""


class OpHeaders(unittest.TestCase):
    def found(self, *changes):
        text = GOOD
        for old, new in changes:
            self.assertIn(old, text)
            text = text.replace(old, new, 1)
        return [fault for _, fault in faults("blur", text)]

    def test_a_contract_in_form(self):
        self.assertEqual(self.found(), [])
        self.assertEqual(self.found(("// source §4 of the paper\n", "")), [])

    def test_a_reflowed_table(self):
        reflowed = ["a tensor or entry that does not begin its line"]
        self.assertEqual(self.found(("\n// in  index", "   in  index")), reflowed)
        self.assertEqual(self.found(("\n// out means", " out means")), reflowed + ["no line '// out …'"])
        self.assertEqual(self.found(("\n//       of the same width\n// in  index", "\n//       of the same in  index")),
                         reflowed)
        self.assertEqual(self.found(("\n// error", " error")), reflowed + ["no line '// error …'"])
        self.assertIn(reflowed[0], self.found(("k\n// in  features", "k. in  features")))

    def test_the_bound(self):
        wrong = ["the error is not float_error(), and that alone"]
        self.assertEqual(self.found(("// error float_error()", "// error 1e-6")), wrong)
        self.assertEqual(self.found(("largest entry", "1e-6 of the largest entry")), wrong)
        self.assertEqual(self.found(("  double float_error()", "  double error()")), wrong)
        self.assertEqual(self.found(("  double float_error()", "  double error()"),
                                    ("// error float_error(), relative", "// error none, relative")), [])

    def test_prose_behind_the_table(self):
        self.assertEqual(self.found(("//       of the same width", "// of the same width")), ["prose behind the table"])

    def test_what_is_missing(self):
        self.assertEqual(self.found(("// blur:", "// blot:")), ["the first line is not '// blur: …'"])
        self.assertEqual(self.found(("// out means T[Q, width]\n", "")), ["no line '// out …'"])
        self.assertEqual(len([f for _, f in faults("blur", "#pragma once\n")]), 5)

    def test_the_order(self):
        late = self.found(("// in  index u32[Q, k]\n// out means T[Q, width]",
                           "// out means T[Q, width]\n// in  index u32[Q, k]"))
        self.assertEqual(late, ["entries out of order: inputs, outputs, one error, source"])


if __name__ == "__main__":
    unittest.main()
