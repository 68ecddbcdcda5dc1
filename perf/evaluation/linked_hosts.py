# SPDX-License-Identifier: BSL-1.0
"""Two hosts on one machine, which are network namespaces with a virtual cable or a relay between them; or one host with
its loopback interface."""

import contextlib
import os
import shutil
import socket
import subprocess


WIFI = ("--delay", "1.5", "--jitter", "1", "--loss", "1")  # a link like WiFi: ms each way, ms on average, percent


def free_group():
    """A multicast group on loopback at a port of its own, separate from all other nodes of this host."""
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"lo,239.255.25.37:{probe.getsockname()[1]}"


def why_not():
    """What is missing for it; empty if nothing is."""
    missing = [tool for tool in ("unshare", "nsenter", "ip", "taskset") if not shutil.which(tool)]
    if missing:
        return f"it requires {', '.join(missing)}"
    if os.geteuid() != 0:
        return "it requires root"
    if subprocess.run(["unshare", "--net", "true"], capture_output=True, check=False).returncode != 0:
        return "network namespaces cannot be created here"
    if not os.access("/dev/net/tun", os.R_OK | os.W_OK):
        return "it requires /dev/net/tun"
    return ""


class OneHost:
    """`near` and `far` are this host, by loopback, each on a core of its own if there are two."""

    def __init__(self):
        self.processes = []
        cores = sorted(os.sched_getaffinity(0))
        self.cores = {"near": cores[0], "far": cores[-1]}
        self.addresses = {"near": "127.0.0.1", "far": "127.0.0.1"}
        self.groups = dict.fromkeys(("near", "far"), free_group())

    def command(self, end, *words):
        """The command that runs this at one end."""
        return ["taskset", "--cpu-list", str(self.cores[end]), *words] if shutil.which("taskset") else list(words)

    def start(self, end, *words):
        """Starts a program there, and returns the first line that it prints."""
        return self._start(self.command(end, *words))

    @contextlib.contextmanager
    def running(self, end, *words):
        """Runs a program there during the block; its value is the first line that the program prints."""
        line = self.start(end, *words)
        process = self.processes[-1]
        try:
            yield line
        finally:
            self.processes.remove(process)
            process.kill()
            process.communicate()

    def _start(self, words):
        process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True)
        self.processes.append(process)
        line = process.stdout.readline().strip()
        if not line:
            raise OSError(process.stderr.read().strip())
        return line

    def close(self):
        for process in reversed(self.processes):
            process.kill()
            process.communicate()
        self.processes = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class LinkedHosts(OneHost):
    """`near` and `far` are network namespaces. Without arguments for a relay the link between them is a virtual cable."""

    def __init__(self, relay=None, words=()):
        super().__init__()
        self.addresses = {"near": "10.79.0.1", "far": "10.79.0.2"}
        self.keepers = []
        try:
            near, far = self._keep(), self._keep()
            self.places = {"near": near, "far": far}
            if relay:
                devices = ("r0", "r1")
                self._start(["nsenter", "--net", f"--target={near}", relay, "--near", "r0", "--far", "r1", *words])
                self._ip(near, "link", "set", "r1", "netns", str(far))
            else:
                devices = ("v0", "v1")
                self._ip(near, "link", "add", "v0", "type", "veth", "peer", "name", "v1", "netns", str(far))
            self._address(devices)
            self.groups = dict(zip(("near", "far"), devices))
        except BaseException:
            self.close()
            raise

    def _keep(self):
        """A process that holds a namespace until its input ends, so no longer than this process exists."""
        keeper = subprocess.Popen(["unshare", "--net", "sh", "-c", "echo up; exec cat"], stdin=subprocess.PIPE,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.keepers.append(keeper)
        if keeper.stdout.readline() != b"up\n":
            raise OSError(keeper.stderr.read().decode(errors="replace").strip())
        return keeper.pid

    def _address(self, devices):
        """Sets the neighbours, because ARP requests could be lost; and turns off other traffic on the link."""
        ends = []
        for (end, place), device in zip(self.places.items(), devices):
            address = self.addresses[end]
            subprocess.run(["nsenter", "--net", f"--target={place}", "sh", "-c",
                            'for f in /proc/sys/net/ipv6/conf/*/disable_ipv6; do [ ! -e "$f" ] || echo 1 > "$f"; done'],
                           check=False, capture_output=True)
            self._ip(place, "link", "set", "lo", "up")
            self._ip(place, "address", "add", f"{address}/24", "dev", device)
            self._ip(place, "link", "set", device, "up")
            ends.append((place, device, address, self._hardware_address(place, device)))
        for (place, device, _, _), (_, _, other, hardware) in (ends, reversed(ends)):
            self._ip(place, "neighbour", "replace", other, "lladdr", hardware, "dev", device, "nud", "permanent")

    @staticmethod
    def _hardware_address(place, device):
        shown = subprocess.run(["nsenter", "--net", f"--target={place}", "ip", "-oneline", "link", "show", device],
                               check=True, capture_output=True, text=True).stdout.split()
        return shown[shown.index("link/ether") + 1]

    @staticmethod
    def _ip(place, *words):
        subprocess.run(["nsenter", "--net", f"--target={place}", "ip", *words], check=True, capture_output=True)

    def command(self, end, *words):
        return ["nsenter", "--net", f"--target={self.places[end]}", *super().command(end, *words)]

    def close(self):
        super().close()
        for keeper in self.keepers:
            keeper.kill()
            keeper.communicate()
        self.keepers = []
