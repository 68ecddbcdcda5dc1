#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""What the gateway tells about the nodes: metrics, OpenAPI, and spans for a collector."""

import http.server
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
import unittest
import urllib.error
import urllib.request
from pathlib import Path

from gateway_support import Events, FakeNodes, Gateway, own_group
from support import PATIENCE, Node, environment, inherited_descriptors, wait_until

try:
    from openapi_spec_validator import OpenAPIV31SpecValidator
except ImportError:
    OpenAPIV31SpecValidator = None

# Preloaded, it makes lookups of some names hang.
SLOW_NAMES = os.environ.get("SLOW_NAMES", "")
TRACE = "0af7651916cd43dd8448eb211c80319c"
SAMPLE = re.compile(r'([a-z_]+)\{node="([^"]+)"((?:,[a-z]+="[^"]*")*)\} (\S+)')


class Collector:
    """Takes spans by OTLP/HTTP."""

    def __init__(self):
        self.documents = []
        collector = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):  # noqa: N802
                collector.documents.append((self.path, json.loads(self.rfile.read(int(self.headers["Content-Length"])))))
                self.send_response(200)
                self.send_header("Content-Length", "2")
                self.end_headers()
                self.wfile.write(b"{}")

            def log_message(self, *_):
                pass

        self.server = http.server.HTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def spans(self):
        """(name of the node, span)"""
        return [(resource["resource"]["attributes"][0]["value"]["stringValue"], span)
                for _, document in list(self.documents) for resource in document["resourceSpans"]
                for scope in resource["scopeSpans"] for span in scope["spans"]]


