#!/usr/bin/python3
"""What bitr assemble makes of real pairs with a known truth, beside what else there is, in one run:

  compare_registration.py BITR PAIRS [--runs N] [--only PART_OF_A_NAME] [--json FILE]

PAIRS: a folder with pairs.json (name, group, truth: T_reference_source, 4×4) and NAME/source.ply, NAME/reference.ply. Both
clouds are moved by random motions first, other ones in every run, the same for every method: bitr; where Debian's
python3-open3d is installed, features, RANSAC and ICP as its tutorial puts them together; the four ways to join principal
axes, each followed by ICP; nothing at all. Right: the rotation within 5°, the source's centroid within 5 % of the joined
object's diagonal. Wrong and sure: not right, with a confidence of 0.5 or more.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

try:
    import open3d
except ImportError:
    sys.exit("compare_registration.py: needs python3-open3d (apt-get install python3-open3d)")

registration = open3d.pipelines.registration


def random_motion(random, reach):
    """A rotation that is any with the same probability, and a shift of about `reach`."""
    matrix, triangle = np.linalg.qr(random.normal(size=(3, 3)))
    matrix *= np.sign(np.diag(triangle))
    if np.linalg.det(matrix) < 0:
        matrix[:, 0] *= -1
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = matrix, reach * random.normal(size=3)
    return motion


def rotation_degrees(a, b):
    cosine = (np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def icp(source, reference, start, size):
    for reach in (size / 30, size / 60):
        start = registration.registration_icp(source, reference, reach, start).transformation
    return np.asarray(start)


def by_features(source, reference, size):
    voxel = size / 60
    parts = []
    for cloud in (source, reference):
        part = cloud.voxel_down_sample(voxel)
        part.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(2 * voxel, 30))
        features = registration.compute_fpfh_feature(part, open3d.geometry.KDTreeSearchParamHybrid(5 * voxel, 100))
        parts.append((part, features))
    (a, a_features), (b, b_features) = parts
    found = registration.registration_ransac_based_on_feature_matching(
        a, b, a_features, b_features, True, 1.5 * voxel, registration.TransformationEstimationPointToPoint(False), 3,
        [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
         registration.CorrespondenceCheckerBasedOnDistance(1.5 * voxel)],
        registration.RANSACConvergenceCriteria(100_000, 0.999))
    plane = registration.TransformationEstimationPointToPlane()
    return np.asarray(registration.registration_icp(a, b, voxel, found.transformation, plane).transformation)


def by_axes(source, reference, size):
    frames = []
    for cloud in (source, reference):
        points = np.asarray(cloud.points)
        axes = np.linalg.eigh(np.cov(points.T))[1]
        axes[:, 0] *= np.linalg.det(axes)
        frames.append((points.mean(0), axes))
    (source_centre, source_axes), (reference_centre, reference_axes) = frames
    best = None
    for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        start = np.eye(4)
        start[:3, :3] = reference_axes @ np.diag(signs) @ source_axes.T
        start[:3, 3] = reference_centre - start[:3, :3] @ source_centre
        pose = icp(source, reference, start, size)
        fitness = registration.evaluate_registration(source, reference, size / 60, pose).fitness
        if best is None or fitness > best[0]:
            best = (fitness, pose)
    return best[1]


def by_bitr(bitr, folder):
    result = folder / "result.json"
    run = subprocess.run([bitr, "assemble", folder / "source.ply", folder / "reference.ply", "--json", result],
                         capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(f"compare_registration.py: {run.stderr.strip()}")
    answer = json.loads(result.read_text())
    return np.array(answer["transform"]), answer["confidence"]


def measure(pair, folder, bitr, run):
    clouds = [open3d.io.read_point_cloud(str(folder / pair["name"] / f"{part}.ply")) for part in ("source", "reference")]
    truth = np.array(pair["truth"])
    joined = open3d.geometry.PointCloud(clouds[0]).transform(truth) + clouds[1]
    size = float(np.linalg.norm(joined.get_max_bound() - joined.get_min_bound()))
    random = np.random.default_rng([run, 7])
    motions = [random_motion(random, size) for _ in range(2)]
    source, reference = (open3d.geometry.PointCloud(c).transform(m) for c, m in zip(clouds, motions))
    truth = motions[1] @ truth @ np.linalg.inv(motions[0])
    centre = np.append(np.asarray(source.points).mean(0), 1)
    with tempfile.TemporaryDirectory() as name:
        written = Path(name)
        open3d.io.write_point_cloud(str(written / "source.ply"), source)
        open3d.io.write_point_cloud(str(written / "reference.ply"), reference)
        methods = {
            "bitr": lambda: by_bitr(bitr, written),
            "open3d": lambda: (by_features(source, reference, size), None),
            "pca × 4 + icp": lambda: (by_axes(source, reference, size), None),
            "identity": lambda: (np.eye(4), None),
        }
        for method, answer in methods.items():
            open3d.utility.random.seed(run)
            began = time.perf_counter()
            pose, confidence = answer()
            milliseconds = 1e3 * (time.perf_counter() - began)
            degrees = rotation_degrees(truth, pose)
            share = float(np.linalg.norm((pose - truth) @ centre)) / size
            yield {"pair": pair["name"], "group": pair["group"], "run": run, "method": method, "degrees": degrees,
                   "share": share, "confidence": confidence, "ms": milliseconds, "right": degrees <= 5 and share <= 0.05}


def line(group, method, rows):
    sure = "–"
    if rows[0]["confidence"] is not None:
        sure = str(sum(not r["right"] and r["confidence"] >= 0.5 for r in rows))
    median = {key: statistics.median(r[key] for r in rows) for key in ("degrees", "share", "ms")}
    return (f"| {group} | {method} | {sum(r['right'] for r in rows)} of {len(rows)} | {median['degrees']:.1f}° "
            f"| {median['share']:.3f} | {sure} | {median['ms']:.0f} | {max(r['ms'] for r in rows):.0f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bitr", type=Path)
    parser.add_argument("pairs", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--only", default="")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    pairs = [p for p in json.loads((options.pairs / "pairs.json").read_text()) if options.only in p["name"]]
    rows = [row for pair in pairs for run in range(options.runs)
            for row in measure(pair, options.pairs, options.bitr, run)]
    print("| pairs | method | right | rotation | translation | wrong and sure | ms | most ms |\n|---|---|---|---|---|---|---|---|")
    for group in [*dict.fromkeys(r["group"] for r in rows), "all"]:
        for method in dict.fromkeys(r["method"] for r in rows):
            print(line(group, method, [r for r in rows if r["method"] == method and group in (r["group"], "all")]))
    if options.json:
        options.json.write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
