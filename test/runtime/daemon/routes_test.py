#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Routes over several hops: daemons without a link to each other reach each other through those between them.

Line, star, ring and a grid: each daemon in a network namespace of its own, with a cable to each of its neighbours, and
no IP forwarding. Except in the ring, `links` is not configured: nothing but the cables forbids other links. In another
grid and in a long line, all are on loopback, and nothing but `links` forbids other links."""

import collections
import contextlib
import json
import os
import re
import select
import signal
import socket
import subprocess
import threading
import time
import unittest

from daemon import CLESD, PLUGINS, STUBBORN, Daemon, Folder, Link, body, clean_environment
from support import CLES, PATIENCE, read_line, wait_until
from two_hosts import Hosts, cannot_be_made

PORT = 25370
INTERVAL = 1  # in seconds, of so few nodes
# Of a machine on which other programs run, in seconds.
SLACK = 1.0 * PATIENCE / 30
PROGRESS = re.compile(r"id=\d+ progress=([\d.]+) ")


def distances(names, cables):
    """From each node to each other one: the number of links between them."""
    found = {}
    for name in names:
        far = found[name] = {name: 0}
        edge = [name]
        while edge:
            at = edge.pop(0)
            for pair in cables:
                if at in pair:
                    (other,) = set(pair) - {at}
                    if other not in far:
                        far[other] = far[at] + 1
                        edge.append(other)
        del far[name]
    return found


def is_right(peer, wanted):
    """Whether it is live, and is reached by an own link or by a node that is closer to it."""
    return peer["state"] == "live" and ("via" not in peer or
                                        wanted.get(peer["via"], {}).get(peer["node"]) == peer["hops"] - 1)


class Namespaces(Hosts):
    """A host for each node. Two hosts are connected only if there is a cable between them."""

    def __init__(self, names, cables):
        self.keepers, self.addresses, self.pids = [], {}, {}
        try:
            for name in names:
                user = [] if self.IS_ROOT or self.keepers else ["--user", "--map-root-user"]
                inside = self.inside(self.keepers[0].pid) if self.keepers else []
                self.pids[name] = self._keep([*inside, "unshare", *user, "--net"])
            commands = {name: ["link set lo up"] for name in names}
            for number, (one, other) in enumerate(cables, 1):
                self._do(one, [f"link add to-{other} type veth peer name to-{one} netns {self.pids[other]}"])
                for end, (here, there) in enumerate(((one, other), (other, one)), 1):
                    self.addresses[here, there] = f"10.79.{number}.{end}"
                    commands[here] += [f"address add 10.79.{number}.{end}/30 dev to-{there}", f"link set to-{there} up"]
            for name in names:
                self._do(name, commands[name])
        except (subprocess.CalledProcessError, OSError) as failure:
            self.close()
            words = getattr(failure, "stderr", None) or ""
            cannot_be_made(f"no network namespaces here: {failure} {words}")

    def _do(self, name, commands):
        subprocess.run([*self.prefix(name), "ip", "-batch", "-"], input="\n".join(commands) + "\n", text=True,
                       check=True, capture_output=True)

    def prefix(self, name):
        return self.inside(self.pids[name])

    def url(self, name, seen_by):
        return f"tcp://{self.addresses[name, seen_by]}:{PORT}"

    def unplug(self, one, other):
        """Both ends notice; at one of them, nothing can be sent."""
        self._do(one, [f"link set to-{other} down"])

    def plug_in(self, one, other):
        self._do(one, [f"link set to-{other} up"])

    def silence(self, one, other):
        """From now on all packets are lost, and neither end is told."""
        for here, there in ((one, other), (other, one)):
            self._do(here, [f"neigh replace {self.addresses[there, here]} lladdr 02:00:00:00:00:01 nud permanent "
                            f"dev to-{there}"])

    def end_silence(self, one, other):
        for here, there in ((one, other), (other, one)):
            self._do(here, [f"neigh del {self.addresses[there, here]} dev to-{there}"])


class Loopback:
    """All nodes on this host, each at a port of its own."""

    def __init__(self, names, _):
        with contextlib.ExitStack() as opened:
            taken = {name: opened.enter_context(socket.create_server(("127.0.0.1", 0))) for name in names}
            self.ports = {name: taken[name].getsockname()[1] for name in names}

    def prefix(self, _):
        return []

    def url(self, name, _):
        return f"tcp://127.0.0.1:{self.ports[name]}"

    def close(self):
        pass


class LocalLink(Link):
    """The same by a Unix socket, which other network namespaces can open."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(PATIENCE)
        self.socket.connect(path)
        self.lines = self.socket.makefile("r", encoding="utf-8", newline="\n")


