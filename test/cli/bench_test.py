#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles bench`: what it measures and how it reports it, on runs that are too short for meaningful figures."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest
from xml.etree import ElementTree

from support import CLES, NodeTest, cles, environment, on_terminal, start, wait_until

SHORT = ("--requests", "200", "--rounds", "2")


def measure(*arguments):
    code, out, err = cles("bench", *SHORT, *arguments, "-o", "json")
    if code != 0:
        raise AssertionError(f"exit code {code}: {err}")
    return json.loads(out)


class Pulls(unittest.TestCase):
    def test_both_exchanges_are_measured_in_one_run(self):
        report = measure()
        self.assertEqual((report["bench"], report["transport"], report["rounds"]), ("pull", "tcp", 2))
        self.assertEqual(report["requests"], 400)
        for figures in (report["icd"], report["cles"]):
            self.assertTrue(0 < figures["p50_us"] <= figures["p99_us"] <= figures["p999_us"] <= figures["max_us"])
            self.assertGreater(figures["requests_per_s"], 0)
            self.assertGreaterEqual(figures["cpu_us"], 0)
        self.assertAlmostEqual(report["ratio"]["p50"], report["cles"]["p50_us"] / report["icd"]["p50_us"], places=2)

    def test_bytes_are_those_on_the_wire(self):
        report = measure()
        self.assertEqual((report["icd"]["request_bytes"], report["icd"]["reply_bytes"]), (4, 44))
        self.assertTrue(25 < report["cles"]["request_bytes"] < 50, report["cles"])
        self.assertTrue(80 < report["cles"]["reply_bytes"] <= 132, report["cles"])

    def test_other_carriers_and_ways_to_ask(self):
        report = measure("--transport", "unix")
        self.assertEqual(report["transport"], "unix")
        self.assertGreater(report["icd_unix"]["p50_us"], 0)
        report = measure("--transport", "udp")
        self.assertEqual(report["transport"], "udp")
        self.assertGreater(report["icd_udp"]["p50_us"], 0)
        self.assertEqual(measure("--transport", "inproc")["transport"], "inproc")
        many = measure("--in-flight", "8", "--style", "callback")
        self.assertEqual((many["in_flight"], many["style"]), (8, "callback"))

    def test_busy_polling_and_one_core(self):
        report = measure("--busy-poll", "50", "--one-core")
        self.assertEqual(report["busy_poll_us"], 50)
        self.assertEqual(report["client_core"], report["server_core"])

    def test_cores_that_are_kept_awake(self):
        code, out, err = cles("bench", *SHORT, "--wake-within", "0")
        try:
            os.close(os.open("/dev/cpu_dma_latency", os.O_WRONLY))
            allowed = True
        except OSError:
            allowed = False
        if allowed:
            self.assertEqual((code, err), (0, ""))
            self.assertIn(", coroutines, cores kept awake;", out)
            self.assertEqual(measure("--wake-within", "7", "--transport", "inproc")["wake_within_us"], 7)
        else:
            self.assertEqual((code, out), (1, ""))
            self.assertIn("/dev/cpu_dma_latency", err)

    def test_the_table_names_the_terms(self):
        code, out, err = cles("bench", *SHORT, "--busy-poll", "20")
        self.assertEqual((code, err), (0, ""))
        lines = out.splitlines()
        self.assertEqual([line.split()[0] for line in lines], ["PULL", "hand-written", "CLES", "ratio", "medians"])
        self.assertIn("medians of 2 rounds, 1 in flight, coroutines, CLES polling up to 20 us;", lines[-1])


class Updates(unittest.TestCase):
    def test_all_are_delivered(self):
        report = measure("--updates", "--binders", "3")
        self.assertEqual((report["bench"], report["binders"]), ("updates", 3))
        for figures in (report["raw"], report["typed"]):
            self.assertEqual(figures["missed"], 0)
            self.assertGreater(figures["deliveries_per_s"], 0)

    def test_all_are_delivered_in_batches(self):
        report = measure("--updates", "--binders", "2", "--style", "batch")
        self.assertEqual((report["style"], report["raw"]["missed"], report["typed"]["missed"]), ("batch", 0, 0))


