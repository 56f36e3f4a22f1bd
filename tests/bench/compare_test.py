"""Tests of bench/compare.py, run as its user runs it: files and programs in, text and an exit status out."""

import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

COMPARE = Path(__file__).resolve().parents[2] / "bench" / "compare.py"


def row(name, time, unit="ns", **more):
    return {"name": name, "run_name": name, "run_type": "iteration", "repetitions": 1, "repetition_index": 0,
            "threads": 1, "iterations": 10, "real_time": time, "cpu_time": 2 * time, "time_unit": unit, **more}


def aggregate(name, kind, time, **more):
    return row(name, time, **more) | {"name": f"{name}_{kind}", "run_type": "aggregate", "aggregate_name": kind}


def failed(name, why):
    return row(name, 0.0, error_occurred=True, error_message=why)


class CompareTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def write(self, name, content):
        path = self.folder / name
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return path

    def bench(self, name, *rows):
        return self.write(name, {"context": {}, "benchmarks": rows})

    def run_compare(self, *args):
        return subprocess.run([sys.executable, str(COMPARE), *map(str, args)], cwd=self.folder, text=True,
                              capture_output=True, encoding="utf-8", env=os.environ | {"PYTHONUTF8": "1"})

    def compare(self, *args, status=0):
        """The lines of the output, each split at white space."""
        done = self.run_compare(*args)
        self.assertEqual((done.returncode, done.stderr), (status, ""), done.stdout)
        return [line.split() for line in done.stdout.splitlines()]

    def refused(self, *args):
        """The one line of a refusal."""
        done = self.run_compare(*args)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        return done.stderr.strip()