class ByLine(LocalLink):
    """A client whose lines are read as they come."""

    def __init__(self, node):
        super().__init__(node.local_socket)
        self.rest = b""

    def read_all(self):
        *lines, self.rest = (self.rest + self.socket.recv(65536)).split(b"\n")
        return [line.decode() for line in lines]


class Updates:
    """When updates of a noun have come to a client."""

    def __init__(self, node, noun):
        self.link = node.connect()
        self.came = []
        self.link.send(f"BIND {noun} id=1")
        self.thread = threading.Thread(target=self.read, daemon=True)
        self.thread.start()
        wait_until(lambda: len(self.came) > 2, f"updates of {noun} come")

    def read(self):
        with contextlib.suppress(OSError):
            while line := self.link.read():
                if line.startswith("UPDATE "):
                    self.came.append(time.monotonic())

    def longest_pause(self):
        """Between two updates, or since the last one."""
        came = [*self.came, time.monotonic()]
        return max(after - before for before, after in zip(came, came[1:]))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.link.socket.shutdown(socket.SHUT_RDWR)
        self.thread.join()
        self.link.close()


class Node(Daemon):
    """A daemon of a network; `wait` returns when it listens."""

    def __init__(self, name, network, neighbours, has_links, fleet=None):
        Folder.__init__(self)
        self.name = name
        self.local = isinstance(network, Loopback)
        self.port = network.ports[name] if self.local else PORT
        self.local_socket = self.file("socket")
        scheme = "tls" if fleet else "tcp"
        listens = f"tcp://127.0.0.1:{self.port}"
        if not self.local:
            listens = f"[{scheme}://0.0.0.0:{PORT}, unix://{self.local_socket}]"
        seeds = ", ".join(network.url(neighbour, name).replace("tcp", scheme) for neighbour in neighbours)
        plugins = [STUBBORN, f"{PLUGINS}/libcles-primes.so", f"{PLUGINS}/libcles-system.so"]
        own = f"node: {name}\ninsecure: true\n"
        if fleet:
            plugins = [os.path.join(fleet.plugins, os.path.basename(plugin)) for plugin in plugins]
            own = f"security: {fleet.keys(name)}\nplugin_path: {fleet.plugins}\n"
        self.config = self.write(
            f"{own}listen: {listens}\nmulticast: off\nworkers: 2\n"
            f"log: {{level: debug, format: json}}\nseeds: [{seeds}]\n"
            + (f"links: [{', '.join(neighbours)}]\n" if has_links else "")
            + f"plugins: [{plugins[0]}, {plugins[1]}, {{path: {plugins[2]}, config: {{interval_ms: 50}}}}]\n")
        with open(self.file("log"), "w", encoding="utf-8") as log:
            self.process = subprocess.Popen([*network.prefix(name), CLESD, "--config", self.config],
                                            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, text=True,
                                            env=clean_environment())

    def wait(self):
        for _ in range(1 if self.local else 2):
            line = read_line(self.process)
            if not line.startswith(f"{self.name} listening on "):
                raise AssertionError(f"it said {line!r}, and logged {self.log()!r}")

    def connect(self):
        return Link(self.port) if self.local else LocalLink(self.local_socket)

    def peers(self):
        return json.loads(self.ask("PULL self:cles/peers"))["peers"]

    def binds(self):
        """How often a noun was bound here."""
        return json.loads(self.ask("PULL self:cles/metrics"))["requests"]["BIND"]


