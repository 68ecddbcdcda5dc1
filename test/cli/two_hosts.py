# SPDX-License-Identifier: BSL-1.0
"""Two hosts with a cable between them: network namespaces, made without privileges where the system lets users do so."""

import shutil
import subprocess
import unittest


class Hosts:
    """`near` has 10.77.0.1 at v0, `far` has 10.77.0.2 at v1; both have loopback."""

    def __init__(self):
        if not all(shutil.which(tool) for tool in ("unshare", "nsenter", "ip")):
            raise unittest.SkipTest("it takes unshare, nsenter and ip")
        self.keepers = []
        try:
            self.near = self._keep(["unshare", "--user", "--map-root-user", "--net"])
            self.far = self._keep([*self.inside(self.near), "unshare", "--net"])
            self._ip(self.near, "link", "add", "v0", "type", "veth", "peer", "name", "v1", "netns", str(self.far))
            for host, name, address in ((self.near, "v0", "10.77.0.1/24"), (self.far, "v1", "10.77.0.2/24")):
                self._ip(host, "address", "add", address, "dev", name)
                self._ip(host, "link", "set", name, "up")
                self._ip(host, "link", "set", "lo", "up")
        except (subprocess.CalledProcessError, OSError) as failure:
            self.close()
            raise unittest.SkipTest(f"no network namespaces here: {failure}") from None

    def _keep(self, command):
        """A process that lives in a namespace of its own, and keeps it."""
        keeper = subprocess.Popen([*command, "sh", "-c", "echo up; exec sleep infinity"], stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL)
        self.keepers.append(keeper)
        if keeper.stdout.readline() != b"up\n":
            raise OSError("unshare failed")
        return keeper.pid

    @staticmethod
    def inside(host):
        """What a command begins with that runs there."""
        return ["nsenter", "--preserve-credentials", "--user", "--net", f"--target={host}"]

    def _ip(self, host, *arguments):
        subprocess.run([*self.inside(host), "ip", *arguments], check=True, capture_output=True)

    def close(self):
        for keeper in reversed(self.keepers):
            keeper.kill()
            keeper.wait()
            keeper.stdout.close()