class FilesTest(CompareTest):
    def test_one_row_each(self):
        old = self.bench("old.json", row("a/8", 100.0), row("b", 4.0, "ms"))
        new = self.bench("new.json", row("a/8", 200.0), row("b", 2.0, "ms"))
        lines = self.compare(old, new)
        self.assertEqual(lines[1], ["a/8", "100.0", "ns", "200.0", "ns", "2.000", "-", "-"])
        self.assertEqual(lines[2], ["b", "4.000", "ms", "2.000", "ms", "0.500", "-", "-"])
        self.assertEqual(lines[3], "geometric mean (2 of 2): 1.000".split())

    def test_columns_are_aligned(self):
        old = self.bench("old.json", row("short", 1.0), row("a_much_longer_name", 123456.0))
        lines = self.run_compare(old, old).stdout.splitlines()[:3]
        self.assertEqual(len({len(line) for line in lines}), 1, lines)

    def test_repetitions_count_as_their_median_and_their_aggregates_as_nothing(self):
        old = self.bench("old.json", *(row("a", t) for t in (10.0, 90.0, 20.0)), aggregate("a", "median", 999.0))
        new = self.bench("new.json", *(row("a", t) for t in (30.0, 50.0)), aggregate("a", "mean", 999.0))
        self.assertEqual(self.compare(old, new)[1],
                         ["a", "20.00", "ns", "40.00", "ns", "2.000", "10.00..90.00", "30.00..50.00"])

    def test_a_file_of_aggregates_gives_its_median(self):
        kinds = {"mean": 9.0, "median": 5.0, "cv": 0.1}
        old = self.bench("old.json", *(aggregate("a", kind, value) for kind, value in kinds.items()))
        new = self.bench("new.json", row("a", 10.0))
        self.assertEqual(self.compare(old, new)[1], ["a", "5.000", "ns", "10.00", "ns", "2.000", "-", "-"])

    def test_units_may_differ(self):
        old, new = self.bench("old.json", row("a", 2.0, "ms")), self.bench("new.json", row("a", 500.0, "us"))
        self.assertEqual(self.compare(old, new)[1][1:6], ["2.000", "ms", "500.0", "us", "0.250"])

    def test_metrics(self):
        old = self.bench("old.json", row("a", 1.0, flops=8.0), row("b", 1.0))
        new = self.bench("new.json", row("a", 3.0, flops=2.0), row("b", 1.0, flops=1.0))
        self.assertEqual(self.compare(old, new, "--metric", "cpu_time")[1][1:6], "2.000 ns 6.000 ns 3.000".split())
        lines = self.compare(old, new, "--metric", "flops")
        self.assertEqual(lines[1][:4], ["a", "8.000", "2.000", "0.250"])
        self.assertEqual(lines[2], ["no", "flops", "in", f"{old}:", "b"])
        self.assertIn("old.json: no benchmark has 'flips'", self.refused(old, new, "--metric", "flips"))

    def test_names_in_one_file_only(self):
        old = self.bench("old.json", row("a", 1.0), row("gone", 1.0))
        new = self.bench("new.json", row("a", 1.0), row("born", 1.0))
        lines = self.compare(old, new)
        self.assertIn(["only", "in", f"{old}:", "gone"], lines)
        self.assertIn(["only", "in", f"{new}:", "born"], lines)

    def test_failures_are_named_and_never_compared(self):
        old = self.bench("old.json", row("a", 1.0), row("b", 1.0))
        new = self.bench("new.json", row("a", 1.0), failed("b", "no device"))
        lines = self.compare(old, new)
        self.assertIn(["failed", "in", f"{new}:", "b:", "no", "device"], lines)
        self.assertEqual([line[0] for line in lines], ["benchmark", "a", "failed", "geometric"])

    def test_threshold(self):
        old = self.bench("old.json", row("a", 100.0), row("b", 100.0))
        new = self.bench("new.json", row("a", 110.0), row("b", 50.0))
        self.compare(old, new, "--threshold", "1.1")
        self.assertEqual(self.compare(old, new, "--threshold", "1.05", status=1)[-1], ["over", "1.05:", "a"])

    def test_threshold_takes_neither_nan_nor_nothing_for_a_pass(self):
        old = self.bench("old.json", row("a", 1.0), row("b", 1.0))
        nan = self.bench("nan.json", *(row("a", t) for t in (1.0, float("nan"), 1.0)))
        self.compare(old, nan, "--threshold", "9", status=1)
        self.assertIn("in common", self.refused(old, self.bench("c.json", row("c", 1.0)), "--threshold", "9"))

    def test_zero_has_no_logarithm(self):
        old = self.bench("old.json", row("a", 1.0, n=0), row("b", 1.0, n=0), row("c", 1.0, n=2))
        new = self.bench("new.json", row("a", 1.0, n=0), row("b", 1.0, n=5), row("c", 1.0, n=8))
        lines = self.compare(old, new, "--metric", "n")
        self.assertEqual([line[3] for line in lines[1:4]], ["1.000", "inf", "4.000"])
        self.assertEqual(lines[4], "geometric mean (2 of 3): 2.000".split())

    def test_bad_input(self):
        good = self.bench("good.json", row("a", 1.0))
        self.assertEqual(self.refused("missing.json", good), "missing.json: No such file or directory")
        self.assertEqual(self.refused(good, self.folder), f"{self.folder}: Is a directory")
        (self.folder / "binary.json").write_bytes(b"\xff\x00\x81")
        for content, problem in (("", "not JSON"), ('{"benchmarks": [', "not JSON"), ("[" * 100000, "not JSON"),
                                 ([], "not the output"), ({"benchmarks": {}}, "not the output"),
                                 ({"benchmarks": [1]}, "not the output"), ({"benchmarks": []}, "holds no benchmarks"),
                                 ({"benchmarks": [row("a", 1.0, "h")]}, "unknown time unit 'h'")):
            line = self.refused(good, self.write("bad.json", content))
            self.assertIn("bad.json: ", line)
            self.assertIn(problem, line)
        self.assertIn("binary.json: not JSON", self.refused(good, "binary.json"))

    def test_options_that_contradict(self):
        good = self.bench("good.json", row("a", 1.0))
        for options in (["--update"], ["--filter", "a"], ["--counters", "--threshold", "1"], ["--interleave", "0"],
                        ["--interleave", "1", "--counters"]):
            self.assertEqual(self.run_compare(good, good, *options).returncode, 2, options)