class FanOut(unittest.TestCase):
    def expect(self, report, transport, binders):
        self.assertEqual((report["bench"], report["transport"], report["rounds"], report["rate_hz"]),
                         ("fan_out", transport, 2, 1000))
        self.assertEqual([row["binders"] for row in report["rows"]], binders)
        for row in report["rows"]:
            self.assertEqual((row["paced_updates"], row["flat_out_updates"]), (50, 50))
            for figures in (row["icd"], row["cles"]):
                latency = figures["paced"]["latency"]
                self.assertTrue(0 < latency["p50_us"] <= latency["p99_us"] <= latency["p999_us"] <= latency["max_us"])
                self.assertGreater(figures["flat_out"]["deliveries_per_s"], 0)
            self.assertAlmostEqual(row["ratio"]["p50"], row["cles"]["paced"]["latency"]["p50_us"]
                                   / row["icd"]["paced"]["latency"]["p50_us"], places=2)

    def measure(self, *arguments):
        code, out, err = cles("bench", "--fan-out", "--requests", "50", "--rounds", "2", *arguments)
        self.assertEqual((code, err), (0, ""))
        return out

    def test_streams_lose_nothing(self):
        for transport in ("tcp", "unix"):
            report = json.loads(self.measure("--transport", transport, "--binders", "1,3", "-o", "json"))
            self.expect(report, transport, [1, 3])
            for row in report["rows"]:
                for figures in (row["icd"], row["cles"]):
                    self.assertEqual((figures["flat_out"]["lost"], figures["paced"]["lost"]), (0, 0))

    def test_multicast(self):
        report = json.loads(self.measure("--transport", "multicast", "--binders", "1,3", "-o", "json"))
        self.expect(report, "multicast", [1, 3])

    def test_the_table_names_both_exchanges_for_each_number_of_binders(self):
        lines = self.measure("--binders", "1,2", "--style", "callback").splitlines()
        self.assertEqual([line.split()[:2] for line in lines[1:-1]],
                         [[name, str(n)] for n in (1, 2) for name in ("hand-written", "CLES", "ratio")])
        self.assertIn("at 1000 updates/s and as fast as possible; medians of 2 rounds over tcp", lines[-1])


class Bytes(unittest.TestCase):
    def test_each_verb_is_counted_beside_the_struct(self):
        code, out, err = cles("bench", "--bytes", "--requests", "50", "-o", "json")
        self.assertEqual((code, err), (0, ""))
        report = json.loads(out)
        self.assertEqual((report["bench"], report["exchanges"]), ("bytes", 50))
        rows = {row["message"]: row for row in report["rows"]}
        self.assertEqual(list(rows), [f"{verb} {way}" for verb in ("PULL", "PUSH", "DELEGATE", "UPDATE", "BIND")
                                      for way in ("request", "reply")] + ["update"])
        self.assertEqual((rows["PULL request"]["icd_tcp"]["bytes"], rows["PULL reply"]["icd_tcp"]["bytes"]), (4, 44))
        # "PULL car1:localization id=N" with its LF, the id being of one or two digits.
        self.assertTrue(28 <= rows["PULL request"]["tcp"]["bytes"] <= 30, rows["PULL request"])
        for row in rows.values():
            for name, headers in (("icd_tcp", 66), ("tcp", 66), ("unrounded_tcp", 66), ("icd_udp", 42), ("udp", 42),
                                  ("unrounded_udp", 42)):
                self.assertAlmostEqual(row[name]["frame"], row[name]["bytes"] + headers, places=2)
        # Four of the five values have six digits or more in addition, the fifth some.
        for transport in ("tcp", "udp"):
            for message in ("PULL reply", "PUSH request", "UPDATE request", "update"):
                self.assertGreater(rows[message][f"unrounded_{transport}"]["bytes"], rows[message][transport]["bytes"] + 24)
        # It has no packet. (The ids of datagrams start at a random number, which may be shorter.)
        self.assertEqual(rows["PULL request"]["unrounded_tcp"], rows["PULL request"]["tcp"])
        fit, fit_unrounded = (int(1448 / rows["update"][way]["bytes"]) for way in ("tcp", "unrounded_tcp"))
        self.assertEqual(report["in_a_frame"],
                         {"icd_tcp": 32, "icd_udp": 33, "tcp": fit, "unrounded_tcp": fit_unrounded, "udp": 1})

    def test_the_table_says_what_was_added(self):
        code, out, err = cles("bench", "--bytes", "--requests", "10")
        self.assertEqual((code, err), (0, ""))
        self.assertIn("Ethernet 14, IPv4 20 and TCP 32 (with timestamps) or UDP 8", out)
        self.assertIn("updates in one frame of 1500 bytes: TCP, struct 32, CLES ", out)


