#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Demonstrates a pool of four daemons: they find each other and share jobs, and one of them is killed meanwhile. Then a
chain of four, in which each has a link to its neighbours only: requests pass through, and waiting jobs move.

    demo_cluster.py [FOLDER]

FOLDER contains `clesd` and `cles`; default build/release/apps. No processes or files are left behind.
"""

import collections
import json
import os
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

from demo_support import PATIENCE, Trouble, end, heading

INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
NAMES = ["sat1", "sat2", "sat3", "sat4"]
FIRST, ASKED = "sat1", "sat2"  # the seed of the others; the daemon that gets all requests
SPREAD, UNDER_FIRE = 60, 80  # jobs
CHAIN = ["car1", "car2", "car3", "car4"]
JOB_SECONDS = 0.1  # intended duration of a job

CONFIG = """\
node: {name}
listen: [tcp://127.0.0.1:0]         # a free port
multicast: off                      # with multicast, no seeds are needed
seeds: [{seeds}]{padding}# nodes that are asked for the others
workers: 2
plugins: [libcles-primes.so]
"""
CHAIN_CONFIG = """\
node: {name}
listen: [tcp://127.0.0.1:0]
multicast: off
seeds: [{seeds}]
links: [{links}]{padding}# the only nodes that this one may have links to
workers: 1
plugins: [libcles-primes.so]
"""

# The outcome of a job, by error code; any other code is `failed`, no error is `done`.
FATES = {"busy": "refused", "no_target": "refused", "no_task": "refused", "unavailable": "unknown",
         "deadline": "unknown"}


class Interrupted(BaseException):
    pass


def show(text):
    for line in text.splitlines():
        print(f"  {line.rstrip()}", flush=True)


def patient(question, what):
    """Repeats the question until its answer is not empty, and returns it."""
    until = time.monotonic() + PATIENCE
    while not (answer := question()):
        if time.monotonic() > until:
            raise Trouble(f"timed out: {what}")
        time.sleep(0.01)
    return answer


class Link:
    """A client with one socket, which sends and receives lines."""

    def __init__(self, url):
        host, _, port = url.removeprefix("tcp://").rpartition(":")
        self.socket = socket.create_connection((host, int(port)), PATIENCE)
        self.lines = self.socket.makefile("r", encoding="utf-8", newline="\n")

    def send(self, *lines):
        self.socket.sendall("".join(line + "\n" for line in lines).encode())

    def receive(self):
        try:
            line = self.lines.readline().rstrip("\n")
        except TimeoutError:
            raise Trouble(f"no reply within {PATIENCE} s") from None
        if not line:
            raise Trouble("a node has closed the link")
        return line

    def ask(self, line):
        self.send(line)
        return json.loads(self.receive())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.lines.close()
        self.socket.close()


class Cluster:
    """The daemons, and the folder with their files."""

    def __init__(self, programs):
        self.programs = programs
        self.folder = tempfile.mkdtemp(prefix="cles-demo-")
        self.started = []  # every process
        self.daemons = {}
        self.urls = {}
        # Without the user's settings for CLES, and without the other nodes of this host.
        self.environment = {k: v for k, v in os.environ.items() if not k.startswith("CLES_") and k != "NOTIFY_SOCKET"}
        self.environment["CLES_MULTICAST"] = "off"

    def start(self, name):
        config = self.config_of(name)
        with open(self.file(name + ".yaml"), "w", encoding="utf-8") as file:
            file.write(config)
        with open(self.file(name + ".log"), "w", encoding="utf-8") as log:
            self.daemons[name] = self.begin("clesd", "--config", self.file(name + ".yaml"), stderr=log)
        said = self.first_line_of(self.daemons[name].stdout)
        found = re.search(r"listening on (tcp://\S+)", said)
        if not found:
            with open(self.file(name + ".log"), encoding="utf-8") as log:
                raise Trouble(f"{name} did not start: {said}{log.read()}")
        self.urls[name] = found[1]
        show(said)

    def begin(self, program, *arguments, **streams):
        """Starts a program. Signals are blocked until the process is recorded, so that it is always ended."""
        before = signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
        try:
            self.started.append(subprocess.Popen(
                [os.path.join(self.programs, program), *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                env=self.environment, preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_SETMASK, before), **streams))
            return self.started[-1]
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def config_of(self, name):
        seeds = self.urls.get(FIRST, "")
        return CONFIG.format(name=name, seeds=seeds, padding=" " * max(1, 27 - len(seeds)))

    @staticmethod
    def first_line_of(stream):
        line = b""
        until = time.monotonic() + PATIENCE
        while not line.endswith(b"\n"):
            if not select.select([stream], [], [], max(0, until - time.monotonic()))[0]:
                break
            data = os.read(stream.fileno(), 4096)
            if not data:
                break
            line += data
        return line.decode(errors="replace")

    def file(self, name):
        return os.path.join(self.folder, name)

    def kill(self, name):
        self.daemons[name].kill()
        self.daemons[name].wait()

    def command(self, *arguments):
        running = self.begin("cles", *arguments, "--at", self.urls[ASKED], stderr=subprocess.PIPE)
        out, err = running.communicate(timeout=PATIENCE)
        if running.returncode != 0:
            raise Trouble(f"cles {' '.join(arguments)} ended with {running.returncode}: {err.decode()}")
        return out.decode()

    def known_to(self, name):
        with Link(self.urls[name]) as link:
            peers = link.ask("PULL self:cles/peers")["peers"]
        return {peer["node"] for peer in peers if peer["state"] == "live"}

    def end(self):
        for process in self.started:
            process.terminate()
        for process in self.started:
            end(process, 3)
            process.stdout.close()
        self.started.clear()

    def close(self):
        self.end()
        shutil.rmtree(self.folder, ignore_errors=True)


class Chain(Cluster):
    """Each daemon knows the one before, and may only talk to that and the next."""

    def config_of(self, name):
        at = CHAIN.index(name)
        before, after = CHAIN[max(0, at - 1):at], CHAIN[at + 1:at + 2]
        links = ", ".join(before + after)
        return CHAIN_CONFIG.format(name=name, seeds="".join(self.urls[each] for each in before), links=links,
                                   padding=" " * max(1, 27 - len(links)))

    def is_complete(self):
        """Whether requests of the first reach the last."""
        with Link(self.urls[CHAIN[0]]) as link:
            peers = {peer["node"]: peer for peer in link.ask("PULL self:cles/peers")["peers"]}
            return set(peers) == set(CHAIN[1:]) and all(peers[name].get("hops", 1) == at + 1
                                                        for at, name in enumerate(CHAIN[1:]))


def jobs_done(link):
    """The number of jobs that each daemon has answered since its start, for those that reply."""
    tables = link.ask("PULL all:cles/metrics")["results"]
    return {name: tables[name]["pool"]["answered"] for name in sorted(tables)}


def shares_of(before, after):
    """The number of jobs that each daemon has answered in between, for those that still run."""
    return {name: after[name] - before[name] for name in after}


def show_share(name, share, remark=""):
    show(f"{name} {share:4} {'#' * share}{remark}")


def run_jobs(link, count, below, after_answer=lambda answers: None, target="any"):
    """Sends the jobs. Returns their outcomes, the time for all, and one line in each direction."""
    command = "DELEGATE " + target + ":primes id={} {{\"below\":" + str(below) + "}}"
    open_ones = set(range(1, count + 1))
    begun = time.monotonic()
    link.send(*[command.format(number) for number in sorted(open_ones)])
    fates, last = collections.Counter(), ""
    while open_ones:
        last = link.receive()
        number, _, body = last.removeprefix("id=").partition(" ")
        open_ones.remove(int(number))
        fates[FATES.get(json.loads(body)["error"], "failed") if body.startswith('{"error":') else "done"] += 1
        after_answer(fates.total())
    return fates, time.monotonic() - begun, command.format(1), last


def show_demo(cluster):
    heading("Four daemons, one pool without a leader")
    for name in NAMES:
        cluster.start(name)
    begun = time.monotonic()
    for name in NAMES:
        patient(lambda name=name: cluster.known_to(name) == set(NAMES) - {name}, f"{name} knows the others")
    show(f"After {time.monotonic() - begun:.1f} s, each knows the three others. This is the configuration of {ASKED} "
         "(clesd --config FILE):")
    for line in cluster.config_of(ASKED).splitlines():
        show(f"    {line}")

    heading("The nodes, their load and their tasks: cles ls --tasks")
    show(cluster.command("ls", "--tasks", "--output", "table"))

    heading("A job for any node: cles delegate any:primes -d '{\"below\":5000000}'")
    begun = time.monotonic()
    show(cluster.command("delegate", "any:primes", "-d", '{"below":5000000}', "-o", "json"))
    below = int(5_000_000 * min(4, JOB_SECONDS / (time.monotonic() - begun)))

    with Link(cluster.urls[ASKED]) as link, Link(cluster.urls[ASKED]) as observer:
        heading(f"{SPREAD} jobs at once, on one connection to {ASKED}, which selects a node for each by load")
        before = jobs_done(observer)
        fates, seconds, sent, received = run_jobs(link, SPREAD, below)
        show(f"> {sent}\n  ... and {SPREAD - 1} more\n< {received}\n  ... and {SPREAD - 1} more, in {seconds:.1f} s")
        after = jobs_done(observer)
        shares = shares_of(before, after)
        for name, share in shares.items():
            show_share(name, share)
        if fates["done"] != SPREAD or sum(shares.values()) != SPREAD or min(shares.values()) == 0:
            raise Trouble(f"expected {SPREAD} jobs to be done, some by each node: {dict(fates)}, {shares}")

        heading(f"{UNDER_FIRE} more, and meanwhile kill -9 for {FIRST}, the seed of the others")

        def fire(answers):
            if answers == UNDER_FIRE // 4:
                cluster.kill(FIRST)
                show(f"{FIRST} is dead; {answers} of {UNDER_FIRE} jobs have been answered so far")

        before = after
        fates, seconds, _, _ = run_jobs(link, UNDER_FIRE, below, fire)
        show(f"{UNDER_FIRE} sent: " + ", ".join(f"{fates[fate]} {fate}" for fate in ("done", "refused", "failed", "unknown"))
             + f", in {seconds:.1f} s")
        shares = shares_of(before, jobs_done(observer))
        show_share(FIRST, fates.total() - sum(shares.values()), " until it was killed")
        for name, share in shares.items():
            show_share(name, share)
        show(f"Other nodes repeated the jobs that {FIRST} left unanswered, since primes is registered as idempotent. For "
             "other tasks, the outcome would be unknown.")
        if fates.total() != UNDER_FIRE or fates["done"] != UNDER_FIRE:
            raise Trouble(f"expected {UNDER_FIRE} jobs to be done: {dict(fates)}")

        heading("Which nodes reply, and which do not: all")
        question = "PULL all:prime/97"
        link.send(question)
        answer = link.receive()
        show(f"> {question}\n< {answer}")
        answer = json.loads(answer)
        if set(answer["results"]) != set(NAMES) - {FIRST} or set(answer["errors"]) != {FIRST}:
            raise Trouble(f"expected a reply of each node except {FIRST}")
    return below


def show_chain(chain, below):
    heading("Four more in a chain: " + " -- ".join(CHAIN))
    for name in CHAIN:
        chain.start(name)
    begun = time.monotonic()
    patient(chain.is_complete, f"{CHAIN[0]} has a route to each")
    show(f"After {time.monotonic() - begun:.1f} s, {CHAIN[0]} has a route to {CHAIN[-1]}. The configuration of {CHAIN[1]}:")
    for line in chain.config_of(CHAIN[1]).splitlines():
        show(f"    {line}")

    with Link(chain.urls[CHAIN[0]]) as link:
        question = f"PULL {CHAIN[-1]}:prime/97"
        heading(f"A request over three links, asked at {CHAIN[0]}")
        show(f"> {question}\n< {json.dumps(link.ask(question), separators=(',', ':'))}")

    with Link(chain.urls[CHAIN[1]]) as link:
        heading(f"{SPREAD} jobs at once, for {CHAIN[1]} by its name; its neighbours have free workers")
        before = jobs_done(link)
        fates, seconds, _, _ = run_jobs(link, SPREAD, below, target=CHAIN[1])
        shares = shares_of(before, jobs_done(link))
        for name, share in shares.items():
            show_share(name, share)
        show(f"{fates['done']} done in {seconds:.1f} s. Jobs that waited at {CHAIN[1]} moved to its neighbours, which had "
             f"asked for them;\nto {CHAIN[-1]} it has no link.")
        moved = shares[CHAIN[0]] + shares[CHAIN[2]]
        if fates["done"] != SPREAD or sum(shares.values()) != SPREAD or moved == 0 or shares[CHAIN[-1]] != 0:
            raise Trouble(f"expected {SPREAD} jobs to be done, some by the neighbours: {dict(fates)}, {shares}")


def interrupt(number, _):
    raise Interrupted(number)


def run(show_all, *clusters):
    """Ends the clusters, whatever happens meanwhile. Returns the exit code."""
    for number in INTERRUPTS:
        signal.signal(number, interrupt)
    try:
        show_all(*clusters)
        return 0
    except (Trouble, OSError, ValueError, KeyError, subprocess.TimeoutExpired) as problem:
        print(f"cles: {problem}", file=sys.stderr)
        return 1
    except Interrupted as interrupted:
        return 128 + interrupted.args[0]
    finally:
        for number in INTERRUPTS:
            signal.signal(number, signal.SIG_IGN)
        for cluster in clusters:
            cluster.close()


def show_both(cluster, chain):
    below = show_demo(cluster)
    cluster.end()
    show_chain(chain, below)


def main():
    programs = sys.argv[1] if len(sys.argv) > 1 else "build/release/apps"
    return run(show_both, Cluster(programs), Chain(programs))


if __name__ == "__main__":
    sys.exit(main())