# Stands for a Google Benchmark program: its time is its speed times a load that grows with every run of either program.
PROGRAM = """#!{python}
import json, re, sys
name, speed = {name!r}, {speed}
options = dict(a.split("=", 1) for a in sys.argv[1:])
assert options["--benchmark_format"] == "json"
with open("log", "a+") as log:
    log.write(name)
    log.seek(0)
    load = len(log.read())
rows = [dict(name=b, run_type="iteration", real_time=load * speed, cpu_time=speed, time_unit="us")
        for b in ("fold", "knn") if re.search(options["--benchmark_filter"], b)]
if rows:
    print(json.dumps(dict(context=dict(), benchmarks=rows)))
else:
    sys.stderr.write("nothing to match\\n")
"""


class InterleaveTest(CompareTest):
    def program(self, name, speed=1.0, text=PROGRAM):
        path = self.write(name, text.format(python=sys.executable, name=name, speed=speed))
        path.chmod(0o755)
        return path

    def test_order_alternates_and_ratios_are_taken_within_a_round(self):
        lines = self.compare("--interleave", 4, "--filter", "kn", self.program("A", 1.0), self.program("B", 3.0))
        self.assertEqual((self.folder / "log").read_text(), "ABBAABBA")
        # Loads 1:2, 4:3, 5:6, 8:7, three times as slow: ratios 6, 2.25, 3.6 and 2.625.
        self.assertEqual(lines[0], ["benchmark", "old", "new", "new/old", "quartiles", "rounds"])
        self.assertEqual(lines[1], ["knn", "4.500", "us", "13.50", "us", "3.112", "2.531..4.200", "4"])
        self.assertEqual(len(lines), 3)

    def test_one_round_every_benchmark(self):
        self.program("A", 2.0), self.program("B", 3.0)
        lines = self.compare("--interleave", 1, "--metric", "cpu_time", "A", "B")  # files here, not commands
        self.assertEqual(lines[1], ["fold", "2.000", "us", "3.000", "us", "1.500", "1.500..1.500", "1"])
        self.assertEqual(lines[2][0], "knn")

    def test_threshold(self):
        programs = self.program("A", 2.0), self.program("B", 3.0)
        self.compare("--interleave", 2, "--metric", "cpu_time", "--threshold", "1.6", *programs)
        self.compare("--interleave", 2, "--metric", "cpu_time", "--threshold", "1.4", *programs, status=1)

    def test_bad_programs(self):
        good = self.program("A")
        self.assertIn("ran no benchmark for 'zz': nothing to match",
                      self.refused("--interleave", 1, "--filter", "zz", good, good))
        self.assertIn("No such file", self.refused("--interleave", 1, good, "./missing"))
        self.assertIn("Permission denied", self.refused("--interleave", 1, good, self.write("data", "x")))
        crash = self.program("crash", text="#!{python}\nimport sys\nsys.exit('out of luck')\n")
        self.assertIn("crash: exit status 1: out of luck", self.refused("--interleave", 1, good, crash))
        chat = self.program("chat", text="#!{python}\nprint('hello')\n")
        self.assertIn("chat: not JSON", self.refused("--interleave", 1, good, chat))


