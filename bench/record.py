#!/usr/bin/env python3
"""Runs bitr_bench as a whole and keeps what it measured: bench/results/DATE-DEVICE.json and a row in its README.md.

  record.py [--build build/dev] [--repetitions 5] [--filter RE] [--note "a busy machine"]

VK_DRIVER_FILES and BITR_DEVICE choose the Vulkan device. The file holds medians (compare.py reads it), each with the
fastest and the slowest repetition.
"""

import argparse
import datetime
import json
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

RESULTS = Path(__file__).resolve().parent / "results"
COLUMNS = ("recorded", "Vulkan device", "kNN at 1024, Gpair/s", "dispatch, µs", "pair, ms", "16 pairs, ms each",
           "on the CPU, ms", "ceilings of the device", "of the CPU", "conditions")


def real_time_priority():
    """The prefix of a command that nothing else on the machine interrupts, where that is allowed."""
    prefix = ["chrt", "-f", "10"]
    try:
        return prefix if subprocess.run([*prefix, "true"], capture_output=True).returncode == 0 else []
    except FileNotFoundError:
        return []


def commit():
    """The commit of the sources here, which the build is taken to be of; "-dirty" if they are changed."""
    command = ["git", "describe", "--always", "--dirty", "--exclude=*"]
    done = subprocess.run(command, cwd=RESULTS, capture_output=True, text=True)
    return done.stdout.strip() or "unknown"


def measure(args, prefix):
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.json"
        command = [*prefix, args.build / "bitr_bench", f"--benchmark_repetitions={args.repetitions}",
                   f"--benchmark_min_time={args.min_time}", f"--benchmark_out={out}", "--benchmark_color=false",
                   *([f"--benchmark_filter={args.filter}"] if args.filter else []), *args.more]
        subprocess.run(command, check=True)
        return json.loads(out.read_text(encoding="utf-8"))


def medians(document):
    """One row per benchmark: the median of every number over its repetitions."""
    rows = {}
    for row in document["benchmarks"]:
        if row.get("run_type") == "iteration":
            rows.setdefault(row["run_name"], []).append(row)
    for name, repetitions in rows.items():
        failure = next((row for row in repetitions if row.get("error_occurred")), None)
        if failure:
            yield failure
            continue
        row = {"name": f"{name}_median", "run_name": name, "run_type": "aggregate", "aggregate_name": "median",
               "repetitions": len(repetitions), "time_unit": repetitions[0]["time_unit"]}
        times = [repetition["real_time"] for repetition in repetitions]
        row |= {"fastest": min(times), "slowest": max(times)}
        counters = repetitions[0].keys() - {"repetitions", "repetition_index", "threads", "iterations",
                                            "family_index", "per_family_instance_index"}
        for key in sorted(counters, key=list(repetitions[0]).index):
            if isinstance(repetitions[0][key], (int, float)) and not isinstance(repetitions[0][key], bool):
                row[key] = float(f"{statistics.median(r[key] for r in repetitions):.6g}")
        yield row


def table_row(context, rows, file, note):
    def value(name, counter="real_time"):
        for suffix in ("manual_time", "real_time"):
            if counter in (row := rows.get(f"{name}/{suffix}", {})) and "error_occurred" not in row:
                return row[counter]
        return None

    def cell(number, digits=2, factor=1.0, target=None):
        if number is None:
            return "–"
        return f"{number * factor:.{digits}f}" + (f" ({number * factor / target:.2f} of {target:g})" if target else "")

    def ceilings(backend):
        return (f"{cell(value(f'ceiling/arithmetic/{backend}', 'GFLOP/s'), 0)} GFLOP/s, "
                f"{cell(value(f'ceiling/memory/{backend}', 'GB/s'), 1)} GB/s")

    return (f"[{context['date'][:10]}]({file.name})", f"{context.get('device', 'none')}; {context.get('driver', '')}",
            cell(value("knn/graph.index/1024x1/vulkan", "GFLOP/s"), 2, 1 / 8, 0.55),  # 8 operations a pair of points
            cell(value("dispatch/after_barrier/vulkan", "us_per_dispatch"), 1, 1, 10),
            cell(value("model/1024x1/vulkan"), 1, 1, 40),
            cell(value("model/1024x16/vulkan"), 1, 1 / 16), cell(value("model/1024x1/cpu"), 1), ceilings("vulkan"),
            f"{context['processor']}, {context['threads']} threads: {ceilings('cpu')}", note)


def write_table(row, file):
    readme = RESULTS / "README.md"
    lines = readme.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if f"]({file.name})" not in line]
    last = max(i for i, line in enumerate(kept) if line.startswith("|"))
    kept.insert(last + 1, "| " + " | ".join(row) + " |")
    readme.write_text("\n".join(kept) + "\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=Path("build/dev"), help="the build's folder")
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--min-time", type=float, default=0.1, help="seconds a repetition, at least")
    parser.add_argument("--filter", help="the benchmarks to run (default: all)")
    parser.add_argument("--note", default="", help="the conditions, for the table")
    parser.add_argument("more", nargs="*", help="further options of bitr_bench, after --")
    args = parser.parse_args()

    prefix, sources = real_time_priority(), commit()
    devices = subprocess.run([args.build / "bitr", "devices", "--json"], capture_output=True, text=True, check=True)
    document = measure(args, prefix)
    context = document["context"]
    for key in ("executable", "host_name"):
        context.pop(key, None)
    context |= {"commit": sources, "devices": json.loads(devices.stdout)["devices"],
                "priority": " ".join(prefix) or "normal"}
    rows = list(medians(document))

    device = context.get("device", "cpu").split("(")[0].strip()
    slug = re.sub(r"[^a-z0-9]+", "-", device.lower()).strip("-")
    file = RESULTS / f"{context['date'][:10]}-{slug}.json"
    lines = ",\n  ".join(json.dumps(row, ensure_ascii=False) for row in rows)
    file.write_text('{\n "context": ' + json.dumps(context, indent=2, ensure_ascii=False).replace("\n", "\n ") +
                    ',\n "benchmarks": [\n  ' + lines + "\n ]\n}\n", encoding="utf-8")
    load = ", ".join(f"{x:.1f}" for x in context.get("load_avg", []))
    conditions = [sources, args.note, f"load {load}", f"median of {args.repetitions}", " ".join(prefix)]
    note = "; ".join(filter(None, conditions))
    write_table(table_row(context, {row["run_name"]: row for row in rows}, file, note), file)
    failed = [row["run_name"] for row in rows if row.get("error_occurred")]
    print(f"{file}: {len(rows)} benchmarks" + (f", failed: {', '.join(failed)}" if failed else ""))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