class Parse(unittest.TestCase):
    def test_all_lengths_are_measured(self):
        code, out, err = cles("bench", "--parse", "--requests", "3", "--rounds", "2", "-o", "json")
        self.assertEqual((code, err), (0, ""))
        report = json.loads(out)
        self.assertEqual((report["bench"], report["rounds"]), ("parse", 2))
        self.assertEqual([row["bytes"] for row in report["rows"]], [64 * 4**i for i in range(8)])
        for row in report["rows"]:
            self.assertEqual(row["repetitions"], 3)
            for name in ("head", "validated", "typed", "reply_validated", "reply_typed"):
                self.assertGreater(row[name]["ns"], 0, (name, row))
                self.assertAlmostEqual(row[name]["ns_per_byte"], row[name]["ns"] / row["bytes"], places=2)
            self.assertLess(row["packed_bytes"], row["bytes"])

    def test_the_plot_is_made_of_the_json(self):
        code, out, err = cles("bench", "--parse", "--requests", "2", "--rounds", "1", "-o", "json")
        self.assertEqual((code, err), (0, ""))
        script = os.path.join(os.path.dirname(__file__), "..", "..", "perf", "messages", "plot_parse.py")
        plot = subprocess.run([sys.executable, script], input=out, capture_output=True, text=True, check=True).stdout
        lines = [each for each in ElementTree.fromstring(plot).iter() if each.tag.endswith("polyline")]
        self.assertEqual([len(each.get("points").split()) for each in lines], [8] * 6)

    def test_the_table_gives_time_and_time_per_byte(self):
        code, out, err = cles("bench", "--parse", "--requests", "2", "--rounds", "1")
        self.assertEqual((code, err), (0, ""))
        lines = out.splitlines()
        self.assertEqual([line.split()[0] for line in lines[1:9]], [str(64 * 4**i) for i in range(8)])
        self.assertIn("ns (ns per byte), medians of 1 rounds", lines[9])


class Stress(unittest.TestCase):
    def test_loaded_cores_are_measured_beside_idle_ones(self):
        report = measure("--stress")
        self.assertEqual((report["bench"], report["requests"]), ("stress", 200))
        self.assertGreaterEqual(report["processes"], 2)
        for name in ("idle", "idle_fifo", "loaded", "loaded_fifo"):
            figures = report.get(name)
            if figures is None:  # the system does not grant a real-time priority
                self.assertTrue(name.endswith("_fifo"), report)
                continue
            self.assertTrue(0 < figures["p50_us"] <= figures["p99_us"] <= figures["p999_us"] <= figures["max_us"])
        self.assertEqual("idle_fifo" in report, "loaded_fifo" in report)


class Urgent(unittest.TestCase):
    def test_small_requests_are_measured_beside_large_ones(self):
        for transport in ("tcp", "unix"):
            report = measure("--urgent", "--transport", transport)
            self.assertEqual((report["bench"], report["transport"]), ("urgent", transport))
            self.assertEqual(report["large_bytes"], 100_000)
            for name in ("idle", "in_turn", "urgent"):
                figures = report[name]
                self.assertTrue(0 < figures["p50_us"] <= figures["p99_us"] <= figures["p999_us"] <= figures["max_us"])


class Against(NodeTest):
    def test_a_node_that_runs_already(self):
        report = measure("--against", self.node.url)
        self.assertEqual(report["against"], self.node.url)
        self.assertNotIn("icd", report)
        self.assertGreater(report["cles"]["p50_us"], 0)