class Probe:
    """A node that this test plays: it returns the line of each request. Only one other node knows where it is."""

    EPOCH = "0a0b0c0d"

    def __init__(self, neighbour):
        self.path = neighbour.file("probe")
        self.seq = 0
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(self.path)
        self.listener.listen()
        threading.Thread(target=self.accept, daemon=True).start()
        self.link = neighbour.connect()
        self.link.ask(f"PUSH self:cles/peers {json.dumps({'peers': [self.entry()]})}")

    def entry(self):
        self.seq += 1
        return {"node": "probe", "endpoints": [f"unix://{self.path}"], "epoch": self.EPOCH, "seq": self.seq,
                "age_ms": 0, "interval_ms": 1000, "state": "live", "load": {"queued": 0, "running": 0, "workers": 1}}

    def accept(self):
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=self.serve, args=self.listener.accept()[:1], daemon=True).start()

    def serve(self, client):
        with contextlib.suppress(OSError), client:
            for line in client.makefile("r", encoding="utf-8", newline="\n"):
                if "reply=no" in line:
                    continue
                noun = line.split()[1].partition(":")[2]
                if noun == "cles/peers":
                    said = {"node": "probe", "epoch": self.EPOCH, "peers": [self.entry()], "beats": {},
                            "next": f"{self.EPOCH}.{self.seq}"}
                elif noun == "cles":
                    said = {"node": "probe", "version": "1", "protocol": 1, "epoch": self.EPOCH, "uptime_ms": 1,
                            "endpoints": [], "tasks": []}
                else:
                    said = {"line": line.rstrip("\n")}
                known = re.search(r" (id=\d+)", line)
                client.sendall(((known[1] + " " if known else "") + json.dumps(said, separators=(",", ":")) +
                                "\n").encode())

    def close(self):
        self.link.close()
        self.listener.close()


class Network:
    """The daemons of a network. `near` and `far` are as far from each other as any two."""

    NAMES, CABLES, NEAR, FAR = [], [], "", ""
    NETWORK = Namespaces
    HAS_LINKS = False

    @classmethod
    def make_fleet(cls, _):
        """Of a secured network."""
        return None

    @classmethod
    def setUpClass(cls):
        with contextlib.ExitStack() as opened:
            cls.fleet = cls.make_fleet(opened)
            cls.network = cls.NETWORK(cls.NAMES, cls.CABLES)
            opened.callback(cls.network.close)
            cls.neighbours = {name: [(set(c) - {name}).pop() for c in cls.CABLES if name in c] for name in cls.NAMES}
            cls.begun = time.monotonic()
            cls.nodes = {}
            for name in cls.NAMES:
                cls.nodes[name] = opened.enter_context(
                    Node(name, cls.network, cls.neighbours[name], cls.HAS_LINKS, cls.fleet))
            for node in cls.nodes.values():
                node.wait()
            cls.wait_for_routes(cls.CABLES, "after the start")
            cls.near, cls.far = cls.nodes[cls.NEAR], cls.nodes[cls.FAR]
            cls.length = distances(cls.NAMES, cls.CABLES)[cls.NEAR][cls.FAR]
            opened.callback(cls.stop)
            cls.addClassCleanup(opened.pop_all().close)

    @classmethod
    def stop(cls):
        for node in cls.nodes.values():
            node.send_signal(signal.SIGTERM)
        ended = {name: node.end()[0] for name, node in cls.nodes.items()}
        if set(ended.values()) != {0}:
            raise AssertionError(f"they ended with {ended}")

    @classmethod
    def say(cls, words):
        print(f"{cls.__name__.lower()}: {words}", flush=True)

    @classmethod
    def wait_for_routes(cls, cables, when, begun=None):
        """Until each node lists all others at their distances, each by a node on a shortest way; returns how long that
        took."""
        begun = begun or cls.begun
        wanted = distances(cls.NAMES, cables)
        right_after = {}
        with contextlib.ExitStack() as opened:
            links = {name: opened.enter_context(node.connect()) for name, node in cls.nodes.items()}
            while len(right_after) < len(links):
                listed = {}
                for name, link in links.items():
                    listed[name] = json.loads(link.ask("PULL self:cles/peers"))["peers"]
                    if {p["node"]: p.get("hops", 1) for p in listed[name] if is_right(p, wanted)} == wanted[name]:
                        right_after.setdefault(name, time.monotonic() - begun)
                    else:
                        right_after.pop(name, None)
                if time.monotonic() - begun > PATIENCE:
                    raise AssertionError(f"{when}: not the distances {wanted}, but\n" +
                                         "\n".join(f"{name}: {json.dumps(listed[name])}" for name in links))
                time.sleep(0.02)
        took = max(right_after.values())
        cls.say(f"{when}, all nodes have all distances after {took:.2f} s (the first one after "
                f"{min(right_after.values()):.2f} s)")
        return took

    def listed(self):
        return "\n".join(f"{name}: {json.dumps(node.peers())}" for name, node in self.nodes.items())


