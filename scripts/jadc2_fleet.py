# SPDX-License-Identifier: BSL-1.0
"""The four roles of joint command as processes, and the only links between them (section 2.2 of the paper): satellite to
reconnaissance aircraft, reconnaissance aircraft to mission centre, mission centre to strike aircraft."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

sys.path.append(os.path.join(os.path.dirname(__file__), "..", "perf", "evaluation"))
from clean_environment import clean_environment  # noqa: E402
from deferred_signals import DeferredSignals, first_line  # noqa: E402

PATIENCE = float(os.environ.get("CLES_TEST_PATIENCE", "30"))
# Of a track, in seconds: the default of the programs, except under a sanitizer, which makes them slow.
OLDEST_S = 2 if PATIENCE <= 30 else 12
CONFIG = """\
node: {name}
listen: ["{scheme}://{address}:{port}"]
insecure: {insecure}
security: {security}
multicast: off
drain: 500ms
plugins: [{plugins}]
"""
# What each role may request, and what others may request of it. With PULL `cles` and `cles/peers`, nodes learn of each other
# and of their tasks.
FINDS = ["pull *:cles", "pull,push *:cles/peers"]
SATELLITE = {"may": ["bind recon-camera:video", *FINDS],
             "offers": ["delegate,pull *:FMV_Processing", "delegate *:FMV_Frame", *FINDS]}
RIGHTS = {
    "sat1": SATELLITE,
    "sat2": SATELLITE,
    "strike1": {"may": [], "offers": ["delegate,pull,push *:strike", *FINDS]},
    "recon": {"may": [], "offers": ["bind *:tracks", "push *:impact"]},
    "recon-camera": {"may": ["delegate *:FMV_Processing", *FINDS], "offers": ["bind *:video", *FINDS]},
    "mission": {"may": ["bind recon:tracks", "push recon:impact", "delegate,push *:strike", *FINDS], "offers": []},
    "operator": {"may": ["pull *:*", "pull *:*/**"], "offers": []},  # for questions about the outcome
    "loader": {"may": ["delegate *:FMV_Frame"], "offers": []},  # measures how many frames a satellite can process
}


class Trouble(Exception):
    pass


class Loopback:
    """All roles on this host: their arguments determine which of them are connected."""

    insecure = False

    def address(self, _role, _towards):
        return "127.0.0.1"

    def command(self, _role, *words):
        return list(words)

    def close(self):
        pass


class Namespaces:
    """A host for each role. Two hosts are connected only if there is a link between them. With `kbit`, the links of the
    mission centre carry so many kilobits per second in each direction. Requires root."""

    insecure = True
    # Each cable: the role that listens, and the role that connects.
    CABLES = [("satellite", "recon"), ("spare", "recon"), ("recon", "mission"), ("strike", "mission")]

    def __init__(self, kbit=None):
        self.keepers, self.addresses, self.devices = {}, {}, {}
        try:
            for role in ("satellite", "spare", "recon", "mission", "strike"):
                self._keep(role)
                self._ip(role, "link", "set", "lo", "up")
            for number, (listens, asks) in enumerate(self.CABLES, 1):
                self._ip(listens, "link", "add", f"to{number}", "type", "veth", "peer", "name", f"to{number}", "netns",
                         str(self.keepers[asks].pid))
                for end, role in enumerate((listens, asks), 1):
                    self.addresses[role, (asks, listens)[end - 1]] = f"10.78.{number}.{end}"
                    self._ip(role, "address", "add", f"10.78.{number}.{end}/24", "dev", f"to{number}")
                    self._ip(role, "link", "set", f"to{number}", "up")
                    self.devices[role, (asks, listens)[end - 1]] = f"to{number}"
                    if kbit and asks == "mission":
                        self._limit(role, f"to{number}", kbit)
        except BaseException as failure:
            self.close()
            if not isinstance(failure, (OSError, subprocess.CalledProcessError, Trouble)):
                raise
            words = getattr(failure, "stderr", None) or b""
            raise Trouble(f"cannot create network namespaces, which requires root: {failure} "
                          f"{words.decode(errors='replace').strip()}") from None

    def _keep(self, role):
        """Starts a process that keeps a namespace until its input ends, at the latest when this process ends."""
        with DeferredSignals():
            keeper = subprocess.Popen(["unshare", "--net", "sh", "-c", "echo up; exec cat"], stdin=subprocess.PIPE,
                                      stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            self.keepers[role] = keeper
        if keeper.stdout.readline() != b"up\n":
            raise Trouble(keeper.stderr.read().decode(errors="replace").strip())

    def _ip(self, role, *words):
        subprocess.run(self.command(role, "ip", *words), check=True, capture_output=True)

    def _limit(self, role, device, kbit):
        """What exceeds the rate waits for up to two seconds; what would wait for longer is lost. A burst is one frame."""
        subprocess.run(self.command(role, "tc", "qdisc", "add", "dev", device, "root", "tbf", "rate", f"{kbit}kbit",
                                    "burst", "1600", "latency", "2s"), check=True, capture_output=True)

    def limits(self, role, towards):
        """What the limit of that direction has done: its `bytes`, `drops` and `overlimits`."""
        shown = subprocess.run(self.command(role, "tc", "-s", "-j", "qdisc", "show", "dev", self.devices[role, towards]),
                               check=True, capture_output=True, text=True).stdout
        return next(one for one in json.loads(shown) if one["kind"] == "tbf")

    def address(self, role, towards):
        return self.addresses[role, towards]

    def command(self, role, *words):
        return ["nsenter", "--net", f"--target={self.keepers[role].pid}", *words]

    def close(self):
        for keeper in self.keepers.values():
            keeper.kill()
            keeper.communicate()
        self.keepers = {}


class Process:
    """A process of the fleet. It is added before it is ready, so that it ends with the fleet in any case."""

    def __init__(self, fleet, name, command, stdin=subprocess.DEVNULL):
        self.name = name
        self.errors = os.path.join(fleet.folder, f"{name}-{time.monotonic_ns()}.err")
        with open(self.errors, "w", encoding="utf-8") as err, DeferredSignals():
            self.process = subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, stderr=err, text=True,
                                            env=clean_environment())
            fleet.started.append(self)

    def said_wrong(self):
        with open(self.errors, encoding="utf-8") as err:
            return err.read()

    def kill(self):
        self.process.kill()
        self.process.wait()

    def send_signal(self, number):
        self.process.send_signal(number)

    def wait(self):
        try:
            return self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            raise Trouble(f"{self.name} did not end; {self.said_wrong()}") from None

    def stop(self, number=signal.SIGTERM):
        if self.process.poll() is None:
            self.send_signal(number)
        return self.wait()

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        if self.process.stdin:
            self.process.stdin.close()
        self.process.stdout.close()


class Daemon(Process):
    """A clesd with plugins, which listens at `url`."""

    def __init__(self, fleet, role, name, plugins, towards, port=0, more=""):
        config = os.path.join(fleet.folder, name + ".yaml")
        with open(config, "w", encoding="utf-8") as file:
            file.write(CONFIG.format(name=name, address=fleet.hosts.address(role, towards), port=port,
                                     scheme=fleet.scheme, insecure=str(fleet.exposed).lower(),
                                     security=fleet.keys(name) or "off", plugins=", ".join(plugins)) + more)
        self.fleet, self.role = fleet, role
        super().__init__(fleet, name, fleet.hosts.command(role, fleet.program("clesd"), "--config", config))
        line = first_line(self.process, PATIENCE)
        found = re.search(r"listening on (t(?:cp|ls)://\S+:(\d+))", line)
        if not found:
            self.close()
            raise Trouble(f"{name} did not start: {line}{self.said_wrong()}")
        self.url, self.port = found[1], int(found[2])

    def pull(self, noun):
        """Sends a PULL from the daemon's own host, so that no additional link is needed."""
        done = self.ask("operator", "pull", noun, "-o", "json")
        if done.returncode != 0:
            raise Trouble(f"{self.name} did not reply to {noun}: {done.stderr}")
        return json.loads(done.stdout)

    def ask(self, member, *words):
        """Runs `cles` with these words on the daemon's own host, with that member's key if the fleet is secured."""
        command = self.fleet.hosts.command(self.role, self.fleet.program("cles"), *words, "--at", self.url,
                                           *self.fleet.keys_option(member))
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE, check=False,
                              env={**clean_environment(), "CLES_MULTICAST": "off"})

    def peers(self):
        return {peer["node"] for peer in self.pull("self:cles/peers")["peers"]}


