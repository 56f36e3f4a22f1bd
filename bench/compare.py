#!/usr/bin/env python3
"""Compares what Google Benchmark programs measured.

  compare.py OLD.json NEW.json                           two recorded runs
  compare.py --interleave N OLD_PROGRAM NEW_PROGRAM      two programs, run in turn: for noisy machines
  compare.py --counters EXPECTED.json NEW.json           counters that must not change at all

Ratios are new/old; several repetitions of a benchmark count as their median. Exit status: 0; 1 if a ratio exceeds
--threshold or a gated counter differs; 2 if the input is no good.
"""

import argparse
import json
import math
import statistics
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

SECONDS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}


class BadInput(Exception):
    """Its text is the one line that the user gets."""


class Run(NamedTuple):
    source: str
    rows: dict[str, list[dict]]  # benchmark → its repetitions
    failures: dict[str, str]  # benchmark → why it has fewer rows, or none


class Sample(NamedTuple):
    values: list[float]
    unit: str

    def spread(self):
        return f"{digits(min(self.values))}..{digits(max(self.values))}" if len(self.values) > 1 else "-"

    def __str__(self):
        return f"{digits(median(self.values))} {self.unit}".rstrip()


def median(values):
    # A NaN has no place in an order: sorting would let it hide.
    return math.nan if any(map(math.isnan, values)) else statistics.median(values)


def digits(x):
    """Four significant digits, and never fewer than the integer part has."""
    if x == 0 or not math.isfinite(x) or abs(x) < 1e-3:
        return f"{x:.4g}"
    return f"{x:,.{max(0, 3 - math.floor(math.log10(abs(x))))}f}"


def parse(data, source):
    try:
        return json.loads(data)
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{source}: not JSON ({error})") from None


def load(path):
    return parse(Path(path).read_bytes(), path)


def run_of(document, source):
    rows = document.get("benchmarks") if isinstance(document, dict) else None
    if not isinstance(rows, list) or not all(isinstance(r, dict) and isinstance(r.get("name"), str) for r in rows):
        raise BadInput(f"{source}: not the output of a Google Benchmark program")
    repetitions, medians, failures = {}, {}, {}
    for row in rows:
        name = str(row.get("run_name", row["name"]))
        if row.get("error_occurred") or row.get("skipped"):  # it has times all the same; they mean nothing
            failures[name] = row.get("error_message") or row.get("skip_message") or "no reason given"
        elif row.get("run_type", "iteration") == "iteration":
            repetitions.setdefault(name, []).append(row)
        elif row.get("aggregate_name") == "median":
            medians[name] = [row]
    if not repetitions and not medians and not failures:
        raise BadInput(f"{source}: holds no benchmarks")
    # A recorded median counts only where its repetitions were not recorded.
    return Run(source, medians | repetitions, failures)


def samples(run, metric):
    """Benchmark → Sample, for those that have the metric."""
    found = {}
    for name, rows in run.rows.items():
        values = [row[metric] for row in rows if type(row.get(metric)) in (int, float)]
        unit = str(rows[0].get("time_unit", "ns")) if metric in ("real_time", "cpu_time") else ""
        if unit and unit not in SECONDS:
            raise BadInput(f"{run.source}: {name}: unknown time unit '{unit}'")
        if values:
            found[name] = Sample(values, unit)
    if not found and not run.failures:
        raise BadInput(f"{run.source}: no benchmark has '{metric}'")
    return found


def paired(old, new, metric):
    before, after = samples(old, metric), samples(new, metric)
    return {name: (before[name], after[name]) for name in before if name in after}


def ratio(old, new):
    a, b = median(old.values), median(new.values)
    if a == 0:
        return 1.0 if b == 0 else b * math.inf
    return b / a * (SECONDS.get(new.unit, 1) / SECONDS.get(old.unit, 1))