class Topology(Network):
    """What has to be true of every network."""

    def marks(self):
        try:
            return [line.split()[0] for line in self.far.read("marks").splitlines()]
        except FileNotFoundError:
            return []

    def test_the_far_end_answers(self):
        begun = time.monotonic()
        self.assertEqual(json.loads(self.near.ask(f"PULL {self.FAR}:cles"))["node"], self.FAR)
        self.say(f"{self.FAR} answers {self.NEAR} after {(time.monotonic() - begun) * 1000:.1f} ms")
        for one in self.NAMES:
            with self.nodes[one].connect() as link:
                for other in self.NAMES:
                    answer = link.ask(f"PULL {other}:cles")
                    self.assertEqual(json.loads(answer).get("node"), other, f"{one} asked {other}: {answer}")

    def test_hops_count_each_link(self):
        with self.near.connect() as link:
            for hops in range(self.length + 2):
                answer = body(link.ask(f"PULL {self.FAR}:quick id={hops + 1} hops={hops}"))
                if hops < self.length:
                    self.assertEqual(answer.get("error"), "no_target", answer)
                else:
                    self.assertEqual(answer, {"value": 42})

    def test_a_job_reports_progress_and_its_result(self):
        with self.near.connect() as link:
            link.send(f'DELEGATE {self.FAR}:primes id=1 progress=yes deadline=60000 {{"below":10000000}}')
            reported = []
            while found := PROGRESS.match(line := link.read()):
                reported.append(float(found[1]))
        self.assertEqual(line, 'id=1 {"count":664579,"largest":9999991}')
        self.assertEqual(reported, sorted(reported))
        self.assertGreater(len(reported), 10)
        self.say(f"{len(reported)} reports of progress have arrived")

    def test_a_cancellation_arrives(self):
        file = self.far.file("marks").replace("/", "%2F")
        before = self.marks().count("begun")
        with self.near.connect() as link:
            link.send(f"DELEGATE {self.FAR}:listens/{file}/told id=1 deadline=60000")
            link.send(f"DELEGATE {self.FAR}:waits/nothing id=2 deadline=60000")
            wait_until(lambda: self.marks().count("begun") == before + 1, "the job has begun")
            begun = time.monotonic()
            for number in (1, 2):
                link.send(f"PUSH self:cles/cancel/{number} reply=no")
            self.assertEqual([body(link.read())["error"] for _ in range(2)], ["cancelled"] * 2)
            wait_until(lambda: "told" in self.marks(), "it is told")
            self.say(f"a cancellation takes {(time.monotonic() - begun) * 1000:.1f} ms")
            # Also that of a requester who is gone.
            link.send(f"DELEGATE {self.FAR}:listens/{file}/gone id=3 deadline=60000")
            wait_until(lambda: self.marks().count("begun") == before + 2, "the job has begun")
        wait_until(lambda: "gone" in self.marks(), "it is told")

    def check_updates(self, name):
        """Two clients of the near daemon share a binding of a noun there."""
        before = {each: node.binds() for each, node in self.nodes.items()}
        with self.near.connect() as one, self.near.connect() as other:
            seen = []
            for link in (one, other):
                self.assertNotIn("error", body(link.ask(f"BIND {name}:utc id=1")))
                seen.append([])
            for link, seqs in zip((one, other), seen):
                while len(seqs) < 5:
                    line = link.read()
                    self.assertRegex(line, rf"^UPDATE {name}:utc seq=\d+ epoch=[0-9a-f]{{8}} {{")
                    seqs.append(int(re.search(r" seq=(\d+)", line)[1]))
            for seqs in seen:
                self.assertEqual(seqs, list(range(seqs[0], seqs[0] + 5)))
            bound = {each: node.binds() - before[each] for each, node in self.nodes.items()}
            self.assertEqual((bound[self.NEAR], bound[name]), (2, 1), bound)
            # Every node on the way has bound it once.
            away = distances(self.NAMES, self.CABLES)[self.NEAR][name]
            self.assertEqual(sorted(bound.values(), reverse=True)[:away + 2],
                             ([2] + [1] * away + [0])[:min(away + 2, len(bound))], bound)
            self.say(f"bound {away} links away: {bound}")
        on_the_way = [name for name, count in bound.items() if count == 1]
        wait_until(lambda: all(self.nodes[name].binds() == before[name] + 2 for name in on_the_way),
                   "the bindings have ended")

    def test_two_clients_share_a_binding(self):
        for away in range(2, self.length + 1):
            self.check_updates(next(name for name, far in distances(self.NAMES, self.CABLES)[self.NEAR].items()
                                    if far == away))