class Teller(Process):
    """A cles-jadc2, whose events are kept in order."""

    def __init__(self, fleet, role, *arguments, stdin=subprocess.DEVNULL, listener=None):
        self.events, self.news, self.listener = [], threading.Condition(), listener
        self.reader = threading.Thread(target=self._read, daemon=True)
        super().__init__(fleet, role, fleet.hosts.command(role, fleet.program("cles-jadc2"), role, "--json", *arguments), stdin)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            event = json.loads(line)
            if self.listener:
                self.listener(event)
            with self.news:
                self.events.append(event)
                self.news.notify_all()
        with self.news:
            self.events.append({"event": "ended"})
            self.news.notify_all()

    def wait_for(self, event, words="", after=0):
        """The first such event after the first `after` events; `event` may name several kinds."""
        kinds = (event,) if isinstance(event, str) else event
        until = time.monotonic() + PATIENCE
        with self.news:
            while True:
                for one in self.events[after:]:
                    if one["event"] in kinds and words in one.get("text", ""):
                        return one
                ended = bool(self.events) and self.events[-1]["event"] == "ended"
                if ended or not self.news.wait(max(0, until - time.monotonic())):
                    raise Trouble(f"{self.name} did not report '{' or '.join(kinds)} {words}', but {self.events}; "
                                  f"{self.said_wrong()}")

    def order_by_hand(self, by="", since=0.0, stopped=()):
        """Acts as an operator (--operator): orders and confirms a strike on a target in the picture, detected by that node, and on
        another target if that one is out of sight by then; on one that was not attacked yet, if there is one. Older pictures than
        `since` (seconds since 1970) do not count. The `stopped` processes are stopped at the last moment before the order is
        given: a node that is stopped for longer is taken for lost, and gets no order. Returns the decision."""
        after = self.told()
        while True:
            picture = self.wait_for("picture", after=after)
            after = self.events.index(picture, after) + 1
            seen = picture["data"]
            attacked = [each["data"]["target"] for each in self.all("decided")] + seen.get("engaged", [])
            # Those first that were seen in this very frame: where others are is predicted.
            targets = sorted(seen["tracks"], key=lambda target: (target["id"] in attacked, target["missed"]))
            if not targets or by not in ("", seen["by"]) or seen["captured"] < since:
                continue
            after = self.told()
            best = targets[0]["id"]
            self._type(f"strike {best} again" if best in attacked else f"strike {best}")
            if self.wait_for(("read_back", "operator"), after=after)["event"] == "read_back":
                after = self.told()
                for process in stopped:
                    process.send_signal(signal.SIGSTOP)
                self._type("confirm")
                answer = self.wait_for(("decided", "operator"), after=after)
                if answer["event"] == "decided":
                    return answer
                for process in stopped:
                    process.send_signal(signal.SIGCONT)

    def _type(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def told(self):
        with self.news:
            return len(self.events)

    def all(self, event):
        with self.news:
            return [one for one in self.events if one["event"] == event]

    def end(self):
        """Waits until the process ends; returns its exit code."""
        code = self.wait()
        self.reader.join(PATIENCE)
        return code

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        if self.reader.is_alive():
            self.reader.join(PATIENCE)
        super().close()


class Fleet:
    """All processes that were started; they end with this object, which also removes their files. If `rights` are given,
    as in RIGHTS, all links are sealed, and each role has these rights."""

    def __init__(self, programs, hosts=None, listener=None, rights=None):
        self.programs, self.hosts, self.listener = programs, hosts or Loopback(), listener
        self.started = []
        self.secured = rights is not None
        self.scheme = "tls" if self.secured else "tcp"
        self.exposed = self.hosts.insecure and not self.secured
        self.files = None
        try:
            with DeferredSignals():
                self.files = tempfile.TemporaryDirectory(prefix="cles-jadc2-")
            self.folder = self.files.name
            if self.secured:
                self._create_keys(rights)
        except BaseException:
            self.close()
            raise

    def _create_keys(self, rights):
        def run(*words):
            with DeferredSignals():
                done = subprocess.run([self.program("cles"), *words], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                                      timeout=PATIENCE, check=False, env=clean_environment())
            if done.returncode != 0:
                raise Trouble(f"cannot create the keys: {done.stderr.strip()}")

        fleet = os.path.join(self.folder, "fleet")
        run("fleet", "init", fleet, "--with", ",".join(rights))
        for name, lists in rights.items():
            options = [word for kind in ("may", "offers") for right in lists[kind] or ["none"]
                       for word in ("--" + kind, right)]
            run("fleet", "rights", name, *options, "--keys", fleet)
        for name in rights:
            run("keys", "join", os.path.join(fleet, "roster"), "--keys", self.keys(name))

    def keys(self, member):
        """The member's directory; empty without security."""
        return os.path.join(self.folder, "fleet", member) if self.secured else ""

    def keys_option(self, member):
        return ["--keys", self.keys(member)] if self.secured else []

    def program(self, name):
        return os.path.join(self.programs, name)

    def plugin(self, name):
        return os.path.abspath(os.path.join(self.programs, "..", "plugins", f"libcles-{name}.so"))

    def satellite(self, name="sat1", role="satellite", plugins=None, port=0, more="", seed=1):
        """Starts a satellite whose radar sees the traffic of that seed."""
        plugins = [f"{{path: {self.plugin('fmv')}, config: {{plots: true, seed: {seed}}}}}"] if plugins is None else plugins
        return Daemon(self, role, name, plugins, "recon", port, more)

    def striker(self, name="strike1", plugins=None, port=0, more="", seed=1):
        """Starts a strike aircraft whose sensor sees the traffic of that seed. In a secured fleet, orders must be signed."""
        config = f"oldest_s: {OLDEST_S}, seed: {seed}, must_be_signed: {str(self.secured).lower()}"
        plugins = [f"{{path: {self.plugin('strike')}, config: {{{config}}}}}"] if plugins is None else plugins
        return Daemon(self, "strike", name, plugins, "mission", port, more)

    def recon(self, satellites, *arguments, listen=None):
        """Starts a reconnaissance aircraft; its attribute `url` is the address at which it listens."""
        asked = [word for satellite in satellites for word in ("--satellite", getattr(satellite, "url", satellite))]
        at = listen or f"{self.scheme}://{self.hosts.address('recon', 'mission')}:0"
        roles = dict.fromkeys(getattr(satellite, "role", "satellite") for satellite in satellites)  # a link to each
        camera = [word for role in roles
                  for word in ("--camera-listen", f"{self.scheme}://{self.hosts.address('recon', role)}:0")]
        open_to_all = ["--insecure"] if self.exposed else []
        recon = Teller(self, "recon", "--listen", at, *camera, *open_to_all, *asked, *self.keys_option("recon"), *arguments,
                       listener=self.listener)
        recon.url = recon.wait_for("listening")["text"].removeprefix("listening on ")
        return recon

    def mission(self, recon, strikers, *arguments, stdin=subprocess.DEVNULL, key="mission"):
        """Starts a mission centre, with the key of `key` if the fleet is secured."""
        asked = [word for striker in strikers for word in ("--strike", getattr(striker, "url", striker))]
        return Teller(self, "mission", "--recon", getattr(recon, "url", recon), "--oldest", str(OLDEST_S), *asked, *self.keys_option(key), *arguments,
                      stdin=stdin, listener=self.listener)

    def reaches(self, role, url):
        """Whether the role can connect to the URL."""
        host, _, port = url.partition("://")[2].rpartition(":")
        code = f"import socket; socket.create_connection(({host!r}, {port}), 2)"
        return subprocess.run(self.hosts.command(role, "python3", "-c", code), stdin=subprocess.DEVNULL,
                              capture_output=True, check=False).returncode == 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        for process in reversed(self.started):
            process.close()
        self.hosts.close()
        if self.files is not None:
            self.files.cleanup()


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
