#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles serve`, `bind` and `hz` by multicast: on loopback, and between two hosts, which are network namespaces."""

import json
import os
import shutil
import signal
import subprocess
import sys
import unittest

from support import CLES, PATIENCE, cles, environment, finish, free_port, read_line, start, wait_until

GROUP = "239.255.25.37"


class Processes(unittest.TestCase):
    def setUp(self):
        self.port = free_port()
        self.running = []

    def tearDown(self):
        for process in self.running:
            if process.poll() is None:
                process.kill()
            process.communicate()

    def begin(self, *command, **options):
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True, env=options.pop("env", environment()), **options)
        self.running.append(process)
        return process

    def where(self, interface="lo"):
        return f"{interface},{GROUP}:{self.port}"


class Loopback(Processes):
    def serve(self, name, *more, **env):
        process = self.begin(CLES, "serve", "--name", name, "--listen", "tcp://127.0.0.1:0", *more,
                             env=environment(**env))
        self.assertIn(name, read_line(process))
        return process

    def test_all_are_heard_and_named(self):
        self.serve("car1", "--multicast", self.where())
        self.serve("car2", CLES_MULTICAST=self.where())
        process = self.begin(CLES, "bind", "all:localization", env=environment(CLES_MULTICAST=self.where()))
        heard = set()
        while heard != {"car1", "car2"}:
            item = json.loads(read_line(process))
            self.assertIn("utc", item["update"])
            self.assertGreater(item["seq"], 0)
            heard.add(item["node"])

    def test_one_node_by_name_and_as_a_table(self):
        self.serve("car1", "--multicast", self.where())
        self.serve("car2", "--multicast", self.where())
        code, out, err = cles("bind", "car2:localization", "--multicast", self.where(), "-n", "2")
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(len(out.splitlines()), 2)
        self.assertIn("utc", json.loads(out.splitlines()[0]))
        code, out, _ = cles("bind", "all:localization", "--multicast", self.where(), "-n", "1", "-o", "table")
        self.assertEqual(code, 0)
        self.assertEqual(out.splitlines()[0].split()[:3], ["NODE", "seq", "utc"])
        self.assertRegex(out.splitlines()[1], r"^car[12] +\d+ ")

    def test_hz(self):
        self.serve("car1", "--multicast", self.where(), "--rate", "50")
        code, out, err = cles("hz", "all:localization", "--multicast", self.where(), "-n", "5")
        self.assertEqual((code, err), (0, ""))
        self.assertIn("5 updates, missed 0", out)

    def test_off(self):
        code, out, err = cles("bind", "all:localization", "--multicast", "off")
        self.assertEqual((code, out), (3, ""))
        self.assertIn("'all:localization' needs multicast, which is off", err)

    def test_a_named_interface_that_is_none_is_an_error(self):
        for command in (("serve", "--listen", "tcp://127.0.0.1:0"), ("bind", "all:x")):
            for given in (("--multicast", "nowhere0"), ()):
                code, out, err = cles(*command, *given, env=environment(CLES_MULTICAST="" if given else "nowhere0"))
                self.assertEqual((code, out), (1, ""))
                self.assertIn(f"cannot join {GROUP}:25370 on 'nowhere0': No such device", err)

    def test_what_makes_no_sense_is_a_mistake_of_usage(self):
        code, _, err = cles("serve", "--multicast", "lo,10.0.0.1")
        self.assertEqual(code, 2)
        self.assertIn("--multicast: '10.0.0.1' is not an IPv4 multicast group", err)
        code, _, err = cles("bind", "all:x", env=environment(CLES_MULTICAST="lo,239.1.2.3:x"))
        self.assertEqual(code, 2)
        self.assertIn("CLES_MULTICAST: 'x' in 'lo,239.1.2.3:x' is not a port", err)
        code, _, err = cles("bind", "car1:x", "--multicast", "lo", "--at", "tcp://127.0.0.1:1")
        self.assertEqual(code, 2)


SNIFFER = """
import json, socket, struct, sys
interface, group, port = sys.argv[1], sys.argv[2], int(sys.argv[3])
s = socket.socket(type=socket.SOCK_DGRAM)
s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
s.bind((group, port))
s.setsockopt(socket.IPPROTO_IP, 12, 1)  # IP_RECVTTL
s.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
             struct.pack("4s4si", socket.inet_aton(group), bytes(4), socket.if_nametoindex(interface)))
print("ready", flush=True)
while True:
    data, extra, _, source = s.recvmsg(2048, 256)
    ttl = [struct.unpack("i", d)[0] for _, kind, d in extra if kind == socket.IP_TTL]
    print(json.dumps({"from": source[0], "ttl": ttl[0], "line": data.decode()}), flush=True)
"""


def why_no_hosts():
    """Why network namespaces cannot be made here; empty if they can."""
    if not shutil.which("ip"):
        return "there is no 'ip' (iproute2)"
    name = f"cles-try-{os.getpid()}"
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True, text=True, check=False)
    if made.returncode == 0:
        subprocess.run(["ip", "netns", "del", name], check=True)
        return ""
    return f"network namespaces are not permitted: {made.stderr.strip()}"


