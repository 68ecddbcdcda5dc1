# SPDX-License-Identifier: BSL-1.0
"""Two hosts on one machine: network namespaces with a virtual cable between them. The second has a part of one core. What
the system does not permit is left out, and reported."""

import os
import shutil
import subprocess
import tempfile


class Host:
    """Runs commands on these cores, and in a namespace and within a quota if there are any."""

    def __init__(self, address, cores, keeper=None, group=None):
        self.address, self.cores, self.keeper, self.group = address, cores, keeper, group

    def on(self, cores):
        """The same host with fewer cores."""
        return Host(self.address, cores, self.keeper, self.group)

    def command(self, *words):
        inside = ["nsenter", "--net", f"--target={self.keeper.pid}"] if self.keeper else []
        bound = ["sh", "-c", 'echo $$ > "$0/cgroup.procs" && exec "$@"', self.group] if self.group else []
        return [*inside, *bound, "taskset", "--cpu-list", ",".join(map(str, self.cores)), *words]


class Hosts:
    """`near` is this machine with all its cores; `far` has the last of them, and `quota` of its time."""

    # Less than the kernel's 100 ms, so that shards of some 10 ms take their share of the time, not all or nothing.
    PERIOD_US = 10_000

    def __init__(self, quota):
        self.missing = []  # descriptions of what the system does not permit
        self.keepers = []
        cores = sorted(os.sched_getaffinity(0))
        self.group = self._make_group(quota)
        keepers = self._make_namespaces()
        near, far = ("10.77.1.1", "10.77.1.2") if keepers else ("127.0.0.1", "127.0.0.1")
        self.near = Host(near, cores, keepers[0] if keepers else None)
        self.far = Host(far, cores[-1:], keepers[1] if keepers else None, self.group)
        self.others = cores[:-1] or cores  # all but the core of the second host
        if len(cores) == 1:
            self.missing.append("a core of its own for the second host: both share the only one")
        self.quota, self.period_ms = (quota, self.PERIOD_US / 1000) if self.group else (None, None)

    def over(self, linked):
        """The same two hosts with another link between them: two namespaces of `linked_hosts`."""
        near, far = linked.keepers
        return LinkedPair(Host(linked.addresses["near"], self.near.cores, near),
                          Host(linked.addresses["far"], self.far.cores, far, self.group), self.others)

    def described(self):
        return {"namespaces": bool(self.keepers), "cores": self.near.cores, "far_cores": self.far.cores,
                "far_quota": self.quota, "far_period_ms": self.period_ms, "near_reduced_cores": self.others,
                "not_allowed": self.missing}

    def _make_namespaces(self):
        try:
            for _ in range(2):
                self.keepers.append(subprocess.Popen(["unshare", "--net", "sh", "-c", "echo up; exec sleep infinity"],
                                                     stdout=subprocess.PIPE, stderr=subprocess.PIPE))
                if self.keepers[-1].stdout.readline() != b"up\n":
                    raise OSError(self.keepers[-1].stderr.read().decode(errors="replace").strip())
            near, far = self.keepers
            self._ip(near, "link", "add", "v0", "type", "veth", "peer", "name", "v1", "netns", str(far.pid))
            for keeper, name, address in ((near, "v0", "10.77.1.1/24"), (far, "v1", "10.77.1.2/24")):
                self._ip(keeper, "address", "add", address, "dev", name)
                self._ip(keeper, "link", "set", name, "up")
                self._ip(keeper, "link", "set", "lo", "up")
            return self.keepers
        except (OSError, subprocess.CalledProcessError) as failure:
            self.missing.append(f"network namespaces ({failure}): both hosts share loopback")
            self._end_keepers()
            return []

    @staticmethod
    def _ip(keeper, *words):
        subprocess.run(["nsenter", "--net", f"--target={keeper.pid}", "ip", *words], check=True, capture_output=True)

    def _make_group(self, quota):
        """A control group for the CPU, of either version; empty if none can be created."""
        for folder, files in (("/sys/fs/cgroup/cpu", {"cpu.cfs_period_us": f"{self.PERIOD_US}",
                                                      "cpu.cfs_quota_us": f"{int(quota * self.PERIOD_US)}"}),
                              ("/sys/fs/cgroup", {"cpu.max": f"{int(quota * self.PERIOD_US)} {self.PERIOD_US}"})):
            group = None
            try:
                group = tempfile.mkdtemp(prefix="cles-far-", dir=folder)
                for name, value in files.items():
                    if not os.path.exists(os.path.join(group, name)):
                        raise OSError(f"no {name}")
                    with open(os.path.join(group, name), "w", encoding="utf-8") as file:
                        file.write(value)
                return group
            except OSError as failure:
                reason = failure
                if group and os.path.isdir(group):
                    os.rmdir(group)
        self.missing.append(f"a CPU quota ({reason}): the second host is pinned to its core alone")
        return None

    def _end_keepers(self):
        for keeper in self.keepers:
            keeper.kill()
            keeper.wait()
            keeper.stdout.close()
            keeper.stderr.close()
        self.keepers = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._end_keepers()
        if self.group:
            try:
                os.rmdir(self.group)
            except OSError:
                pass  # a process in it has not ended yet


class LinkedPair:
    def __init__(self, near, far, others):
        self.near, self.far, self.others = near, far, others


def can_pin():
    return shutil.which("taskset") is not None