class Line(Topology, unittest.TestCase):
    NAMES = ["n1", "n2", "n3", "n4"]
    CABLES = [("n1", "n2"), ("n2", "n3"), ("n3", "n4")]
    NEAR, FAR = "n1", "n4"

    def test_what_arrives_at_the_far_end(self):
        probe = Probe(self.far)
        self.addCleanup(probe.close)
        begun = time.monotonic()
        wait_until(lambda: {"node": "probe", "hops": 4, "via": "n2"} in
                   [{key: p.get(key) for key in ("node", "hops", "via")} for p in self.near.peers()],
                   "n1 knows a fifth node")
        self.say(f"a fifth node is known at the other end after {time.monotonic() - begun:.2f} s")
        with self.near.connect() as link:
            # The second one waits for the first, because they have no id.
            link.send(f"PULL {self.FAR}:lingers")
            link.send("PULL probe:seen/there deadline=3000 hops=6 color=red")
            link.read()
            answer = link.read()
            self.assertIn('"line"', answer)
            words = body(answer)["line"].split()
        self.assertEqual(words[:2], ["PULL", "probe:seen/there"])
        adverbs = dict(word.split("=", 1) for word in words[2:])
        self.say(f"of deadline=3000, {adverbs['deadline']} are left 4 links away")
        self.assertLessEqual(int(adverbs["deadline"]), 2950)
        self.assertGreater(int(adverbs["deadline"]), 0)
        self.assertEqual((adverbs["hops"], adverbs["via"], adverbs["color"]), ("2", "n1,n2,n3,n4", "red"))


class Star(Topology, unittest.TestCase):
    NAMES = ["hub", "n1", "n2", "n3", "n4"]
    CABLES = [("hub", "n1"), ("hub", "n2"), ("hub", "n3"), ("hub", "n4")]
    NEAR, FAR = "n1", "n4"


class Grid(Topology, unittest.TestCase):
    NAMES = [f"n{row}{column}" for row in range(3) for column in range(3)]
    CABLES = ([(f"n{row}{column}", f"n{row}{column + 1}") for row in range(3) for column in range(2)] +
              [(f"n{row}{column}", f"n{row + 1}{column}") for row in range(2) for column in range(3)])
    NEAR, FAR = "n00", "n22"
    NETWORK = Loopback
    HAS_LINKS = True


