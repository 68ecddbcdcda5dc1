#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The page that `scripts/evaluate` writes, from recorded JSON: whether it is complete and self-contained.

The samples come from quick runs on a busy machine: for their form, not for their values.
"""

import functools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "test" / "perf" / "samples"
sys.path[:0] = [str(ROOT / "perf")]
from report.figures import figures_of, text_of  # noqa: E402

FIGURE_FORM = {
    "title": "Of the common form", "command": "perf/evaluation/latency.py", "date": "2026-01-02T03:04:05+00:00",
    "machine": {"system": "Linux", "processor": "a <processor> & more", "cores": 2}, "skipped": [],
    "figures": [
        {"name": "one_way", "what": "one way & back <tagged>", "value": 12.5, "low": 11.25, "high": 13.75, "unit": "ms",
         "paper": 100, "target": "\u2264 100", "reached": True, "ran": "both one way & <nothing> else"},
        {"name": "spacing", "what": "spacing error", "value": 0.75, "low": None, "high": None, "unit": "m", "paper": None,
         "target": 0.5, "reached": False},
        {"name": "count", "what": "vehicles", "value": 1234567, "unit": ""}],
    "series": {"values": [float(i % 97) + 1 for i in range(5000)], "error 1": {"car1": [[0, 1], [1, 0.5]], "car2": [[0, 2], [1, None]]},
               "speeds": {"title": "Speeds", "x": "s", "y": "m/s", "lines": {"it's": [[i, i * i] for i in range(4000)]}},
               "odd": {"neither": "nor"}},
    "pictures": [{"name": "own", "title": "Drawn by itself", "svg": '<svg xmlns="http://www.w3.org/2000/svg"/>'},
                 {"name": "broken", "title": "Not well-formed", "svg": "<svg><g></svg>"}]}
ROWS = {"title": "Rows", "command": "perf/evaluation/rows.py", "machine": "a machine", "date": "2026-01-02",
        "skipped": [{"name": "other", "reason": "it is not installed"}],
        "rows": [{"who": "by hand", "p50_us": {"median": 20.5, "low": 19.0, "high": 22.0}, "ratio": 1.0},
                 {"who": "a broker", "p50_us": None, "ratio": 2.25, "because": ["of", "this"]}]}


def strike():
    def rounds(p50):
        return [{"p50_us": p50 + i, "p99_us": 3 * p50 + i} for i in range(3)]

    def figure(name, value, **more):
        return {"name": name, "what": name, "value": value, "low": value - 1, "high": value + 1, "runs": 3, "unit": "us", **more}

    figures = [figure(f"strike_{setup}{name}_{q}", times * p50 + 1) for setup in ("", "default_")
               for name, p50 in (("idle", 40.0), ("loaded", 60.0)) for q, times in (("p50", 1), ("p99", 3))]
    both = {"idle": rounds(40.0), "loaded": rounds(60.0)}
    ratio = figure("strike_ratio", 1.5, what="p99 of the saturated node, to the idle one", target="at most 2", reached=True)
    return {"title": "Strikes", "figures": [*figures, ratio], "rounds": {"urgent": both, "default": both},
            "setups": {"urgent": "one worker", "default": "two workers"}, "machine": "a machine", "date": "2026-01-02", "command": "c"}


def peers():
    def row(name, p50, ratio):
        return {"name": name, "version": "1.2", "measures": {"exchange": {"p50_us": {"median": p50, "low": p50 - 1, "high": p50 + 1}}},
                "ratios": {"p50": ratio, "to 8": None}, "memory_kib": 5120, "library_bytes": 2048, "program_bytes": 102400}

    return {"title": "Peers", "command": "c", "machine": "a machine", "date": "2026-01-02", "skipped": [],
            "rows": [row("by_hand tcp", 20.0, 1.0), row("cles tcp", 22.5, 1.125), {**row("other", 1.0, 2.0), "measures": {}}]}


def across_links():
    timed = {kind: [[float(i * j % 31) + 5 for i in range(20)] for j in (1, 2, 3)] for kind in ("icd-pull", "pull", "icd-update", "update", "update-multicast")}
    return {**FIGURE_FORM, "skipped": ["what is not allowed here"], "links": {"cable": "by a cable"}, "pictures": [],
            "series": {"loopback": {"pull_p50_us": [1.0, 2.0]}, "cable": timed}}


def evaluate(*arguments, path=None):
    environment = {**os.environ, **({"PATH": path} if path is not None else {})}
    return subprocess.run([sys.executable, "-B", str(ROOT / "scripts" / "evaluate"), *map(str, arguments)],
                          capture_output=True, text=True, check=False, env=environment, timeout=120)


class Folder:
    """A folder with samples, and what else a test adds."""

    def __init__(self, add_cleanup, **more):
        holder = tempfile.TemporaryDirectory(prefix="cles-report-")
        add_cleanup(holder.cleanup)
        self.path = Path(holder.name)
        self.raw, self.out = self.path / "raw", self.path / "out"
        shutil.copytree(SAMPLES, self.raw)
        for name, value in more.items():
            text = value if isinstance(value, str) else json.dumps(value)
            (self.raw / f"{name}.json").write_text(text, encoding="utf-8")

    def page(self):
        return (self.out / "index.html").read_text(encoding="utf-8")


@functools.cache
def usual():
    """The page of the samples with figures of the common form and rows, which several tests read: its text, its root, and
    {name of a picture: its file}."""
    folder = Folder(unittest.addModuleCleanup, latency=FIGURE_FORM, peers=ROWS)
    (folder.path / "pictures").mkdir()
    done = evaluate("--from", folder.raw, "-o", folder.out, "--pictures", folder.path / "pictures")
    if done.returncode != 0:
        raise AssertionError(done.stderr)
    text = folder.page()
    return text, ElementTree.fromstring(text), {path.name: path.read_text(encoding="utf-8")
                                                for path in (folder.path / "pictures").iterdir()}


def words(element):
    return " ".join("".join(element.itertext()).split())


class Page(unittest.TestCase):
    def made(self, *arguments, code=0, path=None, **more):
        folder = Folder(self.addCleanup, **more)
        done = evaluate("--from", folder.raw, "-o", folder.out, *arguments, path=path)
        self.assertEqual(done.returncode, code, done.stderr)
        text = folder.page()
        return text, ElementTree.fromstring(text), done

    def test_it_is_well_formed_and_refers_to_nothing_outside(self):
        text, root, _ = usual()
        identifiers = [each.get("id") for each in root.iter() if each.get("id")]
        self.assertEqual(len(identifiers), len(set(identifiers)))
        for each in root.iter():
            name = each.tag.rpartition("}")[2]
            self.assertNotIn(name, ("script", "link", "iframe", "image", "img", "object", "embed"))
            for key, value in each.attrib.items():
                if key.rpartition("}")[2] in ("href", "src", "data", "srcset"):
                    self.assertRegex(value, "^#", key)
                    self.assertIn(value[1:], identifiers)
                for target in re.findall(r"url\(['\"]?([^)'\"]*)", value):
                    self.assertIn(target[1:], identifiers)
        style = "".join(each.text for each in root.iter() if each.tag.endswith("style") and each.text)
        self.assertNotRegex(style, r"@import|url\(")
        self.assertIn("@media print", style)
        outside = re.sub(r"http://www\.w3\.org/(1999/xhtml|2000/svg|1999/xlink)", "", text)
        self.assertNotRegex(outside, r"https?://")

    def test_every_figure_stands_there_with_its_value(self):
        raws = {"latency": FIGURE_FORM}
        for name in ("bench", "dsgd"):
            raws[name] = json.loads((SAMPLES / f"{name}.json").read_text(encoding="utf-8"))
        _, root, _ = usual()
        rows = {}
        for row in root.iter("{http://www.w3.org/1999/xhtml}tr"):
            rows.setdefault(row[0].text or words(row[0]), []).append(words(row))
        for raw in raws.values():
            figures = figures_of(raw)
            self.assertTrue(figures)
            for figure in figures:
                shown = " ".join(rows.get(" ".join(figure.what.split()), []))
                self.assertIn(" ".join(text_of(figure.value).split()), shown, figure)
                if figure.paper is not None:
                    self.assertIn(" ".join(text_of(figure.paper).split()), shown, figure)
        self.assertIn("11.25 \u2013 13.75", rows["one way & back <tagged>"][-1])
        self.assertIn("reached", rows["one way & back <tagged>"][-1])
        self.assertIn("both one way & <nothing> else", rows["one way & back <tagged>"][-1])
        self.assertIn("missed", rows["spacing error"][-1])
        for raw in raws.values():
            self.assertIn(raw["command"], words(root))
            self.assertIn(raw["date"], words(root))

    def test_a_quick_run_is_not_judged(self):
        sample = json.loads((SAMPLES / "bench.json").read_text(encoding="utf-8"))
        sample["machine"]["busy_cores"] = 1.5
        _, root, _ = self.made(bench=sample)
        kinds = [each.get("class", "") for each in root.iter("{http://www.w3.org/1999/xhtml}td")]
        self.assertFalse([kind for kind in kinds if "missed" in kind or "reached" in kind])
        self.assertIn("that it works, not how fast", words(root))
        self.assertIn("Other work kept 1.5 cores busy when this began", words(root))

    def test_what_is_missing_is_named_with_the_reason(self):
        run = {"sections": {"platoon": {"state": "failed", "reason": "it ended with 7: no <road>", "seconds": 1.0}}}
        text, root, _ = self.made(code=1, run=run, latency="{broken", peers=ROWS)
        self.assertIn("it ended with 7: no <road>", words(root))
        self.assertIn("there is no strike_latency.json among what was measured", words(root))
        self.assertIn("it is not installed", words(root))
        self.assertIn("a broker", words(root))
        self.assertIn("latency.json does not contain a JSON object", words(root))
        self.made("--strict", code=1)

    def test_without_gnuplot_the_pictures_are_missing_and_nothing_else(self):
        _, root, _ = self.made(path="/nonexistent", latency=FIGURE_FORM)
        self.assertIn("scripts/setup --evaluate installs it", words(root))
        self.assertIn("PULL over a Unix socket, p99", words(root))

    def test_a_figure_that_cannot_be_read_is_told(self):
        _, root, _ = self.made(latency={**FIGURE_FORM, "figures": [{"name": "no value"}]})
        self.assertIn("a figure cannot be read", words(root))


@unittest.skipUnless(shutil.which("gnuplot"), "no gnuplot")
class Pictures(unittest.TestCase):
    def test_each_is_drawn(self):
        _, root, files = usual()
        drawn, missing = {}, {}
        for figure in root.iter("{http://www.w3.org/1999/xhtml}figure"):
            name = figure.get("id").removeprefix("picture-")
            svg = figure.find("{http://www.w3.org/2000/svg}svg")
            if svg is None:
                missing[name] = words(figure)
            else:
                drawn[name] = len(list(svg.iter("{http://www.w3.org/2000/svg}path")))
        self.assertEqual(sorted(drawn), sorted(["latency", "parse", "fan_out", "bytes", "dsgd", "dsgd_cost", "dsgd_sizes",
                                                "latency_own", "latency_values", "latency_error_1", "latency_speeds"]))
        self.assertTrue(all(paths > 10 for name, paths in drawn.items() if name != "latency_own"), drawn)
        self.assertEqual(sorted(missing), ["latency_broken", "latency_odd"])
        self.assertEqual(sorted(files), ["latency.svg"])
        for svg in files.values():
            self.assertTrue(ElementTree.fromstring(svg).tag.endswith("svg"))
            self.assertNotRegex(svg, r"[ \t]\n|\n\n")

    def test_those_of_links_strikes_and_peers(self):
        folder = Folder(self.addCleanup, latency=across_links(), strike_latency=strike(), peers=peers())
        self.assertEqual(evaluate("--from", folder.raw, "-o", folder.out).returncode, 0)
        root = ElementTree.fromstring(folder.page())
        shown = {each.get("id"): words(each) for each in root.iter("{http://www.w3.org/1999/xhtml}figure")}
        self.assertIn("UPDATE, one way", shown["picture-link_cable"])
        self.assertIn("saturated node, defaults", shown["picture-strike"])
        self.assertIn("The node has one worker; with the defaults, two workers", shown["picture-strike"])
        self.assertIn("cles tcp", shown["picture-peers"])
        rows = [words(each) for each in root.iter("{http://www.w3.org/1999/xhtml}tr")]
        self.assertTrue([row for row in rows if row.startswith("cles tcp1.125\u20135 120")], rows)
        self.assertNotIn("No picture", " ".join(shown.values()))
        self.assertIn("p99 of the saturated node, to the idle one", words(root))
        self.assertIn("Left out: what is not allowed here", words(root))

    def test_the_data_set_is_drawn_with_its_classifier(self):
        sample = json.loads((SAMPLES / "dsgd.json").read_text(encoding="utf-8"))
        sample["pictured"] = {"of": 4, "box": 1, "classifier": {"weights": [0.1, 0.1], "bias": 0.5},
                              "some": [[-2, -2, 0], [2, 2, 1], [-1, -3, 1]], "near": [[-0.5, -0.5, 0], [0.5, 0.5, 1]]}
        folder = Folder(self.addCleanup, dsgd=sample)
        self.assertEqual(evaluate("--from", folder.raw, "-o", folder.out).returncode, 0)
        root = ElementTree.fromstring(folder.page())
        shown = {each.get("id"): words(each) for each in root.iter("{http://www.w3.org/1999/xhtml}figure")}
        self.assertIn("3 points, 1 of them on the wrong side", shown["picture-data_set"])
        self.assertIn("2 points, 0 of them on the wrong side", shown["picture-data_set_zoomed"])

    def test_they_say_what_they_show(self):
        _, root, _ = usual()
        shown = {each.get("id"): words(each) for each in root.iter("{http://www.w3.org/1999/xhtml}figure")}
        self.assertIn("CLES over a Unix socket", shown["picture-latency"])
        self.assertIn("1 MiB", shown["picture-parse"])
        self.assertIn("3.74 of 4", shown["picture-dsgd"])  # the paper's 8150 ms to its 2180
        self.assertNotIn("150 ms", shown["picture-dsgd"])
        self.assertIn("of it the trial", shown["picture-dsgd_cost"])
        self.assertIn("time of a shard, ms", shown["picture-dsgd_sizes"])
        self.assertIn("the work: time of all threads of the first host, ms", shown["picture-dsgd_sizes"])
        self.assertIn("by hand, multicast", shown["picture-fan_out"])
        self.assertIn("a quick run", shown["picture-bytes"])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
