#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The life cycle of clesd: readiness, signals, draining, reload."""

import json
import os
import resource
import signal
import socket
import time
import unittest

from daemon import DEFAULTS, STUBBORN, Daemon, body, clean_environment, clesd, wait_until_running
from support import PATIENCE, free_port, wait_until

SANITIZED = os.environ.get("SANITIZED", "") != ""
STUBBORN_TASKS = f"plugins: [{STUBBORN}]\n"


def known_to(daemon):
    """The other nodes that it knows."""
    return [peer["node"] for peer in json.loads(daemon.ask("PULL self:cles/peers"))["peers"]]


class Manager:
    """The socket of a service manager like systemd."""

    def __init__(self, name=None):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENCE)
        self.socket.bind(name or f"\0clesd-test-{os.getpid()}-{id(self)}")
        address = self.socket.getsockname()
        self.name = address if isinstance(address, str) else "@" + address[1:].decode()

    def hear(self):
        return self.socket.recv(4096).decode()

    def hears_nothing(self):
        self.socket.settimeout(0.05)
        try:
            self.socket.recv(4096)
            return False
        except TimeoutError:
            return True
        finally:
            self.socket.settimeout(PATIENCE)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()


class Start(unittest.TestCase):
    def test_it_stops_on_sigterm_and_sigint(self):
        for number in (signal.SIGTERM, signal.SIGINT):
            with Daemon() as d:
                self.assertEqual(json.loads(d.ask("PULL self:cles"))["node"], "sat1")
                code, took = d.stop(number)
                self.assertEqual(code, 0)
                self.assertLess(took, 4)  # there is nothing to wait for

    def test_programs_that_it_starts_inherit_no_descriptor(self):
        name = f"clesd-inherited-{os.getpid()}"
        base = DEFAULTS.replace("tcp://127.0.0.1:0", f"[tcp://127.0.0.1:0, udp://127.0.0.1:0, 'unix://@{name}']")
        group = f"multicast: {{interface: lo, port: {free_port()}}}"
        with Daemon(base=base.replace("multicast: off", group)) as d:
            with d.connect() as link, socket.socket(socket.AF_UNIX) as local:
                local.connect(f"\0{name}")
                local.sendall(b"PULL self:cles\n")
                self.assertIn(b"sat1", local.recv(65536))
                self.assertEqual(json.loads(link.ask("PULL self:cles"))["node"], "sat1")
                with Daemon(f"seeds: ['{d.url}']\n", base=DEFAULTS.replace("sat1", "sat2")) as other:
                    wait_until(lambda: "sat1" in known_to(other), "it has a link")
                    self.assertEqual(other.inherited(), [])
                self.assertEqual(d.inherited(), [])

    def test_the_json_log_has_an_object_per_line(self):
        with Daemon() as d:
            d.stop()
            entries = d.entries()
            self.assertTrue(entries)
            for entry in entries:
                self.assertEqual(entry["node"], "sat1")
                self.assertIn(entry["level"], ("debug", "info", "warning", "error"))
                self.assertRegex(entry["time"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d$")

    def test_the_log_is_text_by_default(self):
        with Daemon(base=DEFAULTS.replace(", format: json", "")) as d:
            d.stop()
            self.assertRegex(d.log(), r"(?m)^\S+ info    sat1: stopping on SIGTERM; ")

    def test_an_entry_about_a_peer_names_it(self):
        with Daemon() as d:
            with d.connect() as link:
                where = link.socket.getsockname()
                link.send("GET / HTTP/1.1")
                self.assertEqual(link.read(), "")
            entry = d.wait_for_entry("a web client")
            self.assertEqual(entry["peer"], f"tcp://127.0.0.1:{where[1]}")

    def test_a_port_in_use_is_reported(self):
        with Daemon() as d:
            code, _, err = clesd("--node", "b", "--listen", d.url, "--multicast", "off")
            self.assertEqual(code, 1)
            self.assertIn(d.url, err)
            self.assertIn("Address already in use", err)


class Threads(unittest.TestCase):
    @unittest.skipIf(SANITIZED, "a sanitizer needs too much memory for a limit")
    def test_one_that_the_system_refuses_is_an_error_of_the_request(self):
        with Daemon("peers: {far: 'tcp://far.invalid:1'}\n") as d, d.connect() as link:
            self.assertEqual(json.loads(link.ask("PULL self:cles"))["node"], "sat1")
            with open(f"/proc/{d.process.pid}/status", encoding="ascii") as file:
                used = next(int(line.split()[1]) for line in file if line.startswith("VmSize:"))
            usual = resource.prlimit(d.process.pid, resource.RLIMIT_AS)
            little = (used + 400) * 1024  # less than a thread's stack
            resource.prlimit(d.process.pid, resource.RLIMIT_AS, (little, usual[1]))
            for _ in range(2):
                refused = body(link.ask("PULL far:x id=1 deadline=4000"))
                self.assertIn("the system refuses a thread", refused["message"])
            resource.prlimit(d.process.pid, resource.RLIMIT_AS, usual)
            self.assertEqual(json.loads(link.ask("PULL self:cles"))["node"], "sat1")
            self.assertEqual(d.stop()[0], 0)


class Readiness(unittest.TestCase):
    def test_one_datagram_when_it_listens(self):
        with Manager() as m, Daemon(env=clean_environment(NOTIFY_SOCKET=m.name)) as d:
            self.assertEqual(m.hear(), "READY=1")
            self.assertTrue(m.hears_nothing())
            self.assertEqual(json.loads(d.ask("PULL self:cles"))["node"], "sat1")
            d.send_signal(signal.SIGTERM)
            self.assertEqual(m.hear(), "STOPPING=1")
            self.assertEqual(d.end()[0], 0)
            self.assertTrue(m.hears_nothing())

    def test_a_socket_with_a_path(self):
        with Daemon() as scratch, Manager(scratch.file("notify")) as m:
            with Daemon(env=clean_environment(NOTIFY_SOCKET=m.name)):
                self.assertEqual(m.hear(), "READY=1")

    def test_a_daemon_that_cannot_start_is_never_ready(self):
        with Manager() as m:
            code, _, _ = clesd("--listen", "tcp://127.0.0.1:0", "--multicast", "no_such_interface",
                               env=clean_environment(NOTIFY_SOCKET=m.name))
            self.assertNotEqual(code, 0)
            self.assertTrue(m.hears_nothing())

    def test_a_missing_service_manager_does_not_prevent_the_start(self):
        with Daemon(env=clean_environment(NOTIFY_SOCKET="@nobody-is-there")) as d:
            d.wait_for_entry("service manager could not be notified")
            self.assertEqual(d.stop()[0], 0)


class Watchdog(unittest.TestCase):
    def test_a_heartbeat_at_half_the_limit(self):
        started = time.monotonic()
        with Manager() as m, Daemon(env=clean_environment(NOTIFY_SOCKET=m.name, WATCHDOG_USEC="400000")) as d:
            self.assertEqual(m.hear(), "READY=1")
            begun = time.monotonic()
            for _ in range(5):
                self.assertEqual(m.hear(), "WATCHDOG=1")
            self.assertGreaterEqual(time.monotonic() - started, 1.0)
            self.assertLess(time.monotonic() - begun, 1.0 + PATIENCE / 10)
            d.send_signal(signal.SIGTERM)
            self.assertEqual(m.hear(), "STOPPING=1")
            self.assertEqual(d.end()[0], 0)

    def test_a_daemon_that_drains_is_alive(self):
        with Manager() as m, Daemon(STUBBORN_TASKS + "drain: 60s\n",
                                    env=clean_environment(NOTIFY_SOCKET=m.name, WATCHDOG_USEC="100000")) as d, \
                d.connect() as link:
            link.send(f"DELEGATE sat1:waits/{d.file('go').replace('/', '%2F')} id=1 deadline=60000")
            wait_until_running(d, 1)
            d.send_signal(signal.SIGTERM)
            while m.hear() != "STOPPING=1":
                pass
            for _ in range(3):
                self.assertEqual(m.hear(), "WATCHDOG=1")
            d.write("", "go")
            self.assertEqual(d.end()[0], 0)

    def test_a_suspended_daemon_sends_no_heartbeat(self):
        with Manager() as m, Daemon(env=clean_environment(NOTIFY_SOCKET=m.name, WATCHDOG_USEC="100000")) as d:
            self.assertEqual(m.hear(), "READY=1")
            self.assertEqual(m.hear(), "WATCHDOG=1")
            d.send_signal(signal.SIGSTOP)
            time.sleep(0.2)
            while not m.hears_nothing():
                pass
            time.sleep(0.2)
            self.assertTrue(m.hears_nothing())
            d.send_signal(signal.SIGCONT)
            self.assertEqual(m.hear(), "WATCHDOG=1")

    def test_the_limit_of_another_process_does_not_count(self):
        with Manager() as m, Daemon(env=clean_environment(NOTIFY_SOCKET=m.name, WATCHDOG_USEC="20000",
                                                          WATCHDOG_PID="1")):
            self.assertEqual(m.hear(), "READY=1")
            time.sleep(0.1)
            self.assertTrue(m.hears_nothing())


class Drain(unittest.TestCase):
    def test_a_running_job_may_end_and_is_answered(self):
        with Daemon(STUBBORN_TASKS + "drain: 60s\n") as d, d.connect() as link:
            link.send(f"DELEGATE sat1:waits/{d.file('go').replace('/', '%2F')} id=1 deadline=60000")
            wait_until_running(d, 1)
            d.send_signal(signal.SIGTERM)
            d.wait_for_entry("stopping on SIGTERM; 1 job running")
            # New requests are refused, and may be sent to another node.
            with d.connect() as late:
                self.assertEqual(body(late.ask("DELEGATE sat1:empty id=2"))["error"], "busy")
            d.write("", "go")
            self.assertEqual(link.read(), 'id=1 {"value":"found"}')
            self.assertEqual(d.end()[0], 0)

    def test_a_job_that_does_not_end_is_abandoned_at_the_limit(self):
        with Daemon(STUBBORN_TASKS + "drain: 1s\n") as d, d.connect() as link:
            link.send("DELEGATE sat1:never_ends id=1 deadline=60000")
            wait_until_running(d, 1)
            begun = time.monotonic()
            d.send_signal(signal.SIGTERM)
            self.assertEqual(body(link.read())["error"], "unavailable")
            code, _ = d.end()
            took = time.monotonic() - begun
            self.assertEqual(code, 0)
            self.assertGreaterEqual(took, 0.9)
            self.assertLess(took, 4)  # the limit, and what a busy machine adds
            d.wait_for_entry("1 job did not end in time")

    def test_a_second_signal_stops_it_at_once(self):
        with Daemon(STUBBORN_TASKS + "drain: 10min\n") as d, d.connect() as link:
            link.send("DELEGATE sat1:never_ends id=1 deadline=60000")
            wait_until_running(d, 1)
            d.send_signal(signal.SIGTERM)
            d.wait_for_entry("stopping on SIGTERM")
            self.assertIsNone(d.process.poll())
            self.assertEqual(d.stop()[0], 0)


class Leave(unittest.TestCase):
    """A daemon tells other nodes that it leaves when it begins to stop, so that they send it nothing more."""

    def leave_while_a_job_runs(self, base, seeded):
        tasks = STUBBORN_TASKS + "drain: 60s\n"
        with Daemon(tasks, base=base) as leaves, \
                Daemon(tasks + (f"seeds: [{leaves.url}]\n" if seeded else ""),
                       base=base.replace("sat1", "sat2")) as stays, stays.connect() as link:
            wait_until(lambda: "sat1" in known_to(stays), "sat2 knows sat1")
            link.send(f"DELEGATE sat1:waits/{leaves.file('go').replace('/', '%2F')} id=1 deadline=60000")
            wait_until_running(leaves, 1)
            leaves.send_signal(signal.SIGTERM)
            wait_until(lambda: "sat1" not in known_to(stays), "sat2 knows that sat1 has left")
            self.assertIsNone(leaves.process.poll())
            with stays.connect() as other:
                for _ in range(20):
                    self.assertEqual(other.ask("DELEGATE any:empty"), "{}")
            self.assertEqual(json.loads(leaves.ask("PULL self:cles/metrics"))["pool"]["refused"], 0)
            leaves.write("", "go")
            self.assertEqual(link.read(), 'id=1 {"value":"found"}')  # jobs that have started complete
            self.assertEqual(leaves.end()[0], 0)

    def test_by_gossip(self):
        self.leave_while_a_job_runs(DEFAULTS, seeded=True)

    def test_by_multicast(self):
        with socket.socket(type=socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        group = f"multicast: {{interface: lo, port: {port}}}"
        self.leave_while_a_job_runs(DEFAULTS.replace("multicast: off", group), seeded=False)


class Reload(unittest.TestCase):
    def test_sighup_reloads_seeds_and_log(self):
        with Daemon(base=DEFAULTS.replace("level: debug", "level: warning")) as d:
            self.assertEqual(d.entries(), [])
            d.write(DEFAULTS + "seeds: [tcp://127.0.0.1:1, tcp://127.0.0.1:2]\n")
            d.send_signal(signal.SIGHUP)
            self.assertIn("2 seeds, log debug", d.wait_for_entry("reloaded the configuration")["message"])
            d.stop()
            d.wait_for_entry("stopping on SIGTERM")  # which a log of warnings does not contain

    def test_a_new_seed_is_asked(self):
        with Daemon(base=DEFAULTS.replace("sat1", "sat2")) as seed, Daemon() as d:
            self.assertEqual(known_to(d), [])
            d.write(DEFAULTS + f"seeds: [{seed.url}]\n")
            d.send_signal(signal.SIGHUP)
            wait_until(lambda: known_to(d) == ["sat2"], "the seed is known")
            wait_until(lambda: known_to(seed) == ["sat1"], "the seed was told")
            self.assertEqual(json.loads(d.ask("PULL sat2:cles"))["node"], "sat2")

    def test_an_error_keeps_the_old_configuration(self):
        with Daemon() as d:
            d.write(DEFAULTS + "seeds: there\n")
            d.send_signal(signal.SIGHUP)
            entry = d.wait_for_entry("kept the old configuration")
            self.assertIn(f"{d.config}:6: seeds: ", entry["message"])
            self.assertEqual(entry["level"], "error")
            self.assertEqual(json.loads(d.ask("PULL self:cles"))["node"], "sat1")
            self.assertEqual(d.stop()[0], 0)

    def test_changes_that_need_a_restart_are_reported(self):
        with Daemon() as d:
            d.write(DEFAULTS + "queue: 7\n")
            d.send_signal(signal.SIGHUP)
            d.wait_for_entry("take effect at the next start")

    def test_the_service_manager_is_notified(self):
        with Manager() as m, Daemon(env=clean_environment(NOTIFY_SOCKET=m.name)) as d:
            self.assertEqual(m.hear(), "READY=1")
            d.send_signal(signal.SIGHUP)
            self.assertRegex(m.hear(), r"^RELOADING=1\nMONOTONIC_USEC=\d+$")
            self.assertEqual(m.hear(), "READY=1")


if __name__ == "__main__":
    unittest.main()