class Hosts(Processes):
    """Two hosts, with a cable between them."""

    def setUp(self):
        super().setUp()
        why = why_no_hosts()
        if why and os.environ.get("CI") == "true":
            self.fail(why)
        if why:
            self.skipTest(why)
        tag = f"{os.getpid() % 100000}{self.port % 1000}"
        self.hosts = [f"cles-{tag}-{i}" for i in (1, 2)]
        self.cards = [f"cl{tag}{i}" for i in (1, 2)]
        self.addCleanup(self.remove_hosts)
        for host in self.hosts:
            self.ip("netns", "add", host)
        self.ip("link", "add", self.cards[0], "netns", self.hosts[0], "type", "veth", "peer", "name", self.cards[1],
                "netns", self.hosts[1])
        for number, (host, card) in enumerate(zip(self.hosts, self.cards), 1):
            self.ip("-n", host, "addr", "add", f"10.77.0.{number}/24", "dev", card)
            self.ip("-n", host, "link", "set", card, "up")
            self.ip("-n", host, "link", "set", "lo", "up")

    def remove_hosts(self):
        for host in self.hosts:
            subprocess.run(["ip", "netns", "del", host], capture_output=True, check=False)

    def ip(self, *arguments):
        subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)

    def on(self, number, *command):
        return self.begin("ip", "netns", "exec", self.hosts[number - 1], *command)

    def here(self, number):
        return self.where(self.cards[number - 1])

    def serve(self, number, name, *more):
        process = self.on(number, CLES, "serve", "--name", name, "--listen", "tcp://127.0.0.1:25370", "--multicast",
                          self.here(number), "--insecure", *more)
        self.assertIn(name, read_line(process))
        return process

    def bind(self, number, noun, *more):
        return self.on(number, CLES, "bind", noun, "--multicast", self.here(number), "-o", "json", *more)

    def sniff(self, number):
        process = self.on(number, sys.executable, "-c", SNIFFER, self.cards[number - 1], GROUP, str(self.port))
        self.assertEqual(read_line(process), "ready\n")
        return process

    def metric(self, number, name):
        done = subprocess.run(["ip", "netns", "exec", self.hosts[number - 1], CLES, "pull", "self:cles/metrics"],
                              capture_output=True, text=True, env=environment(), timeout=PATIENCE, check=True)
        return json.loads(done.stdout)[name]

    def test_both_publishers_are_heard(self):
        self.serve(1, "car1")
        self.serve(2, "car2")
        binder = self.bind(2, "all:localization")
        heard = set()
        while heard != {"car1", "car2"}:
            heard.add(json.loads(read_line(binder))["node"])

    def test_one_datagram_with_a_TTL_of_1_serves_eight_binders(self):
        self.serve(1, "car1", "--rate", "20")
        binders = [self.bind(2, "car1:localization" if i % 2 else "all:localization") for i in range(8)]
        wait_until(lambda: self.metric(1, "group_leases") == 8, "eight leases")
        sniffer = self.sniff(2)
        seen = []
        while len(seen) < 10:
            datagram = json.loads(read_line(sniffer))
            self.assertEqual(datagram["ttl"], 1)
            if datagram["line"].startswith("UPDATE") and ":cles " not in datagram["line"]:  # otherwise an announcement
                self.assertEqual(datagram["from"], "10.77.0.1")
                self.assertTrue(datagram["line"].startswith("UPDATE car1:localization seq="), datagram)
                seen.append(int(datagram["line"].split("seq=")[1].split()[0]))
        self.assertEqual(seen, list(range(seen[0], seen[0] + 10)))
        for binder in binders:
            read_line(binder)

    def test_the_last_value_comes_though_nothing_follows(self):
        self.serve(1, "car1", "--rate", "0")
        asked = subprocess.run(["ip", "netns", "exec", self.hosts[0], CLES, "update", "car1:notice", "-d",
                                '{"text":"bridge closed"}'], capture_output=True, text=True, env=environment(),
                               timeout=PATIENCE, check=False)
        self.assertEqual((asked.returncode, asked.stderr), (0, ""))
        binder = self.bind(2, "car1:notice", "-n", "1")
        self.assertEqual(finish(binder), (0, '{"text":"bridge closed"}\n', ""))

    def test_the_lease_of_a_binder_that_dies_runs_out_and_that_of_one_that_lives_stays(self):
        self.serve(1, "car1")
        dies = self.bind(2, "all:localization")
        lives = self.bind(2, "car1:localization")
        read_line(dies)
        read_line(lives)
        wait_until(lambda: self.metric(1, "group_leases") == 2, "two leases")
        dies.send_signal(signal.SIGKILL)
        wait_until(lambda: self.metric(1, "leases_expired") == 1, "one has run out")
        self.assertEqual(self.metric(1, "group_leases"), 1)
        read_line(lives)
        lives.send_signal(signal.SIGTERM)
        wait_until(lambda: self.metric(1, "group_leases") == 0, "one has said goodbye")
        self.assertEqual(self.metric(1, "leases_expired"), 1)

    def test_another_interface_needs_to_be_called_insecure(self):
        process = self.on(1, CLES, "serve", "--listen", "tcp://127.0.0.1:25370", "--multicast", self.here(1))
        code, out, err = finish(process)
        self.assertEqual((code, out), (2, ""))
        self.assertIn("can be reached from other hosts, which are not authenticated; set 'insecure'", err)


if __name__ == "__main__":
    unittest.main()
