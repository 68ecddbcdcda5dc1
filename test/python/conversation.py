# SPDX-License-Identifier: BSL-1.0
"""A node of the Python package without a network, which runs the scripts of test/golden (see the README there)."""

import re

from cles import grammar, jsontext
from cles.core import Core, Peer, Task
from cles.errors import Error
from cles.following import Subscription
from cles.limits import Limits
from cles.session import Session
from cles.timers import MS

STEP = re.compile(r"([a-z]?)(>>|>|@) (.*)", re.DOTALL)
EXPECTATION = re.compile(r"[a-z]?[<=] ")


class ScriptError(Exception):
    """A step that is not valid in a script."""


def fits(pattern: str, text: str) -> bool:
    return re.fullmatch(".*".join(map(re.escape, pattern.split("..."))), text, re.DOTALL) is not None


def unescaped(text: str) -> str:
    data = re.sub(rb"\\(?:x([0-9A-Fa-f]{2})|(.))",
                  lambda m: bytes.fromhex(m[1].decode()) if m[1] else {b"t": b"\t", b"r": b"\r"}.get(m[2], m[2]),
                  text.encode())
    return data.decode("utf-8", "surrogateescape")


class Link:
    """The carrier of a session, which notes what happens to it."""

    def __init__(self, name: str, core: Core, told: list[str]):
        self.prefix = "" if name == "a" else name
        self.takes = True
        self.paused = False
        self.states: list[str] = []
        self.session = Session(core, self, Peer("test", name))
        self.session.put = lambda line: told.append(f"{self.prefix}< {line}")

    def wake(self):
        pass

    def retire(self):
        pass

    def finish(self):
        self.states.append("finish")

    def close(self):
        self.states.append("close")

    def pause(self, stop):
        if stop != self.paused:
            self.paused = stop
            self.states.append("pause" if stop else "go on")

    def unsent(self):
        return 0 if self.takes else 1 << 30


class Outcome:
    def __init__(self, id, tell):
        self.id = id
        self.tell = tell

    def resolve(self, value, reply):
        self.tell(f"{self.id} ok {reply.body}")

    def reject(self, error):
        self.tell(f"{self.id} failed {error.code}")


