"""Tests of follow_adding_an_op.py, check_tour.py and check_names.py: pages that are right pass, others are found."""
import pathlib
import tempfile
import unittest

import check_names
import check_tour
import follow_adding_an_op

STEPS = [("src/ops/merge_pairs.hpp", "struct MergePairs {};\nint second;\n"), ("src/ops/op.hpp", "using Op = MergePairs;\n"),
         ("src/ops/CMakeLists.txt", "merge_pairs\n"), ("src/cpu/merge_pairs.cpp", "void cpu();\n"),
         ("shaders/merge_pairs.comp", "void main() {}\n"), ("src/vk/merge_pairs.cpp", "void vk();\n"),
         ("src/model/build.cpp", "ops::MergePairs merge;\n"), ("bench/merge_pairs_bench.cpp", "bool added;\n")]


def excerpt(name, code):
    return f"<!-- {name} -->\n```cpp\n{code}```\n"


def page(steps):
    text = "# Adding an operation\n\n"
    for number, (name, code) in enumerate(steps, 1):
        text += f"## {number}. A step: `{name}`\n\n{excerpt(name, code)}\n"
    return text + "## What tests it now\n\nIn the end, `src/ops/STEM.hpp` and [the rest](tour.md#rooms).\n"


class Project(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def write(self, name, text):
        (self.root / name).parent.mkdir(parents=True, exist_ok=True)
        (self.root / name).write_text(text, encoding="utf-8")


class FollowAddingAnOp(Project):
    def setUp(self):
        super().setUp()
        for name, code in STEPS:
            self.write(name, "// It begins.\n" + code)
        self.write("docs/tour.md", "")
        self.page(page(STEPS))

    def page(self, text):
        self.write("docs/adding-an-op.md", text)

    def found(self):
        return list(follow_adding_an_op.faults(self.root))

    def test_a_page_that_is_right(self):
        self.assertEqual(self.found(), [])

    def test_a_file_that_the_page_does_not_name(self):
        for name, text in (("src/vk/list.hpp", "int merge_pairs;"), ("tests/merge_pairs_test.cpp", ""),
                           ("tools/a.cpp", "ops::MergePairs")):
            self.write(name, text)
            self.assertEqual(self.found(), [f"the page does not name {name}, in which the example occurs"])
            (self.root / name).unlink()
        self.write("bench/results/old.json", "merge_pairs")
        self.assertEqual(self.found(), [])

    def test_a_step_that_is_left_out(self):
        self.page(page(STEPS[:2] + STEPS[3:]))
        self.assertEqual(self.found(), ["the steps are [1, 2, 3, 4, 5, 6, 7], not 1 … 8, a file in the title of each",
                                        "the page does not name src/ops/CMakeLists.txt, in which the example occurs"])

    def test_a_step_without_its_lines(self):
        self.page(page(STEPS).replace(excerpt(*STEPS[7]), ""))
        self.assertEqual(self.found(), ["step 8 is about bench/merge_pairs_bench.cpp and shows nothing"])

    def test_a_file_without_the_example(self):
        self.write("src/model/build.cpp", "int other;\n")
        self.page(page([*STEPS[:6], ("src/model/build.cpp", "int other;\n"), STEPS[7]]))
        self.assertEqual(self.found(), ["step 7: the example does not occur in src/model/build.cpp"])

    def test_lines_that_are_not_there(self):
        self.page(page(STEPS).replace("void vk();", "void other();"))
        self.assertEqual(self.found(), ["src/vk/merge_pairs.cpp does not have these lines, or not behind those shown before:"
                                        "\nvoid other();\n"])

    def test_lines_in_another_order(self):
        name = STEPS[0][0]
        ordered = excerpt(name, "struct MergePairs {};\n") + excerpt(name, "int second;\n")
        swapped = excerpt(name, "int second;\n") + excerpt(name, "struct MergePairs {};\n")
        self.page(page(STEPS).replace(excerpt(*STEPS[0]), ordered))
        self.assertEqual(self.found(), [])
        self.page(page(STEPS).replace(excerpt(*STEPS[0]), swapped))
        self.assertEqual(len(self.found()), 1)

    def test_names_and_links_to_nothing(self):
        self.page(page(STEPS) + "`src/ops/none.hpp` [none](none.md)\n")
        self.assertEqual(self.found(), ["adding-an-op.md: no src/ops/none.hpp",
                                        "adding-an-op.md: a link to none.md, which is not there"])


class Tour(Project):
    STORY = "# A tour\n\n`src/core`, then `src/graph/graph.hpp`.\n\n"
    TABLE = "## What may include what\n\n| `src/core` | |\n| `src/graph` | core |\n"

    def setUp(self):
        super().setUp()
        self.write("src/core/hash.hpp", '#include "core/base64.hpp"\n#include "other/thing.hpp"\n')
        self.write("src/graph/graph.hpp", '#include "core/hash.hpp"\n')
        self.page(self.STORY + self.TABLE)

    def page(self, text):
        self.write("docs/tour.md", text)

    def found(self):
        return list(check_tour.faults(self.root))

    def test_a_tour_that_is_right(self):
        self.assertEqual(self.found(), [])

    def test_a_room_that_is_left_out(self):
        self.page(self.STORY.replace("`src/core`", "The core") + self.TABLE)
        self.assertEqual(self.found(), ["tour.md: nothing is said of src/core"])
        self.page(self.STORY + self.TABLE.replace("| `src/graph` | core |\n", ""))
        self.assertEqual(self.found(), ["tour.md: the table has src/graph 0 times"])

    def test_an_arrow_that_is_not_in_the_table(self):
        self.write("src/core/more.cpp", '#include "graph/graph.hpp"\n')
        self.assertEqual(self.found(), ["src/core includes graph, which the table of tour.md does not allow"])

    def test_a_circle(self):
        self.page(self.STORY + self.TABLE.replace("| `src/core` | |", "| `src/core` | graph |"))
        self.assertEqual(self.found(), ["tour.md: the table has src/graph below src/core, which may include it"])

    def test_a_room_that_is_not_there(self):
        self.page(self.STORY + self.TABLE.replace("| core |", "| core, cpu |"))
        self.assertEqual(self.found(), ["tour.md: no src/cpu"])


class Names(Project):
    def found(self):
        return list(check_names.faults(self.root))

    def test_what_is_there(self):
        self.write("src/io/file.cpp", "")
        self.write("README.md", "`src/io/file.cpp`, `src/io`, `src/STEM.cpp`, `viewer/node_modules`, `build/dev`,\n"
                                "[a page](docs/a.md#part), [me](#me), [the web](https://example.org/none.md)\n")
        self.write("docs/a.md", "[file](../src/io/file.cpp)\n")
        self.assertEqual(self.found(), [])

    def test_what_is_not_there(self):
        self.write("docs/a.md", "`src/io/none.hpp`, [none](../src/none.hpp)\n")
        self.assertEqual(self.found(), ["a.md: no src/io/none.hpp", "a.md: a link to ../src/none.hpp, which is not there"])
        (self.root / "docs/a.md").unlink()
        self.assertEqual(self.found(), [f"{self.root}: no pages"])


if __name__ == "__main__":
    unittest.main()