class Telemetry(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.collector = Collector()
        env = own_group()
        cls.node = Node("--multicast", env["CLES_MULTICAST"])
        cls.gateway = Gateway("--otlp", cls.collector.url, env=env)
        wait_until(lambda: "car1" in json.loads(cls.gateway.get("/pull/all/cles").body)["results"], "they know each other")

    @classmethod
    def tearDownClass(cls):
        codes = (cls.gateway.stop(), cls.node.stop())
        cls.collector.server.shutdown()
        cls.collector.server.server_close()
        if codes != (0, 0):
            raise AssertionError(f"they ended with {codes}")

    def check_samples(self, text, suffix_of_family):
        """Each sample follows the help and the type of its family, which are there once."""
        family, kinds, values = None, {}, {}
        for line in text.splitlines():
            if line.startswith("# HELP "):
                family = line.split(" ")[2]
                self.assertNotIn(family, kinds)
                self.assertGreater(len(line.split(" ", 3)[3]), 3)
            elif line.startswith("# TYPE "):
                _, _, name, kinds[family] = line.split(" ")
                self.assertEqual(name, family)
            elif line != "# EOF":
                name, node, labels, value = SAMPLE.fullmatch(line).groups()
                ends = {"counter": (suffix_of_family,), "gauge": ("",), "summary": ("", "_count")}[kinds[family]]
                self.assertIn(name, [family + end for end in ends])
                self.assertNotIn((name, node, labels), values)
                values[name, node, labels] = float(value)
        return values

    def test_metrics_for_prometheus(self):
        reply = self.gateway.get("/metrics")
        self.assertEqual((reply.status, reply.headers["Content-Type"]), (200, "text/plain; version=0.0.4; charset=utf-8"))
        values = self.check_samples(reply.body, "")
        self.assertIn(("cles_uptime_seconds", "car1", ""), values)
        self.assertGreater(values["cles_gateway_responses_total", "gateway", ',status="2xx"'], 0)
        self.assertIn(("cles_requests_total", "car1", ',verb="PULL"'), values)
        # Whatever the nodes of this version count has a row of its own, besides the times of tasks, which may have any name.
        others = [key for key in values if key[0] == "cles_value"]
        self.assertEqual([key for key in others if not key[2].startswith(',path="tasks_us.')], [])

    def test_metrics_as_openmetrics(self):
        reply = self.gateway.get("/metrics", Accept="application/openmetrics-text; version=1.0.0")
        self.assertTrue(reply.headers["Content-Type"].startswith("application/openmetrics-text; version=1.0.0"))
        self.assertTrue(reply.body.endswith("\n# EOF\n"))
        self.assertIn(("cles_errors_total", "car1", ""), self.check_samples(reply.body, "_total"))

    @unittest.skipUnless(shutil.which("promtool"), "promtool, of Debian's prometheus, is not installed")
    def test_promtool_finds_no_mistake(self):
        done = subprocess.run(["promtool", "check", "metrics"], input=self.gateway.get("/metrics").body, capture_output=True,
                              text=True, check=False, timeout=PATIENCE)
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))

    @unittest.skipUnless(shutil.which("prometheus"), "Debian's prometheus is not installed")
    def test_prometheus_scrapes_it(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        config = Path(folder.name) / "prometheus.yml"
        config.write_text("global: {scrape_interval: 1s}\nscrape_configs:\n  - job_name: cles\n"
                          f'    static_configs: [{{targets: ["127.0.0.1:{self.gateway.port}"]}}]\n')
        with socket.create_server(("127.0.0.1", 0)) as probe:
            port = probe.getsockname()[1]
        process = subprocess.Popen(["prometheus", f"--config.file={config}", f"--storage.tsdb.path={folder.name}/data",
                                    f"--web.listen-address=127.0.0.1:{port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(lambda: (process.send_signal(signal.SIGTERM), process.wait(PATIENCE)))

        def scraped():
            url = f"http://127.0.0.1:{port}/api/v1/query?query=cles_uptime_seconds"
            try:
                with urllib.request.urlopen(url, timeout=PATIENCE) as reply:
                    return {each["metric"]["node"] for each in json.load(reply)["data"]["result"]}
            except urllib.error.URLError:
                return set()  # it has not started

        wait_until(lambda: scraped() == {"gateway", "car1"}, "both nodes are scraped")

    @unittest.skipUnless(OpenAPIV31SpecValidator, "no openapi-spec-validator with OpenAPI 3.1 is installed")
    def test_a_validator_accepts_the_openapi_document(self):
        document = json.loads(self.gateway.get("/openapi.json").body)
        self.assertEqual([error.message for error in OpenAPIV31SpecValidator(document).iter_errors()], [])

    def test_openapi(self):
        reply = self.gateway.get("/openapi.json")
        self.assertEqual((reply.status, reply.headers["Content-Type"]), (200, "application/json"))
        document = json.loads(reply.body)
        self.assertEqual(document["openapi"], "3.1.0")
        paths, components = document["paths"], document["components"]
        self.assertIn("/pull/car1/localization", paths)
        self.assertIn("post", paths["/push/car1/echo"])
        sleep = paths["/delegate/car1/sleep/{ms}"]["post"]
        self.assertIn("progress in tenths", sleep["summary"])
        told = sleep["responses"]["200"]["content"]["application/json"]["schema"]["$ref"].split("/")[-1]
        self.assertIn("slept_ms", json.dumps(components["schemas"][told]))
        self.assertIn("text/event-stream", paths["/bind/car1/localization"]["get"]["responses"]["200"]["content"])
        # Each reference leads somewhere.
        for reference in re.findall(r'"\$ref": "#/([^"]+)"', json.dumps(document)):
            place = document
            for step in reference.split("/"):
                place = place[step]

    def test_spans_of_a_request(self):
        self.gateway.get("/pull/car1/echo/1", Traceparent=f"00-{TRACE}-b7ad6b7169203331-01")

        def found():
            return [(node, span) for node, span in self.collector.spans() if span["traceId"] == TRACE]

        wait_until(lambda: {node for node, _ in found()} == {"gateway", "car1"}, "both have been told")
        self.assertTrue(all(path == "/v1/traces" for path, _ in self.collector.documents))
        by_id = {span["spanId"]: span for _, span in found()}
        root = next(span for node, span in found() if span.get("parentSpanId") == "b7ad6b7169203331")
        self.assertEqual((root["name"], root["kind"], root["status"]["code"]), ("PULL car1:echo/1", 2, 1))
        for node, span in found():
            self.assertGreaterEqual(int(span["startTimeUnixNano"]), int(root["startTimeUnixNano"]))
            self.assertGreaterEqual(int(span["endTimeUnixNano"]), int(span["startTimeUnixNano"]))
            if span is not root and span["spanId"] != root["spanId"]:
                self.assertIn(span["parentSpanId"], by_id, node)

    def test_a_trace_that_is_not_sampled_is_not_told(self):
        def told():
            return {span["traceId"] for _, span in self.collector.spans()}

        silent, other = "1" * 32, "2" * 32
        self.gateway.get("/pull/car1/echo/2", Traceparent=f"00-{silent}-b7ad6b7169203331-00")
        self.gateway.get("/pull/car1/echo/3", Traceparent=f"00-{other}-b7ad6b7169203331-01")
        wait_until(lambda: other in told(), "the next one is told")
        self.assertNotIn(silent, told())


class Collectors(unittest.TestCase):
    """Collectors that are not there."""

    @unittest.skipUnless(SLOW_NAMES, "a sanitizer has to be the first library of a process")
    def test_it_stops_at_once_while_a_name_is_looked_up(self):
        gateway = self.gateway_with_slow_name()
        begun = time.monotonic()
        self.assertEqual(gateway.stop(), 0)
        self.assertLess(time.monotonic() - begun, PATIENCE / 2)

    @unittest.skipUnless(SLOW_NAMES, "a sanitizer has to be the first library of a process")
    def test_a_lookup_that_never_ends_is_given_up_and_not_begun_again(self):
        gateway = self.gateway_with_slow_name()
        self.addCleanup(gateway.stop)
        wait_until(lambda: "could not be looked up in time" in gateway.errors(), "it is given up")
        self.assertGreater(gateway.counted("spans_dropped"), 0)
        threads = len(os.listdir(f"/proc/{gateway.process.pid}/task"))
        gateway.get("/pull/self/cles")
        dropped = gateway.counted("spans_dropped")
        wait_until(lambda: gateway.counted("spans_dropped") > dropped, "the next ones, too")
        self.assertEqual(gateway.errors().count("is being looked up"), 1)
        self.assertLessEqual(len(os.listdir(f"/proc/{gateway.process.pid}/task")), threads)

    def gateway_with_slow_name(self):
        gateway = Gateway("--otlp", "http://collector.slow.test", env=environment(LD_PRELOAD=SLOW_NAMES))
        gateway.get("/pull/self/cles")
        wait_until(lambda: "collector.slow.test is being looked up" in gateway.errors(), "the lookup has begun")
        return gateway

    def test_a_name_that_nobody_has_costs_only_the_spans(self):
        gateway = Gateway("--otlp", "http://nobody.invalid:1", env=environment())
        self.addCleanup(gateway.stop)
        gateway.get("/pull/self/cles")
        wait_until(lambda: "the collector at http://nobody.invalid:1 does not take spans: " in gateway.errors(), "it is told")
        self.assertGreater(gateway.counted("spans_dropped"), 0)

    def test_one_that_refuses_is_told_of(self):
        for reply, words in ((b"HTTP/1.1 503 Busy\r\n\r\n", "it replies HTTP/1.1 503 Busy"),
                             (b"", "it ends the connection without a reply")):
            with socket.create_server(("127.0.0.1", 0)) as collector:
                collector.settimeout(PATIENCE)
                gateway = Gateway("--otlp", f"http://127.0.0.1:{collector.getsockname()[1]}/here", env=environment())
                self.addCleanup(gateway.stop)
                gateway.get("/pull/self/cles")
                taken, _ = collector.accept()
                with taken, taken.makefile("rb") as lines:
                    self.assertEqual(lines.readline(), b"POST /here HTTP/1.1\r\n")
                    while lines.readline() != b"\r\n":
                        pass
                    taken.sendall(reply)
                    taken.shutdown(socket.SHUT_WR)
                    wait_until(lambda g=gateway, w=words: w in g.errors(), "it is told")
                self.assertGreater(gateway.counted("spans_dropped"), 0)

    def test_no_program_inherits_a_descriptor(self):
        env = own_group()
        node = Node("--multicast", env["CLES_MULTICAST"])
        self.addCleanup(node.stop)
        with socket.create_server(("127.0.0.1", 0)) as collector:
            collector.settimeout(PATIENCE)
            gateway = Gateway("--otlp", f"http://127.0.0.1:{collector.getsockname()[1]}", "--listen", "tcp://127.0.0.1:0",
                              "--listen", "udp://127.0.0.1:0", env=env)
            self.addCleanup(gateway.stop)
            wait_until(lambda: "car1" in json.loads(gateway.get("/pull/all/cles").body)["results"], "they know each other")
            with gateway.raw(), Events(gateway, "/bind/car1/localization") as events:
                self.assertIsNotNone(events.next())
                taken, _ = collector.accept()
                with taken:
                    gateway.get("/pull/car1/echo/1")
                    self.assertEqual(Path(f"/proc/{gateway.process.pid}/comm").read_text(), "cles-gateway\n")
                    self.assertEqual(inherited_descriptors(gateway.process.pid), [])


class LargeFleet(unittest.TestCase):
    def test_what_all_nodes_tell_need_not_fit_into_one_reply(self):
        env = own_group()
        gateway = Gateway(env=env)
        self.addCleanup(gateway.stop)
        told = {"uptime_ms": 7000, "tasks": [{"verb": "PULL", "task": "speed"}], "more": "x" * (900 << 10)}
        names = [f"fake{number}" for number in range(1, 11)]
        for group, more in ((["fat"], "x" * (2 << 20)), (names, "")):
            nodes = FakeNodes(env, group, json.dumps({**told, "most": more}))
            self.addCleanup(nodes.close)
        wait_until(lambda: gateway.get("/pull/fake10/cles").status == 200, "they are known")
        self.assertEqual(gateway.get("/pull/all/cles").status, 413)
        text = gateway.get("/metrics").body
        for name in names:
            self.assertIn(f'cles_uptime_seconds{{node="{name}"}} 7', text)
        self.assertIn('cles_uptime_seconds{node="gateway"}', text)
        self.assertNotIn('cles_uptime_seconds{node="fat"}', text)
        paths = json.loads(gateway.get("/openapi.json").body)["paths"]
        self.assertLessEqual({f"/pull/{name}/speed" for name in names}, set(paths))
        self.assertNotIn("/pull/fat/speed", paths)


if __name__ == "__main__":
    unittest.main()
