#!/usr/bin/env python3
"""The page of bitr eval --html, read by parsers of others and compared with the JSON and the CSV of the same run.

report_test.py BITR
"""
import base64
import csv
import json
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree
import zlib

BITR = sys.argv.pop(1) if len(sys.argv) > 1 else "bitr"
HTML = "{http://www.w3.org/1999/xhtml}"
SVG = "{http://www.w3.org/2000/svg}"


def bitr(*words):
    return subprocess.run([BITR, *map(str, words)], capture_output=True, text=True)


def png_size(data):
    """Width and height of a PNG whose every chunk and row is there."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, pixels = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length : at + 12 + length])[0] == zlib.crc32(kind + body)
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
        if kind == b"IDAT":
            pixels += body
        at += 12 + length
    assert (depth, colour, kind) == (8, 2, b"IEND")
    assert len(zlib.decompress(pixels)) == height * (3 * width + 1)
    return width, height


class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        root = pathlib.Path(cls.folder.name)
        words = ["eval", "--kind", "aircraft", "--protocol", "independent", "--share", "0.9,0.6", "--points", 200,
                 "--samples", 12, "--methods", "identity,pca-icp"]  # fmt: skip
        done = bitr(*words, "--html", root / "a.html", "--json", root / "a.json", "--csv", root / "a.csv")
        assert done.returncode == 0, done.stderr
        assert bitr(*words, "--html", root / "b.html", "--threads", 1, "--batch", 5).returncode == 0
        cls.text = (root / "a.html").read_bytes()
        cls.again = (root / "b.html").read_bytes()
        cls.json = json.loads((root / "a.json").read_text())
        cls.csv = list(csv.DictReader((root / "a.csv").read_text().splitlines()))
        cls.page = ElementTree.fromstring(cls.text)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_same_input_same_bytes(self):
        self.assertEqual(self.text, self.again)

    def test_every_row_has_its_numbers(self):
        rows = [[cell.text for cell in row] for row in self.page.iter(HTML + "tr")]
        rows = [row for row in rows if len(row) > 1][1:]
        self.assertEqual(len(rows), len(self.json["rows"]))
        for cells, row in zip(rows, self.json["rows"]):
            self.assertEqual(cells[0], row["method"])
            self.assertEqual(cells[1], f"{row['dr']['median']:.2f}")
            self.assertEqual(cells[5], f"{row['dt']['median']:.4f}")
            self.assertEqual(cells[8], f"{row['dt_fraction']['median']:.4f}")
            self.assertEqual(cells[9], f"{100 * row['success']['5deg_0.1']:.1f}")
            self.assertEqual(cells[14], f"{100 * row['flips']:.1f}")
        titles = [cell.text for cell in self.page.iter(HTML + "th") if cell.get("scope") == "colgroup"]
        self.assertIn("independent, s = 0.6, 200 points: 12 pairs", titles)
        self.assertTrue(any("overlap 40 … 60 %" in title for title in titles))

    def charts(self):
        return list(self.page.iter(SVG + "svg"))

    def test_histograms_count_every_pair(self):
        over_overlap, *histograms = self.charts()
        self.assertEqual(len(histograms), 2)
        for chart, share in zip(histograms, ("0.9", "0.6")):
            bars = {}
            for bar in chart.iter(SVG + "rect"):
                tip = bar.find(SVG + "title")
                if tip is None:
                    continue
                low, high, degrees, last, count = re.fullmatch(
                    r"(\S+) … ([\d.]+)(°?)( and more)?: (\d+) pairs?", tip.text
                ).groups()
                key = (bar.get("fill"), degrees, float(low), float(high), bool(last))
                self.assertNotIn(key, bars)
                bars[key] = int(count)
            fills = list(dict.fromkeys(key[0] for key in bars))
            for fill, method in zip(fills, ("identity", "pca-icp")):
                lines = [line for line in self.csv if line["share"] == share and line["method"] == method]
                for degrees, column in (("°", "dr"), ("", "dt_fraction")):
                    total = 0
                    for (colour, unit, low, high, last), count in bars.items():
                        if colour != fill or unit != degrees:
                            continue
                        total += count
                        values = [float(line[column]) for line in lines]
                        self.assertEqual(count, sum(low <= v and (last or v < high) for v in values), (low, high))
                    self.assertEqual(total, 12)

    def test_says_nothing_of_confidence_that_nobody_asked_for(self):
        self.assertNotIn(b"onfidence", self.text)

    def test_every_pair_is_a_dot(self):
        dots = [dot for dot in self.charts()[0].iter(SVG + "circle") if dot.get("r") == "2"]
        self.assertEqual(len(dots), len(self.csv))

    def test_pictures_are_of_the_worst_and_the_best(self):
        figures = [f for f in self.page.iter(HTML + "figure") if f.find(HTML + "img") is not None]
        self.assertEqual(len(figures), 2 * 2 * 4)
        for figure in figures:
            kind, data = figure.find(HTML + "img").get("src").split(",")
            self.assertEqual(kind, "data:image/png;base64")
            self.assertEqual(png_size(base64.b64decode(data, validate=True)), (960, 260))
        captions = [figure.find(HTML + "figcaption").text for figure in figures]
        for share in ("0.9", "0.6"):
            for method in ("identity", "pca-icp"):
                lines = [line for line in self.csv if (line["share"], line["method"]) == (share, method)]
                lines.sort(key=lambda line: float(line["dr"]))
                for word, line in (("Best", lines[0]), ("Worst", lines[-1])):
                    start = f"{word} of {method}: {line['shape']}, pair {line['sample']}: "
                    found = [c for c in captions if c.startswith(start)]
                    self.assertTrue(any(f"Δr {float(line['dr']):.2f}°" in c for c in found), start)

    def test_settings_are_told_and_no_date(self):
        terms = {}
        for items in self.page.iter(HTML + "dl"):
            terms.update(zip((t.text for t in items.iter(HTML + "dt")), (t.text for t in items.iter(HTML + "dd"))))
        for key in ("kind", "split", "noise", "samples", "seed", "backend", "device"):
            self.assertIn(key, terms)
        self.assertEqual(terms["samples"], "12")
        self.assertIsNone(re.search(rb"20\d\d-\d\d", re.sub(rb"base64,[^\"]*", b"", self.text)))

    def test_refuses_what_is_no_place_for_a_page(self):
        same = pathlib.Path(self.folder.name) / "same"
        start = ["eval", "--kind", "aircraft", "--samples", 1, "--html"]
        for words in ([*start, "-"], [*start, same, "--json", same], [*start, same, "--csv", same],
                      [*start, self.folder.name], [*start, same / "none"]):  # fmt: skip
            done = bitr(*words)
            self.assertEqual(done.returncode, 2, words)
            self.assertIn("--html", done.stderr)
            self.assertFalse(same.exists())

    def test_names_cannot_leave_their_place(self):
        root = pathlib.Path(self.folder.name) / 'a <b> & "c"'
        root.mkdir()
        points = "".join(f"v {(i * 7 % 11) / 9} {(i * 5 % 13) / 9} {(i * 3 % 17) / 7}\n" for i in range(60))
        faces = "".join(f"f {i} {i + 1} {i + 2}\n" for i in range(1, 58))
        (root / "<i>&.obj").write_text(points + faces)
        page = root / "page.html"
        done = bitr("eval", "--data", root, "--samples", 2, "--points", 60, "--methods", "identity", "--html", page)
        self.assertEqual(done.returncode, 0, done.stderr)
        tree = ElementTree.parse(page)
        self.assertIn(str(root), tree.find(f".//{HTML}title").text)
        self.assertIsNone(tree.find(f".//{HTML}i"))


class JudgedPage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            done = bitr("eval", "--kind", "aircraft", "--share", "1,0.6", "--points", 200, "--samples", 12, "--methods",
                        "identity,pca-icp", "--confidence", "--html", root / "a.html", "--json", root / "a.json",
                        "--csv", root / "a.csv")  # fmt: skip
            assert done.returncode == 0, done.stderr
            cls.page = ElementTree.fromstring((root / "a.html").read_bytes())
            cls.json = json.loads((root / "a.json").read_text())
            cls.csv = list(csv.DictReader((root / "a.csv").read_text().splitlines()))

    def test_table_has_every_area(self):
        (table,) = (div for div in self.page.iter(HTML + "div") if div.get("id") == "confidence")
        rows = [[cell.text for cell in row] for row in table.iter(HTML + "tr")]
        rows = [row for row in rows if len(row) > 1][1:]
        expected = [(row["method"], row["pairs"], row["confidence"]) for row in self.json["rows"]]
        expected += [(method, 24, pooled) for method, pooled in self.json["confidence"].items()]
        self.assertEqual(len(expected), 4 + 2)
        for cells, (method, poses, of) in zip(rows, expected, strict=True):
            area = "–" if of["roc_area"] is None else f"{of['roc_area']:.3f}"
            self.assertEqual(cells, [method, str(poses), area, f"{of['said']:.2f}", f"{of['was']:.2f}"])

    def test_every_bin_is_a_dot_in_its_place(self):
        (chart,) = (svg for svg in self.page.iter(SVG + "svg") if svg.find(f".//{SVG}circle/{SVG}title") is not None)
        (diagonal,) = (line for line in chart.iter(SVG + "line") if line.get("x1") != line.get("x2") and
                       line.get("y1") != line.get("y2"))  # fmt: skip
        x1, y1, x2, y2 = (float(diagonal.get(end)) for end in ("x1", "y1", "x2", "y2"))
        dots = [dot for dot in chart.iter(SVG + "circle") if dot.find(SVG + "title") is not None]
        bins = [(name, bin) for name, of in self.json["confidence"].items() for bin in of["reliability"]]
        self.assertGreater(len(bins), 3)
        self.assertEqual(len(dots), len(bins))
        for dot, (method, bin) in zip(dots, bins):
            poses = f"{bin['poses']} pose" + "s" * (bin["poses"] != 1)
            self.assertEqual(dot.find(SVG + "title").text,
                             f"{method}: said {bin['said']:.2f}, was {bin['was']:.2f} ({poses})")  # fmt: skip
            self.assertAlmostEqual(float(dot.get("cx")), x1 + bin["said"] * (x2 - x1), delta=0.1)
            self.assertAlmostEqual(float(dot.get("cy")), y1 + bin["was"] * (y2 - y1), delta=0.1)

    def test_every_case_has_its_confidence(self):
        captions = [figure.find(HTML + "figcaption").text for figure in self.page.iter(HTML + "figure")
                    if figure.find(HTML + "img") is not None]  # fmt: skip
        self.assertEqual(len(captions), 2 * 2 * 4)
        for caption in captions:
            method, shape, sample, said = re.fullmatch(
                r"(?:Best|Worst) of (\S+): (.+), pair (\d+): .*, confidence (\d\.\d\d)", caption
            ).groups()
            lines = [line for line in self.csv if (line["method"], line["shape"], line["sample"]) ==
                     (method, shape, sample)]  # fmt: skip
            self.assertIn(said, [f"{float(line['confidence']):.2f}" for line in lines], caption)


if __name__ == "__main__":
    unittest.main()