def report(old, new, ratios, more_titles, more, args):
    """The table, what is missing from it, and the verdict; ratios and more: benchmark → ratio, further cells."""
    table = [("benchmark", "old", "new", "new/old", *more_titles)] + [
        (name, *map(str, pair), f"{ratios[name]:.3f}", *more[name])
        for name, pair in paired(old, new, args.metric).items() if name in ratios]
    widths = [max(map(len, column)) for column in zip(*table)]
    for first, *rest in table if ratios else []:
        print(f"{first:<{widths[0]}}", *(f"{cell:>{width}}" for cell, width in zip(rest, widths[1:])), sep="  ")
    for run, other in ((old, new), (new, old)):
        for name, why in run.failures.items():
            print(f"failed in {run.source}: {name}: {why}")
        theirs = samples(other, args.metric).keys() | other.failures.keys()
        for name in (name for name in samples(run, args.metric) if name not in theirs):
            print(f"no {args.metric} in {other.source}:" if name in other.rows else f"only in {run.source}:", name)
    logs = [math.log(r) for r in ratios.values() if 0 < r < math.inf]
    if logs:
        print(f"geometric mean ({len(logs)} of {len(ratios)}): {math.exp(statistics.fmean(logs)):.3f}")
    if args.threshold is None:
        return 0
    if not ratios:  # a gate that compares nothing must not look passed
        raise BadInput(f"{new.source}: no benchmark with '{args.metric}' in common with {old.source}")
    over = [name for name, r in ratios.items() if not r <= args.threshold]  # NaN is over
    for name in over:
        print(f"over {args.threshold:g}: {name}")
    return 1 if over else 0


def compare_files(args):
    old, new = (run_of(load(path), path) for path in (args.old, args.new))
    pairs = paired(old, new, args.metric)
    ratios = {name: ratio(*pair) for name, pair in pairs.items()}
    spreads = {name: [sample.spread() for sample in pair] for name, pair in pairs.items()}
    return report(old, new, ratios, ("old min..max", "new min..max"), spreads, args)