class Conversation:
    def __init__(self):
        self.now = 0
        self.limits = Limits()
        self.core = None
        self.links: dict[str, Link] = {}
        self.told: list[str] = []
        self.calls: dict[str, list] = {}
        self.stopped: list[str] = []

    # --- The node and its tasks ---

    def make_core(self):
        if self.core is not None:
            return
        core = self.core = Core("car1", lambda: self.now, self.limits, epoch="5f3a09c1")
        core.authorise = lambda wanted: wanted.noun.task != "secret"
        for task, text in (("speed", '{"v":27.5}'), ("secret", "{}"), ("number", "42"), ("list", "[1,2]"), ("nothing", ""),
                           ("misleading", '{"error":"it only looks like one"}')):
            core.add("PULL", task, Task(lambda call, text=text: call.done(text)))
        core.add("PULL", "echo", Task(lambda call: call.done(
            jsontext.write({"parameters": list(call.request.noun.parameters)}))))
        core.add("PULL", "text", Task(lambda call: call.done(jsontext.write("x" * int(call.request.noun.parameters[0])))))
        for verb in ("PUSH", "DELEGATE"):
            core.add(verb, "echo", Task(lambda call: call.done(jsontext.write(call.value))))
        core.add("PUSH", "fail", Task(lambda call: call.fail(Error(call.request.noun.parameters[0], "as it was asked to"))))
        core.add("UPDATE", "notice", Task(lambda call: call.done()))
        core.opened.add("localization")
        core.add("BIND", "lane", Task(self.bind_lane))
        for verb, task in (("DELEGATE", "work"), ("PULL", "slow"), ("PUSH", "store"), ("UPDATE", "survey")):
            core.add(verb, task, Task(self.start_later))

    @staticmethod
    def bind_lane(call):
        if call.request.noun.parameters == ("left",):
            call.done()
        else:
            call.fail(Error("bad_request", "there is only lane/left"))

    def start_later(self, call):
        key = (*call.request.noun.parameters, "")[0]
        self.calls.setdefault(key, []).append(call)
        call.on_stop(lambda: self.stopped.append(key))

    def link(self, name: str) -> Link:
        self.make_core()
        return self.links.get(name) or self.links.setdefault(name, Link(name, self.core, self.told))

    # --- Steps ---

    def perform(self, step: str) -> list[str]:
        """What the step causes, in the syntax of the script."""
        found = STEP.fullmatch(step)
        if not found:
            raise ScriptError("a step begins with '> ', '>> ' or '@ '")
        name, kind, rest = found.groups()
        name = name or "a"
        if kind == "@":
            self.happen(name, rest)
        else:
            self.link(name).session.on_line(unescaped(rest) if kind == ">>" else rest, self.now)
        for link in self.links.values():
            link.session.serve_more(self.now)
        for link in self.links.values():
            self.told += [f"{link.prefix}= {state}" for state in link.states]
            link.states = []
        self.told += [f"= stopped {key}" for key in self.stopped]
        for key in self.stopped:
            self.calls.pop(key, None)
        self.stopped = []
        told = list(self.told)
        self.told.clear()
        return told

    def tell(self, what: str):
        self.told.append(f"= {what}")

    def happen(self, name: str, rest: str):
        what, _, rest = rest.partition(" ")
        if what == "limits":
            for each in rest.split(" "):
                key, _, value = each.partition("=")
                setattr(self.limits, key, int(value))
            return
        self.make_core()
        if what == "pass":
            self.pass_time(int(rest))
        elif what == "publish":
            path, _, body = rest.partition(" ")
            self.core.publish(path, body)
        elif what in ("done", "fail", "progress"):
            self.on_handler(what, rest)
        else:
            self.on_link(name, what, rest)

    def pass_time(self, ms: int):
        until = self.now + ms * MS
        while (due := self.core.timers.next_due()) is not None and due <= until:
            self.now = due
            self.core.timers.run(due)
        self.now = until

    def on_handler(self, what: str, rest: str):
        key, _, rest = rest.partition(" ")
        if not self.calls.get(key):
            raise ScriptError(f"no handler of '{key}' runs")
        if what == "progress":
            percent, _, text = rest.partition(" ")
            self.calls[key][0].progress(int(percent) / 100, text)
            return
        call = self.calls[key].pop(0)
        if what == "done":
            call.done(rest)
        else:
            code, _, text = rest.partition(" ")
            call.fail(Error(code, text))

    def on_link(self, name: str, what: str, rest: str):
        link = self.link(name)
        session = link.session
        match what:
            case "end":
                session.on_end()
            case "lost":
                session.on_lost("reset")
            case "overlong":
                session.on_overlong(rest)
            case "full":
                link.takes = False
            case "room":
                link.takes = True
                session.on_writable(self.now)
            case "ask":
                self.ask(session, rest)
            case "cancel":
                session.asking.cancel(int(rest))
            case "follow":
                self.follow(session, rest)
            case _:
                raise ScriptError(f"there is no step '@ {what}'")

    def ask(self, session: Session, rest: str):
        id, verb, noun, *more = rest.split(" ", 3)
        rest = more[0] if more else ""
        deadline = grammar.default_deadline_ms(verb)
        progress = None
        if rest.startswith("deadline="):
            word, _, rest = rest.partition(" ")
            deadline = int(word[9:])
        if rest.startswith("progress=yes"):
            _, _, rest = rest.partition(" ")
            progress = lambda fraction, value: self.tell(  # noqa: E731
                f"{id} progress {int(fraction * 100)} {jsontext.write(value)}")
        session.asking.send(verb, noun, rest, self.now + deadline * MS, Outcome(id, self.tell), id=int(id), progress=progress)

    def follow(self, session: Session, rest: str):
        noun, _, every = rest.partition(" ")
        parts = grammar.parse_noun(noun)

        def deliver(publisher, seq, value, missed, restarted):
            if missed:
                self.tell(f"gap {noun} {missed}")
            self.tell(f"update {noun} {seq} {jsontext.write(value)}")

        if not session.subscriptions.add(Subscription(parts.target, parts.path, deliver, thinned=every == "every")):
            raise ScriptError("it is followed already")


def replay(script: str) -> list[str]:
    """The differences between a script and what happens."""
    talk = Conversation()
    problems: list[str] = []
    came: list[str] = []
    steps = 0

    def nothing_left():
        problems.extend(f"line {number}: nobody expected '{line}'" for line in came)
        came.clear()

    number = 0
    for number, line in enumerate(script.splitlines(), 1):
        if not line or line.startswith("#"):
            continue
        if STEP.fullmatch(line):
            nothing_left()
            steps += 1
            try:
                came += talk.perform(line)
            except ScriptError as error:
                problems.append(f"line {number}: {error}")
        elif EXPECTATION.match(line):
            if not came:
                problems.append(f"line {number}: expected '{line}', nothing came")
            elif not fits(line, came[0]):
                problems.append(f"line {number}: expected '{line}', there came '{came.pop(0)}'")
            else:
                came.pop(0)
        else:
            problems.append(f"line {number}: neither a step, nor an expectation, nor a comment")
    nothing_left()
    if not steps:
        problems.append("nothing happens")
    return problems