class Cuts(Network):
    """What has to be true when a cable is lost that is not the only way."""

    def ask_until_answered(self, links, begun, then):
        """Asks from both ends of a cable for the other one, again and again, until both are answered; calls `then`, and
        waits for all replies. Returns for each end when the first answer came and when its request had been sent, and
        how many of all requests have ended in which way."""
        sent, first = [], {}
        ended = collections.Counter()
        while (busy := len(first) < len(links)) or ended.total() < len(sent) * len(links):
            if time.monotonic() - begun > PATIENCE:
                raise AssertionError(f"of {len(sent) * len(links)} requests, only these ended: {ended}; at last\n"
                                     f"{self.listed()}")
            if busy:
                sent.append(time.monotonic() - begun)
                for (_, other), link in links.items():
                    link.send(f"PULL {other}:cles id={len(sent)} deadline=1000")
            elif then:
                then = then()
            until = time.monotonic() + 0.02
            while (left := until - time.monotonic()) > 0:
                ready = select.select([link.socket for link in links.values()], [], [], left)[0]
                for ends, link in links.items():
                    for line in link.read_all() if link.socket in ready else []:
                        answer, number = body(line), int(re.match(r"id=(\d+)", line)[1])
                        ended[answer.get("error", "answered")] += 1
                        if answer.get("node") == ends[1]:
                            first.setdefault(ends, (time.monotonic() - begun, sent[number - 1]))
        return first, ended

    def check_cut(self, ends, cut, mend, how):
        one, other = ends
        beyond = min(set(self.neighbours[other]) - {one})
        with ByLine(self.nodes[one]) as here, ByLine(self.nodes[other]) as there, \
                Updates(self.nodes[one], f"{beyond}:utc") as updates:
            links = {(one, other): here, (other, one): there}
            for (_, target), link in links.items():
                self.assertEqual(json.loads(link.ask(f"PULL {target}:cles"))["node"], target)
            try:
                cut(one, other)
                begun = time.monotonic()
                left = [cable for cable in self.CABLES if set(cable) != set(ends)]
                took = []
                first, ended = self.ask_until_answered(
                    links, begun, lambda: took.append(self.wait_for_routes(left, how, begun)))
                for (asks, target), (at, sent) in first.items():
                    self.say(f"{how}: {target} answers {asks} again after {at:.2f} s (asked after {sent:.2f} s)")
                self.say(f"{how}: the requests that were sent meanwhile: {dict(ended)}")
                self.assertLess(max(at for at, _ in first.values()), INTERVAL + SLACK)
                pause = updates.longest_pause()
                self.say(f"{how}: updates of {beyond}, which came to {one} by {other}, paused for {pause:.2f} s")
                self.assertLess(pause, INTERVAL + SLACK)
                self.assertLess(took[0], INTERVAL + SLACK)
                for asks, target in links:
                    self.assertEqual(json.loads(self.nodes[asks].ask(f"PULL {target}:cles"))["node"], target)
            finally:
                mend(one, other)
        self.wait_for_routes(self.CABLES, "mended", time.monotonic())


