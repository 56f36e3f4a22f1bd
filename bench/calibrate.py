#!/usr/bin/env python3
"""Fits the tables of src/confidence/calibration.cpp to what `bitr eval --confidence --csv` wrote.

    bench/calibrate.py fit VALIDATION.csv...      prints the three tables
Ridge-regularised logistic regression by Newton's method, no packages needed.
"""
import csv
import math
import sys

RIDGE = 0.01


def near_truth(row):
    return float(row["dr"]) <= 20 and float(row["dt_fraction"]) <= 0.1


def terms(row, kind):
    turn = [("turn", math.log1p(float(row["refined_by"])))] if kind == "refined" else []
    network = [
        ("rotation_spread", math.log1p(float(row["rotation_spread"]))),
        *turn,
        ("translation_spread", math.log1p(100 * float(row["translation_spread"]))),
        ("gap", float(row["rotation_gap"])),
    ] if kind != "fit" else []
    fit = [(name, float(row[column])) for name, column in (("score", "score"), ("overlap", "fit_overlap"), ("rims", "rims"))]
    return network + fit


def kind_of(row):
    if not row["rotation_spread"]:
        return "fit"
    return "refined" if row["refined_by"] else "network"


def solve(matrix, right):
    n = len(right)
    rows = [matrix[i][:] + [right[i]] for i in range(n)]
    for c in range(n):
        pivot = max(range(c, n), key=lambda r: abs(rows[r][c]))
        rows[c], rows[pivot] = rows[pivot], rows[c]
        for r in range(n):
            if r != c:
                factor = rows[r][c] / rows[c][c]
                rows[r] = [a - factor * b for a, b in zip(rows[r], rows[c])]
    return [rows[i][n] / rows[i][i] for i in range(n)]


def fit(samples, labels):
    """Weights of the terms as they are, the bias first."""
    n = len(samples[0])
    mean = [sum(s[j] for s in samples) / len(samples) for j in range(n)]
    scale = [max(1e-9, math.sqrt(sum((s[j] - mean[j]) ** 2 for s in samples) / len(samples))) for j in range(n)]
    rows = [[1.0] + [(s[j] - mean[j]) / scale[j] for j in range(n)] for s in samples]
    w = [0.0] * (n + 1)
    for _ in range(30):
        gradient = [0.0] * (n + 1)
        hessian = [[0.0] * (n + 1) for _ in range(n + 1)]
        for row, label in zip(rows, labels):
            p = 1 / (1 + math.exp(-max(-30.0, min(30.0, sum(a * b for a, b in zip(w, row))))))
            for j in range(n + 1):
                gradient[j] += (label - p) * row[j]
                for k in range(n + 1):
                    hessian[j][k] += p * (1 - p) * row[j] * row[k]
        for j in range(1, n + 1):
            gradient[j] -= RIDGE * len(rows) * w[j]
            hessian[j][j] += RIDGE * len(rows)
        w = [a + b for a, b in zip(w, solve(hessian, gradient))]
    raw = [w[j + 1] / scale[j] for j in range(n)]
    return [w[0] - sum(r * m for r, m in zip(raw, mean))] + raw


def main():
    if len(sys.argv) < 3 or sys.argv[1] != "fit":
        sys.exit(__doc__)
    rows = []
    for name in sys.argv[2:]:
        with open(name, newline="") as file:
            rows += [row for row in csv.DictReader(file) if row["failed"] == "0" and row["rims"]]
    for kind in ("network", "refined", "fit"):
        some = [row for row in rows if kind_of(row) == kind]
        if not some:
            continue
        labels = [near_truth(row) for row in some]
        names = [name for name, _ in terms(some[0], kind)]
        samples = [[value for _, value in terms(row, kind)] for row in some]
        weights = fit(samples, labels)
        usual = [sum(s[j] for s, l in zip(samples, labels) if l) / max(1, sum(labels)) for j in range(len(names))]
        print(f"// {len(some)} poses, {sum(labels)} of them right")
        print(f"constexpr Calibration of_{kind} = {{")
        print(f"    .bias = {weights[0]:.3g},")
        for name, weight, middle in zip(names, weights[1:], usual):
            print(f"    .{name} = {{{weight:.3g}, {middle:.3g}}},")
        print("};")


if __name__ == "__main__":
    main()
