# SPDX-License-Identifier: BSL-1.0
"""Two hosts with a cable between them: network namespaces, which root creates directly, and other users as far as the
system permits."""

import os
import shutil
import subprocess
import unittest

from support import CLES, environment, wait_until


def cannot_be_made(why):
    """If everything has to be tested, that is a failure."""
    if os.environ.get("CI") == "true":
        raise AssertionError(why)
    raise unittest.SkipTest(why)


class Hosts:
    """`near` has 10.77.0.1 at v0, `far` has 10.77.0.2 at v1, unless other addresses are given; both have loopback."""

    # A user who is not root is root in such a namespace: a container or a changed root directory may not permit it.
    IS_ROOT = os.geteuid() == 0

    def __init__(self, near=("v0", "10.77.0.1/24"), far=("v1", "10.77.0.2/24")):
        if not all(shutil.which(tool) for tool in ("unshare", "nsenter", "ip")):
            cannot_be_made("it takes unshare, nsenter and ip")
        self.keepers = []
        try:
            self.near = self._keep(["unshare", *([] if self.IS_ROOT else ["--user", "--map-root-user"]), "--net"])
            self.far = self._keep([*self.inside(self.near), "unshare", "--net"])
            self.ip(self.near, "link", "add", near[0], "type", "veth", "peer", "name", far[0], "netns", str(self.far))
            for host, (name, address) in ((self.near, near), (self.far, far)):
                self.ip(host, "address", "add", address, "dev", name)
                self.ip(host, "link", "set", name, "up")
                self.ip(host, "link", "set", "lo", "up")
            for host, name in ((self.near, near[0]), (self.far, far[0])):
                wait_until(lambda at=host, of=name: "LOWER_UP" in self.ip(at, "link", "show", of), f"{name} has a link")
        except (subprocess.CalledProcessError, OSError) as failure:
            self.close()
            words = getattr(failure, "stderr", None) or ""
            cannot_be_made(f"no network namespaces here: {failure} {words.strip()}")

    def _keep(self, command):
        """A process in a separate namespace, which keeps it alive."""
        keeper = subprocess.Popen([*command, "sh", "-c", "echo up; exec sleep infinity"], stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE)
        self.keepers.append(keeper)
        if keeper.stdout.readline() != b"up\n":
            raise OSError(keeper.stderr.read().decode(errors="replace").strip())
        return keeper.pid

    @classmethod
    def inside(cls, host):
        """The prefix of a command that runs there."""
        user = [] if cls.IS_ROOT else ["--preserve-credentials", "--user"]
        return ["nsenter", *user, "--net", f"--target={host}"]

    def ip(self, host, *arguments):
        return subprocess.run([*self.inside(host), "ip", *arguments], check=True, capture_output=True, text=True).stdout

    def start(self, test, host, multicast, *arguments):
        """Starts `cles` there, until the test ends."""
        process = subprocess.Popen([*self.inside(host), CLES, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True, env=environment(CLES_MULTICAST=multicast))
        test.addCleanup(process.stderr.close)
        test.addCleanup(process.stdout.close)
        test.addCleanup(process.wait)
        test.addCleanup(process.kill)
        return process

    def close(self):
        for keeper in reversed(self.keepers):
            keeper.kill()
            keeper.wait()
            keeper.stdout.close()
            keeper.stderr.close()