class Usage(unittest.TestCase):
    def test_what_does_not_go_together_is_refused(self):
        for arguments, says in (
            (("--transport", "pigeon"), "--transport"),
            (("--in-flight", "0"), "--in-flight"),
            (("--busy-poll", "-1"), "--busy-poll"),
            (("--requests", "5", "--duration", "1s"), "--duration"),
            (("--style", "batch"), "--style batch needs --updates or --fan-out"),
            (("--urgent", "--style", "batch"), "--style batch needs --updates or --fan-out"),
            (("--binders", "2"), "--binders needs --updates or --fan-out"),
            (("--updates", "--binders", "1,2"), "only one value of --binders"),
            (("--fan-out", "--updates"), "--updates cannot be combined with --fan-out"),
            (("--fan-out", "--duration", "1s"), "--duration cannot be combined with --fan-out"),
            (("--fan-out", "--transport", "udp"), "--transport tcp"),
            (("--transport", "multicast"), "--transport multicast needs --fan-out"),
            (("--fan-out", "--transport", "multicast", "--keep", "9"), "--keep has no effect with multicast"),
            (("--parse", "--transport", "tcp"), "--transport cannot be combined with --parse"),
            (("--parse", "--bytes"), "--parse cannot be combined with --bytes"),
            (("--bytes", "--transport", "tcp"), "--transport cannot be combined with --bytes"),
            (("--bytes", "--rounds", "2"), "--rounds cannot be combined with --bytes"),
            (("--updates", "--in-flight", "2"), "--in-flight cannot be combined with --updates"),
            (("--updates", "--transport", "inproc"), "--transport"),
            (("--stress", "--updates"), "--updates cannot be combined with --stress"),
            (("--stress", "--transport", "inproc"), "--transport"),
            (("--urgent", "--stress"), "--urgent cannot be combined with --stress"),
            (("--urgent", "--transport", "udp"), "--transport tcp or unix"),
            (("--against", "tcp://127.0.0.1:1", "--transport", "tcp"), "--transport"),
        ):
            code, out, err = cles("bench", *arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertIn(says, err)

    def test_nobody_there(self):
        code, out, err = cles("bench", "--against", "unix:///nowhere/at/all.sock")
        self.assertEqual((code, out), (1, ""))
        self.assertIn("unix:///nowhere/at/all.sock", err)


def command_of(process):
    with open(f"/proc/{process.pid}/cmdline", encoding="utf-8") as cmdline:
        return cmdline.read().replace("\0", " ")


class Program(unittest.TestCase):
    """`cles bench` starts `cles-bench`."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="cles-bench-")
        self.addCleanup(folder.cleanup)
        self.alone = os.path.join(folder.name, "alone", "cles")  # a copy without `cles-bench`
        self.path = os.path.join(folder.name, "path")
        os.mkdir(os.path.dirname(self.alone))
        os.mkdir(self.path)
        shutil.copy(shutil.which(CLES) or CLES, self.alone)

    def write_program(self, folder, text):
        program = os.path.join(folder, "cles-bench")
        with open(program, "w", encoding="utf-8") as file:
            file.write("#!/bin/sh\n" + text)
        os.chmod(program, 0o755)

    def run_alone(self, *arguments):
        done = subprocess.run([self.alone, *arguments], capture_output=True, text=True, timeout=30, check=False,
                              env=environment(PATH=self.path))
        return done.returncode, done.stdout, done.stderr

    def test_one_line_says_how_to_get_it(self):
        code, out, err = self.run_alone("bench", "--bytes")
        self.assertEqual((code, out), (1, ""))
        self.assertRegex(err, r"^cles: cannot find cles-bench[^\n]*CLES_BUILD_PERF[^\n]*\n$")

    def test_help_and_completion_do_not_need_it(self):
        self.assertEqual(self.run_alone("bench", "--help"), cles("bench", "--help"))
        self.assertEqual(self.run_alone("__complete", "bench", "--transp")[1].split("\t")[0], "--transport")
        self.assertEqual(self.run_alone("__complete", "bench", "--transport", "un"), (0, "unix\t\n", ""))

    def test_it_gets_the_options_and_its_exit_code_counts(self):
        self.write_program(self.path, 'echo "in PATH:" "$@"; exit 7\n')
        self.assertEqual(self.run_alone("-v", "bench", "--rounds", "3", "-o", "json"),
                         (7, "in PATH: --rounds 3 -o json\n", ""))
        self.write_program(os.path.dirname(self.alone), 'echo "beside:" "$@"\n')
        self.assertEqual(self.run_alone("bench", "--requests=1 000", "--bytes")[0], 2)  # refused before it starts
        self.assertEqual(self.run_alone("bench", "--against", "a b"), (0, "beside: --against a b\n", ""))

    def test_one_that_cannot_be_started_is_reported(self):
        self.write_program(self.path, "exit 0\n")
        os.chmod(os.path.join(self.path, "cles-bench"), 0o644)
        self.assertEqual(self.run_alone("bench"), (1, "", "cles: cannot start cles-bench: Permission denied\n"))

    def test_a_signal_ends_it(self):
        with start("bench", "--bytes", "--requests", "100000000") as process:
            wait_until(lambda: command_of(process).startswith("cles-bench "), "cles-bench runs")
            process.send_signal(signal.SIGTERM)
            self.assertEqual(process.wait(30), -signal.SIGTERM)

    def test_started_directly_it_is_the_same(self):
        program = os.path.join(os.path.dirname(os.path.realpath(shutil.which(CLES) or CLES)), "cles-bench")
        for arguments in (("--help",), ("--rounds", "0"), ("--binders", "2"), ("-v", "--binders", "2")):
            done = subprocess.run([program, *arguments], capture_output=True, text=True, timeout=30, check=False,
                                  env=environment())
            self.assertEqual((done.returncode, done.stdout, done.stderr), cles("bench", *arguments))


class Terminal(unittest.TestCase):
    def test_progress_is_one_line_that_goes(self):
        code, shown = on_terminal("bench", *SHORT, env=environment(NO_COLOR="1"))
        self.assertEqual(code, 0)
        self.assertIn("[..............................] 1/4 hand-written exchange", shown)
        self.assertIn("\r\x1b[K[######################........] 4/4 CLES", shown)
        self.assertIn("\r\x1b[KPULL localization", shown)


if __name__ == "__main__":
    unittest.main()