def run_program(program, pattern):
    # Resolved: a bare name means the file here, not one in PATH.
    command = [str(Path(program).resolve()), "--benchmark_format=json", f"--benchmark_filter={pattern}"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace")
    if done.returncode or not done.stdout.strip():  # a filter that matches nothing ends in success and silence
        problem = f"exit status {done.returncode}" if done.returncode else f"ran no benchmark for '{pattern}'"
        raise BadInput(": ".join([program, problem, *done.stderr.strip().splitlines()[-1:]]))
    return run_of(parse(done.stdout, program), program)


def merge(runs):
    rows = {name: [row for r in runs for row in r.rows.get(name, [])] for run in runs for name in run.rows}
    return Run(runs[0].source, rows, {name: why for run in runs for name, why in run.failures.items()})


def compare_interleaved(args):
    rounds, per_round, quartiles = [], {}, {}
    for i in range(args.interleave):
        # AB BA AB …: a drift of the machine's speed favours neither.
        order = (args.old, args.new) if i % 2 == 0 else (args.new, args.old)
        runs = [run_program(program, args.filter) for program in order]
        rounds.append(runs if i % 2 == 0 else runs[::-1])
    for old, new in rounds:
        # A ratio within a round sees one load; a ratio of medians over all rounds would see two.
        for name, pair in paired(old, new, args.metric).items():
            per_round.setdefault(name, []).append(ratio(*pair))
    for name, rs in per_round.items():
        q1, _, q3 = statistics.quantiles(rs, n=4, method="inclusive") if len(rs) > 1 else rs * 3
        quartiles[name] = f"{q1:.3f}..{q3:.3f}", str(len(rs))
    ratios = {name: median(rs) for name, rs in per_round.items()}
    return report(*map(merge, zip(*rounds)), ratios, ("quartiles", "rounds"), quartiles, args)


def compare_counters(args):
    document = load(args.old)
    gated = document.get("gated") if isinstance(document, dict) else None
    expected = document.setdefault("benchmarks", {}) if gated else None
    if (not isinstance(gated, list) or not all(isinstance(counter, str) for counter in gated)
            or not isinstance(expected, dict) or not all(isinstance(c, dict) for c in expected.values())):
        raise BadInput(f'{args.old}: not of the form {{"gated": [counter, ...], "benchmarks": {{name: {{...}}}}}}')
    run = run_of(load(args.new), args.new)
    found = {}  # benchmark → counter → the values its repetitions had: one, if all is well
    for name, rows in run.rows.items():
        for counter in gated:
            values = {row[counter] for row in rows if type(row.get(counter)) in (int, float)}
            if values:
                found.setdefault(name, {})[counter] = [int(v) if v % 1 == 0 else v for v in sorted(values)]
    return update_expected(document, found, run, args.old) if args.update else check_expected(document, found, run)


def update_expected(document, found, run, path):
    for name, why in run.failures.items():  # without this, it would leave the gate unseen
        raise BadInput(f"{run.source}: {name} failed: {why}")
    for counter in set(document["gated"]).difference(*found.values()):
        raise BadInput(f"{run.source}: no benchmark has the gated counter '{counter}'")
    for name, counters in found.items():
        for counter, values in counters.items():
            if len(values) > 1 or not math.isfinite(values[0]):
                raise BadInput(f"{run.source}: {name}: {counter} is not one number: {values}")
    document["benchmarks"] = {name: {c: values[0] for c, values in cs.items()} for name, cs in found.items()}
    Path(path).write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{path}: {len(found)} benchmarks written")
    return 0


def check_expected(document, found, run):
    expected, differences, same = document["benchmarks"], [], 0
    for name in expected | found:
        if name in run.failures:
            differences.append(f"{name}: failed: {run.failures[name]}")
        elif name not in run.rows:
            differences.append(f"{name}: missing from {run.source}")
        else:
            for counter in document["gated"]:
                want, have = expected.get(name, {}).get(counter), found.get(name, {}).get(counter)
                same += have == [want]
                if have != [want] and not have is want is None:
                    wanted = "not expected" if want is None else f"expected {want}"
                    is_now = f"is {' or '.join(map(str, have))}" if have else "missing"
                    differences.append(f"{name}: {counter}: {wanted}, {is_now}")
    for counter in sorted(set(document["gated"]).difference(*expected.values(), *found.values())):
        differences.append(f"{counter}: gated, but no benchmark has it")  # a misspelt name would gate nothing
    print("\n".join(differences) or f"{same} counters as expected")
    return 1 if differences else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", metavar="OLD", help="JSON file, or program with --interleave")
    parser.add_argument("new", metavar="NEW", help="the same of the other side")
    parser.add_argument("--metric", help="real_time (default), cpu_time or the name of a counter")
    parser.add_argument("--threshold", type=float, metavar="R", help="exit 1 if any ratio new/old exceeds R")
    parser.add_argument("--interleave", type=int, metavar="N", help="run the two programs in turn, N times each")
    parser.add_argument("--filter", metavar="RE", help="the benchmarks to run when interleaving (default: all)")
    parser.add_argument("--counters", action="store_true", help="compare the counters that OLD gates, exactly")
    parser.add_argument("--update", action="store_true", help="with --counters: rewrite OLD from NEW")
    args = parser.parse_args()
    compare = compare_counters if args.counters else compare_interleaved if args.interleave else compare_files
    if args.interleave is not None and args.interleave < 1:
        parser.error("--interleave needs at least one round")
    if args.counters and (args.interleave, args.metric, args.threshold) != (None, None, None):
        parser.error("--counters goes with none of --interleave, --metric and --threshold")
    if (args.update and not args.counters) or (args.filter is not None and not args.interleave):
        parser.error("--update needs --counters, --filter needs --interleave")
    args.metric, args.filter = args.metric or "real_time", args.filter or "."
    try:
        return compare(args)
    except BadInput as error:
        print(error, file=sys.stderr)
    except OSError as error:
        print(f"{error.filename}: {error.strerror}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
