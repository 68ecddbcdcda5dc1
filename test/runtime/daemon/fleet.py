# SPDX-License-Identifier: BSL-1.0
"""Several daemons that have discovered each other, and the marks of their jobs."""

import collections
import contextlib
import json
import os
import signal

from daemon import DEFAULTS, Daemon, Folder
from support import wait_until

COUNTING = os.environ.get("COUNTING_PLUGIN", "")


class Fleet:
    """Nodes sat1, sat2 ..., each of which routes to all; sat1 is the others' seed."""

    def __init__(self, count, queue=8, more="drain: 500ms\n"):
        self.queue, self.more = queue, more
        self.names = [f"sat{i + 1}" for i in range(count)]
        with contextlib.ExitStack() as opened:
            self.folder = opened.enter_context(Folder())
            self.marks_file = self.folder.write("", "marks")
            self.nodes = {}
            for name in self.names:
                self.nodes[name] = opened.enter_context(self.start(name))
            wait_until(lambda: all(self.live_at(name) == set(self.names) - {name} for name in self.names),
                       "all know all")
            self.opened = opened.pop_all()

    def start(self, name):
        others = [node.url for other, node in self.nodes.items() if other != name and node.process.poll() is None]
        seeds = f"seeds: [{others[0]}]\n" if others else ""
        return Daemon(f"queue: {self.queue}\n{self.more}plugins: [{{path: {COUNTING}, config: {{marks: {self.marks_file}}}}}]\n"
                      + seeds, base=DEFAULTS.replace("sat1", name).replace("level: debug", "level: info"))

    def __getitem__(self, name):
        return self.nodes[name]

    def peers_at(self, name):
        return json.loads(self.nodes[name].ask("PULL self:cles/peers"))["peers"]

    def live_at(self, name):
        return {peer["node"] for peer in self.peers_at(name) if peer["state"] == "live"}

    def load_at(self, name, other):
        """The load of one node as another knows it."""
        return next((peer["load"] for peer in self.peers_at(name) if peer["node"] == other), {})

    def kill(self, name):
        """Returns when it has ended and its sockets are closed."""
        self.nodes[name].send_signal(signal.SIGKILL)
        self.nodes[name].process.wait()

    def restart(self, name, meanwhile):
        """Stops it and starts it again, as for an update; `meanwhile(condition, what)` waits for its end."""
        node = self.nodes[name]
        node.send_signal(signal.SIGTERM)
        meanwhile(lambda: node.process.poll() is not None, f"{name} has ended")
        if node.process.returncode != 0:
            raise AssertionError(f"{name} ended with {node.process.returncode}: {node.log()}")
        self.nodes[name] = self.opened.enter_context(self.start(name))
        meanwhile(lambda: name in self.live_at("sat1"), f"{name} is there again")

    def pause(self, name):
        """Returns when it has stopped."""
        process = self.nodes[name].process
        process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOWAIT)

    def resume(self, name):
        self.nodes[name].send_signal(signal.SIGCONT)

    def marks(self):
        """By number of a job: the nodes where it ran."""
        with open(self.marks_file, encoding="utf-8") as marks:
            found = collections.defaultdict(list)
            for line in marks.read().splitlines():
                number, node = line.split()
                found[int(number)].append(node)
            return found

    def stop(self):
        """Stops all; returns their exit codes."""
        return [node.stop()[0] for node in self.nodes.values() if node.process.poll() is None]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.opened.close()