class RingTests(Topology, Cuts):
    NAMES = ["n1", "n2", "n3", "n4", "n5"]
    CABLES = [("n1", "n2"), ("n2", "n3"), ("n3", "n4"), ("n4", "n5"), ("n5", "n1")]
    NEAR, FAR = "n1", "n3"
    HAS_LINKS = True

    def test_a_binding_avoids_the_nodes_that_have_forwarded_it(self):
        before = {name: node.binds() for name, node in self.nodes.items()}
        with self.near.connect() as link:
            self.assertNotIn("error", body(link.ask("BIND n3:utc id=1 via=n2")))
            self.assertTrue(link.read().startswith("UPDATE n3:utc "))
            self.assertEqual({name: node.binds() - before[name] for name, node in self.nodes.items()},
                             {"n1": 1, "n2": 0, "n3": 1, "n4": 1, "n5": 1})
        wait_until(lambda: all(self.nodes[name].binds() == before[name] + 2 for name in ("n3", "n4", "n5")),
                   "the bindings have ended")

    def test_a_binding_at_the_other_end_of_a_lost_link_moves_too(self):
        one, other = "n4", "n5"
        with Updates(self.nodes[one], f"{other}:utc") as updates:
            self.network.silence(one, other)
            try:
                begun = time.monotonic()
                time.sleep(0.1)  # what is on its way arrives
                count = len(updates.came)
                while len(updates.came) == count and time.monotonic() - begun < 3 * (INTERVAL + SLACK):
                    time.sleep(0.01)
                took = time.monotonic() - begun
                answer = self.nodes[one].ask(f"PULL {other}:quick")
                self.assertGreater(len(updates.came), count, f"no update of {other}:utc came to {one} within "
                                   f"{took:.2f} s; PULL {other}:quick was answered with {answer}\n{self.listed()}")
                self.say(f"updates of {other} come to {one} again after {took:.2f} s")
            finally:
                self.network.end_silence(one, other)
        self.wait_for_routes(self.CABLES, "mended", time.monotonic())

    def test_a_cable_is_unplugged(self):
        self.check_cut(("n1", "n2"), self.network.unplug, self.network.plug_in, "unplugged")

    def test_a_cable_loses_everything(self):
        self.check_cut(("n3", "n4"), self.network.silence, self.network.end_silence, "silent")


class Ring(RingTests, unittest.TestCase):
    pass


class LongLine(Network, unittest.TestCase):
    """Longer than requests go unless they state `hops`."""

    NAMES = [f"n{number:02}" for number in range(1, 13)]
    CABLES = list(zip(NAMES, NAMES[1:]))
    NEAR, FAR = "n01", "n12"
    NETWORK = Loopback
    HAS_LINKS = True

    def test_a_request_goes_as_far_as_its_hops_and_says_how_to_go_further(self):
        def ask(request):
            with self.near.connect() as link:
                return body(link.ask(f"{request} id=1"))

        for verb, noun in (("PULL", "quick"), ("BIND", "utc")):
            self.assertNotIn("error", ask(f"{verb} n09:{noun}"))
            self.assertEqual(ask(f"{verb} {self.FAR}:{noun}"), {
                "error": "no_target", "message": "n09: the request for 'n12' has been forwarded 8 times, and hops=8 "
                                                 "permits no more: state hops=11 (at most 16)"})
            self.assertEqual(ask(f"{verb} {self.FAR}:{noun} hops=10").get("error"), "no_target")
            self.assertNotIn("error", ask(f"{verb} {self.FAR}:{noun} hops=11"))

    @unittest.skipUnless(CLES, "the command is not built")
    def test_the_command_states_hops(self):
        ask = [CLES, "pull", f"{self.FAR}:quick", "--at", f"tcp://127.0.0.1:{self.near.port}", "-o", "raw"]
        done = subprocess.run(ask, capture_output=True, text=True, timeout=PATIENCE, check=False)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("state hops=11", done.stderr)
        done = subprocess.run([*ask, "--hops", "11"], capture_output=True, text=True, timeout=PATIENCE, check=True)
        self.assertEqual(json.loads(done.stdout), {"value": 42})


class CableGrid(Cuts, unittest.TestCase):
    NAMES, CABLES, NEAR, FAR = Grid.NAMES, Grid.CABLES, Grid.NEAR, Grid.FAR

    def test_a_cable_at_a_corner_loses_everything(self):
        self.check_cut(("n01", "n02"), self.network.silence, self.network.end_silence, "silent at a corner")

    def test_a_cable_in_the_middle_loses_everything(self):
        self.check_cut(("n11", "n12"), self.network.silence, self.network.end_silence, "silent in the middle")


if __name__ == "__main__":
    unittest.main()
