#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Two pools of two bridges each, whose bridges and server are killed and started again under load. Prints what happened to
each request and update, as JSON; fails if an effect or an update happened twice, a gap was not told, or a request was not
answered by its deadline.

    faults.py PROGRAM [FAULTS [SECONDS [SEED]]]        PROGRAM: cles_federation_node
"""

import asyncio
import collections
import json
import random
import sys
import time
from pathlib import Path

from measured_server import MeasuredServer
from nats_server import MISSING, PROGRAM

POOLS = {"north": ("n0", "n1"), "south": ("s0", "s1")}
DEADLINE = 2.0  # seconds, of requests
LATE = 0.25  # by which a reply may be late: this program runs on the same cores
IN_FLIGHT = 8  # requests at each bridge
PACE = 0.012  # seconds between requests of one of them
WHOLE_WITHIN = 2.0


class Node:
    def __init__(self, fleet, pool, name):
        self.fleet, self.pool, self.name = fleet, pool, name
        self.url, self.process = "tcp://127.0.0.1:0", None

    async def start(self):
        seed = next((n.url for n in self.fleet.nodes if n.pool == self.pool and n is not self and not n.url.endswith(":0")), "")
        self.process = await asyncio.create_subprocess_exec(self.fleet.program, self.fleet.server.url, self.pool, self.name,
                                                            self.url, seed, str(self.fleet.marks), stdout=asyncio.subprocess.PIPE)
        said = (await self.process.stdout.readline()).decode().strip()
        if not said:
            raise RuntimeError(f"{self.name} did not start")
        self.url = said

    async def kill(self):
        self.process.kill()
        await self.process.wait()

    async def connect(self):
        host, port = self.url.removeprefix("tcp://").split(":")
        while True:
            try:
                return await asyncio.open_connection(host, int(port), limit=1 << 20)
            except OSError:
                await asyncio.sleep(0.02)


class Fleet:
    def __init__(self, program, server, folder):
        self.program, self.server, self.marks = program, server, Path(folder, "marks")
        self.nodes = [Node(self, pool, name) for pool, names in POOLS.items() for name in names]
        self.outcomes = collections.Counter()
        self.problems = []
        self.answered_at = {}  # (bridge, target): when a request between them succeeded last
        self.last_number = 0
        self.stopping = False
        self.updates = collections.Counter()

    # -- requests ------------------------------------------------------------------------------------------------------

    async def ask_at(self, node):
        """Sends requests at a bridge, over links that end with it, until `stopping`."""
        targets = [n.name for n in self.nodes if n.pool != node.pool]
        while not self.stopping:
            reader, writer = await node.connect()
            open_ones = {}
            sender = asyncio.create_task(self.send(node, writer, targets, open_ones))
            try:
                await self.receive(node, reader, open_ones)
            finally:
                sender.cancel()
                writer.close()
            self.outcomes["lost with the bridge"] += len(open_ones)

    async def send(self, node, writer, targets, open_ones):
        while not self.stopping:
            await asyncio.sleep(PACE)
            if len(open_ones) >= IN_FLIGHT * 4:
                continue
            self.last_number += 1
            number, target = self.last_number, random.choice(targets)
            open_ones[number] = (time.monotonic(), target)
            writer.write(f"DELEGATE {target}:once/{number} id={number} deadline={int(DEADLINE * 1000)}\n".encode())

    async def receive(self, node, reader, open_ones):
        while not (self.stopping and not open_ones):
            try:
                line = await asyncio.wait_for(reader.readline(), DEADLINE + LATE if open_ones else 0.1)
            except TimeoutError:
                if open_ones and min(sent for sent, _ in open_ones.values()) + DEADLINE + LATE < time.monotonic():
                    self.problems.append(f"no answer at {node.name}: {open_ones}")
                    return
                continue
            except ConnectionError:
                return
            if not line:
                return
            head, _, text = line.decode().partition(" ")
            number = int(head.removeprefix("id="))
            sent, target = open_ones.pop(number)
            took = time.monotonic() - sent
            if took > DEADLINE + LATE:
                self.problems.append(f"request {number} at {node.name} was answered after {took:.2f} s")
            answer = json.loads(text)
            if "error" in answer:
                self.outcomes[answer["error"]] += 1
                continue
            self.outcomes["done"] += 1
            self.answered_at[node.name, target] = time.monotonic()
            if answer["value"] != target:
                self.problems.append(f"request {number} for {target} was done by {answer['value']}")

    # -- updates -------------------------------------------------------------------------------------------------------

    async def read_at(self, node, publisher):
        """Reads the updates of a publisher of the other pool: 100 a second."""
        last = {}  # by epoch: seq and n of the last update
        while not self.stopping:
            reader, writer = await node.connect()
            try:
                bound = False
                while not bound and not self.stopping:
                    writer.write(f"BIND {publisher}:ticks id=1 deadline=1000\n".encode())
                    line = await reader.readline()
                    while line.startswith(b"UPDATE"):
                        line = await reader.readline()
                    if not line:
                        break
                    bound = b'"error"' not in line
                    await asyncio.sleep(0 if bound else 0.1)
                while not self.stopping:
                    line = await asyncio.wait_for(reader.readline(), 30)
                    if not line:
                        break
                    self.check_update(node, line.decode(), last)
            except (ConnectionError, TimeoutError):
                pass
            finally:
                writer.close()

    def check_update(self, node, line, last):
        parts = dict(part.split("=", 1) for part in line.split(" ") if "=" in part and not part.startswith("{"))
        seq, epoch, n = int(parts["seq"]), parts["epoch"], json.loads(line[line.index("{"):])["n"]
        if epoch in last:
            last_seq, last_n = last[epoch]
            if seq <= last_seq:
                self.problems.append(f"update {seq} at {node.name} follows {last_seq}: {line}")
            if n - last_n != seq - last_seq:
                self.problems.append(f"a gap at {node.name} is not told: n {last_n} to {n}, seq {last_seq} to {seq}")
            self.updates["missed, told by seq"] += seq - last_seq - 1
        last[epoch] = (seq, n)
        self.updates["received"] += 1

    # -- faults --------------------------------------------------------------------------------------------------------

    async def break_things(self, count, seconds, rng):
        for fault in range(count):
            begun = time.monotonic()
            victim = rng.choice([*self.nodes, *self.nodes, None])
            if victim is None:
                self.server.stop()
                await asyncio.sleep(rng.uniform(0.05, 0.6))
                await asyncio.to_thread(self.server.start)
            else:
                await victim.kill()
                await asyncio.sleep(rng.uniform(0.05, 0.4))
                await victim.start()
            last = time.monotonic()
            self.outcomes["faults of the server" if victim is None else "faults of bridges"] += 1
            if fault + 1 != count:
                await asyncio.sleep(max(0.0, seconds / count - (time.monotonic() - begun)))
        return last

    async def whole_after(self, since):
        pairs = [(a.name, b.name) for a in self.nodes for b in self.nodes if a.pool != b.pool]
        while any(self.answered_at.get(pair, 0) <= since for pair in pairs):
            if time.monotonic() > since + 30:
                raise RuntimeError(f"not whole: {[p for p in pairs if self.answered_at.get(p, 0) <= since]}")
            await asyncio.sleep(0.01)
        return time.monotonic() - since

    async def run(self, faults, seconds, seed):
        for node in self.nodes:
            await node.start()
        tasks = [asyncio.create_task(self.ask_at(node)) for node in self.nodes]
        tasks += [asyncio.create_task(self.read_at(self.nodes[2], "n0")), asyncio.create_task(self.read_at(self.nodes[1], "s1"))]
        await self.whole_after(time.monotonic())
        last = await self.break_things(faults, seconds, random.Random(seed))
        whole = await self.whole_after(last)
        await asyncio.sleep(1)
        self.stopping = True
        done, pending = await asyncio.wait(tasks, timeout=DEADLINE + 2)
        for task in pending:
            task.cancel()
        for task in done:
            task.result()
        return whole

    async def run_and_end(self, *arguments):
        try:
            return await self.run(*arguments)
        finally:
            for node in self.nodes:
                if node.process is not None and node.process.returncode is None:
                    await node.kill()


def main(program, faults="50", seconds="80", seed="1"):
    if PROGRAM is None:
        print(MISSING, file=sys.stderr)
        return 77
    with MeasuredServer() as server:
        fleet = Fleet(program, server, server.folder.name)
        whole = asyncio.run(fleet.run_and_end(int(faults), float(seconds), int(seed)))
        effects = collections.Counter(line.split()[0] for line in fleet.marks.read_text(encoding="utf-8").splitlines())
    twice = [number for number, times in effects.items() if times > 1]
    found = {"requests": fleet.last_number, "outcomes": dict(fleet.outcomes), "effects": len(effects), "effects_twice": len(twice),
             "updates": dict(fleet.updates), "whole_after_s": round(whole, 2), "problems": len(fleet.problems)}
    print(json.dumps(found))
    for problem in fleet.problems[:10]:
        print(problem, file=sys.stderr)
    return 0 if not twice and not fleet.problems and whole <= WHOLE_WITHIN else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