class CountersTest(CompareTest):
    def expected(self, benchmarks, gated=("dispatches", "arena_bytes")):
        return self.write("expected.json", {"gated": gated, "benchmarks": benchmarks})

    def check(self, expected, *rows, status=1):
        lines = self.compare("--counters", expected, self.bench("new.json", *rows), status=status)
        return [" ".join(line).replace(str(self.folder) + "/", "") for line in lines]

    def test_equal(self):
        expected = self.expected({"a": {"dispatches": 25, "arena_bytes": 1 << 40}, "b": {"dispatches": 1, "free": 3}})
        rows = [row("a", 1.0, dispatches=25.0, arena_bytes=float(1 << 40), free=9.0), row("b", 1.0, dispatches=1.0)]
        self.assertEqual(self.check(expected, *rows, row("cpu", 1.0), status=0), ["3 counters as expected"])

    def test_every_difference_is_printed(self):
        expected = self.expected({"a": {"dispatches": 25, "arena_bytes": 8}, "b": {"dispatches": 1},
                                  "gone": {"dispatches": 1}, "ill": {"dispatches": 1}})
        self.assertEqual(
            self.check(expected, row("a", 1.0, dispatches=26.0), row("b", 1.0, dispatches=1.0, arena_bytes=0.5),
                       failed("ill", "no device"), row("born", 1.0, dispatches=2.0)),
            ["a: dispatches: expected 25, is 26", "a: arena_bytes: expected 8, missing",
             "b: arena_bytes: not expected, is 0.5", "gone: missing from new.json", "ill: failed: no device",
             "born: dispatches: not expected, is 2"])

    def test_repetitions_must_agree(self):
        expected = self.expected({"a": {"dispatches": 25}}, gated=["dispatches"])
        self.assertEqual(self.check(expected, *(row("a", 1.0, dispatches=n) for n in (25.0, 25.0, 26.0))),
                         ["a: dispatches: expected 25, is 25 or 26"])

    def test_a_misspelt_counter_is_a_difference(self):
        expected = self.expected({"a": {"dispatches": 25}}, gated=["dispatches", "barrier"])
        self.assertEqual(self.check(expected, row("a", 1.0, dispatches=25.0, barriers=4.0)),
                         ["barrier: gated, but no benchmark has it"])

    def test_update_writes_what_then_passes(self):
        expected = self.write("expected.json", {"why": "kept", "gated": ["dispatches"]})
        rows = [row("a", 1.0, dispatches=25.0, free=1.0), row("a", 2.0, dispatches=25.0), row("cpu", 1.0)]
        self.compare("--counters", "--update", expected, self.bench("new.json", *rows))
        self.assertEqual(json.loads(expected.read_text()),
                         {"why": "kept", "gated": ["dispatches"], "benchmarks": {"a": {"dispatches": 25}}})
        self.check(expected, *rows, status=0)

    def test_update_refuses_what_would_weaken_the_gate(self):
        expected = self.expected({"a": {"dispatches": 25}}, gated=["dispatches"])
        before = expected.read_text()
        for rows, problem in (
                ([row("a", 1.0)], "no benchmark has the gated counter 'dispatches'"),
                ([row("a", 1.0, dispatches=1.0), failed("b", "no device")], "b failed: no device"),
                ([row("a", 1.0, dispatches=n) for n in (1.0, 2.0)], "a: dispatches is not one number: [1, 2]"),
                ([row("a", 1.0, dispatches=float("nan"))], "not one number")):
            self.assertIn(problem, self.refused("--counters", "--update", expected, self.bench("new.json", *rows)))
            self.assertEqual(expected.read_text(), before)

    def test_bad_input(self):
        new = self.bench("new.json", row("a", 1.0))
        for content in ([], {}, {"gated": []}, {"gated": [1]}, {"gated": "a"}, {"gated": ["a"], "benchmarks": []},
                        {"gated": ["a"], "benchmarks": {"a": 1}}):
            self.assertIn("bad.json: not of the form", self.refused("--counters", self.write("bad.json", content), new))
        self.assertIn("bad.json: not JSON", self.refused("--counters", self.write("bad.json", "{"), new))
        self.assertIn("none.json: No such file", self.refused("--counters", self.expected({}), "none.json"))


if __name__ == "__main__":
    unittest.main()
