#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The installed units of systemd: what they say, and how systemd runs the daemon and the gateway by them.

    service_test.py --cmake CMAKE --build BUILD --source ROOT [TEST...]
"""

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

PATIENCE = 60.0
SYSTEMD = "/lib/systemd/systemd"
options = argparse.Namespace()


def install(prefix: Path, destdir: str = "") -> None:
    subprocess.run([options.cmake, "--install", options.build, "--prefix", prefix], check=True, stdout=subprocess.DEVNULL,
                   env={**os.environ, "DESTDIR": destdir})


class Unit(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = Path(tempfile.mkdtemp(prefix="cles-service-"))
        cls.prefix = cls.scratch / "50%"  # '%' has a meaning in units
        install(cls.prefix)
        cls.units = cls.prefix / "lib" / "systemd" / "system"
        cls.unit = cls.units / "clesd.service"

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.scratch)

    def test_systemd_finds_no_mistake(self):
        if not shutil.which("systemd-analyze"):
            self.skipTest("systemd is not installed")
        for unit in (self.unit, self.units / "cles-gateway.service"):
            with self.subTest(unit=unit.name):
                done = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, check=False)
                self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))

    def test_the_unit_matches_the_daemon(self):
        lines = dict(re.findall(r"^(\w+)=(.*)$", self.unit.read_text(encoding="utf-8"), re.MULTILINE))
        escaped = str(self.prefix).replace("%", "%%")
        self.assertEqual(lines["ExecStart"], f'"{escaped}/bin/clesd" --config "{escaped}/etc/cles/clesd.yaml"')
        self.assertIn("-HUP $MAINPID", lines["ExecReload"])
        # Longer than the default drain.
        printed = subprocess.run([self.prefix / "bin" / "clesd", "--print-config"], capture_output=True, text=True, check=True,
                                 cwd=self.scratch)
        drain = int(re.search(r"^drain: (\d+)s", printed.stdout, re.MULTILINE)[1])
        self.assertGreater(int(lines["TimeoutStopSec"].removesuffix("s")), drain + 2)

    def test_the_unit_matches_the_gateway(self):
        unit = (self.units / "cles-gateway.service").read_text(encoding="utf-8")
        lines = dict(re.findall(r"^(\w+)=(.*)$", unit, re.MULTILINE))
        escaped = str(self.prefix).replace("%", "%%")
        self.assertEqual(lines["ExecStart"], f'"{escaped}/bin/cles-gateway" $CLES_GATEWAY_OPTIONS')
        self.assertEqual(lines["EnvironmentFile"], f"-{escaped}/etc/cles/gateway.env")

    def test_the_configuration_is_installed_once(self):
        config = self.prefix / "etc" / "cles" / "clesd.yaml"
        source = options.source / "config" / "clesd.yaml"
        self.assertEqual(config.read_bytes(), source.read_bytes())
        config.write_text("node: mine\n", encoding="utf-8")
        install(self.prefix)
        self.assertEqual(config.read_text(encoding="utf-8"), "node: mine\n")
        config.write_bytes(source.read_bytes())

    def test_a_package_for_usr(self):
        root = self.scratch / "package"
        install(Path("/usr"), str(root))
        self.assertTrue((root / "etc" / "cles" / "clesd.yaml").is_file())
        unit = (root / "usr" / "lib" / "systemd" / "system" / "clesd.service").read_text(encoding="utf-8")
        self.assertIn('\nExecStart="/usr/bin/clesd" --config "/etc/cles/clesd.yaml"\n', unit)


# The first process of its own namespaces: prepares a host on which nothing but the unit is started, and becomes systemd. /opt,
# /run, /etc and /var/lib are copies or empty.
BOOT = r"""
set -e
mount --make-rprivate /
mount -t tmpfs tmpfs /opt
mount -t tmpfs tmpfs /run
cp -a /etc /run/etc
mount --bind /run/etc /etc
mount -t tmpfs tmpfs /var/lib
mount -t proc proc /proc
mount --bind /proc/sys /proc/sys
mount -o remount,bind,ro /proc/sys # the settings of the kernel are those of the whole machine
umount -R /sys/fs/cgroup || true
mount -t cgroup2 cgroup2 /sys/fs/cgroup
ip link set lo up
"$1" --install "$2" --prefix /opt/cles >&2
systemd-sysusers /opt/cles/lib/sysusers.d/cles.conf
mkdir -p /run/units/clesd.service.d
cd /run/units
for name in sysinit basic multi-user network network-online shutdown umount final; do
    printf '[Unit]\nDefaultDependencies=no\n' >$name.target
done
cp /opt/cles/lib/systemd/system/clesd.service /opt/cles/lib/systemd/system/cles-gateway.service .
# As installed, but with times that a test can wait for.
printf '[Service]\nWatchdogSec=1s\nRestartSec=50ms\n' >clesd.service.d/fast.conf
exec env -i container=other SYSTEMD_UNIT_PATH=/run/units PATH=/usr/bin:/usr/sbin:/bin:/sbin \
    "$3" --system --log-target=null --show-status=0 --unit=multi-user.target
"""


class Running(unittest.TestCase):
    """systemd itself runs the programs, as the first process of its own namespaces."""

    @classmethod
    def setUpClass(cls):
        cls.leader = None
        if not os.path.exists(SYSTEMD) or not shutil.which("systemctl"):
            raise unittest.SkipTest("systemd is not installed")
        if os.geteuid() != 0:
            raise unittest.SkipTest("systemd needs root")
        cls.log = tempfile.TemporaryFile("w+")
        cls.leader = subprocess.Popen(
            ["unshare", "--pid", "--fork", "--kill-child=KILL", "--mount", "--uts", "--ipc", "--net", "--cgroup", "bash", "-c",
             BOOT, "boot", options.cmake, options.build, SYSTEMD], stdin=subprocess.DEVNULL, stdout=cls.log, stderr=cls.log)
        try:
            cls.first = cls.wait_for(lambda: cls.child_of(cls.leader.pid), "the first process")
            cls.wait_for(lambda: cls.inside("systemctl", "is-system-running").stdout.strip() == "running", "systemd runs")
        except AssertionError as failure:
            cls.tearDownClass()
            raise unittest.SkipTest(f"systemd does not run here: {failure}; {cls.said}") from None

    @classmethod
    def tearDownClass(cls):
        if cls.leader:
            if cls.leader.poll() is None:
                for pid in filter(None, [cls.child_of(cls.leader.pid), cls.leader.pid]):
                    os.kill(pid, signal.SIGKILL)
                cls.leader.wait()
            cls.log.seek(0)
            cls.said = cls.log.read()
            cls.log.close()

    @staticmethod
    def child_of(pid):
        with open(f"/proc/{pid}/task/{pid}/children", encoding="utf-8") as children:
            return next(map(int, children.read().split()), None)

    @classmethod
    def wait_for(cls, reached, what):
        until = time.monotonic() + PATIENCE
        while not (found := reached()):
            if time.monotonic() > until or cls.leader.poll() is not None:
                raise AssertionError(f"in vain: {what}")
            time.sleep(0.05)
        return found

    @classmethod
    def inside(cls, *command):
        return subprocess.run(["nsenter", f"--target={cls.first}", "--mount", "--pid", "--net", "--uts", "--ipc", "--cgroup",
                               *command], capture_output=True, text=True, check=False, timeout=PATIENCE)

    def run_inside(self, *command):
        done = self.inside(*command)
        self.assertEqual(done.returncode, 0, f"{command}: {done.stdout}{done.stderr}")
        return done.stdout

    def as_cles(self, *command):
        return self.run_inside("runuser", "-u", "cles", "--", *command)

    def property(self, name, unit="clesd"):
        return self.run_inside("systemctl", "show", unit, "--value", "--property", name).strip()

    def configure(self, text):
        self.run_inside("sh", "-c", f"printf '{text}' >/opt/cles/etc/cles/clesd.yaml")
        self.run_inside("systemctl", "restart", "clesd")

    def wait_for_another(self, process):
        self.wait_for(lambda: self.property("MainPID") not in (process, "0") and self.property("ActiveState") == "active",
                      "it is started again")
        return self.property("MainPID")

    def test_without_security(self):
        self.configure("node: car1\\n")
        self.assertEqual(self.property("ActiveState"), "active")
        told = self.run_inside("/opt/cles/bin/cles", "pull", "self:cles", "--at", "tcp://127.0.0.1:25370", "-o", "json")
        self.assertIn('"node":"car1"', told)
        self.assertEqual(self.run_inside("ps", "-o", "user=", "-p", self.property("MainPID")).strip(), "cles")
        self.run_inside("systemctl", "reload", "clesd")
        # It is alive as long as its loop is: longer than the limit.
        process = self.property("MainPID")
        time.sleep(1.5)
        self.assertEqual(self.property("MainPID"), process)
        self.run_inside("systemctl", "stop", "clesd")
        self.assertEqual((self.property("ActiveState"), self.property("Result")), ("inactive", "success"))

    def test_a_daemon_that_is_stuck_is_started_again(self):
        self.configure("node: car1\\n")
        process = self.property("MainPID")
        self.run_inside("kill", "-STOP", process)
        self.wait_for_another(process)

    def test_it_is_started_again_without_end(self):
        self.configure("node: car1\\n")
        process = self.property("MainPID")
        for _ in range(8):  # more often than systemd permits by default
            self.run_inside("kill", "-KILL", process)
            process = self.wait_for_another(process)

    def test_with_security(self):
        fleet = "/var/lib/cles/fleet"
        self.configure("node: car1\\n")  # which makes the folder
        self.as_cles("/opt/cles/bin/cles", "fleet", "init", fleet, "--with", "car1,operator")
        self.configure(f"security: {fleet}/car1\\n")
        asked = ("/opt/cles/bin/cles", "pull", "car1:cles", "--keys", f"{fleet}/operator", "-o", "json")
        self.assertIn('"node":"car1"', self.as_cles(*asked))
        # It can store a newer roster, which the next command brings.
        self.as_cles("/opt/cles/bin/cles", "fleet", "rights", "operator", "--may", "pull *:cles", "--keys", fleet)
        self.as_cles("/opt/cles/bin/cles", "keys", "join", f"{fleet}/roster", "--keys", f"{fleet}/operator")
        self.as_cles(*asked)
        self.wait_for(lambda: self.inside("cmp", f"{fleet}/roster", f"{fleet}/car1/roster").returncode == 0,
                      "the new roster is stored")
        # Nobody else can read the keys.
        self.assertEqual(self.run_inside("stat", "-c", "%U %a", "/var/lib/cles").strip(), "cles 700")
        self.assertNotEqual(self.inside("runuser", "-u", "nobody", "--", "ls", "/var/lib/cles").returncode, 0)

    def test_the_gateway(self):
        self.configure("node: car1\\n")
        text = "CLES_GATEWAY_OPTIONS=--name door --peer car1=tcp://127.0.0.1:25370\\n"
        self.run_inside("sh", "-c", f"printf '{text}' >/opt/cles/etc/cles/gateway.env")
        self.run_inside("systemctl", "start", "cles-gateway")
        ask = "import urllib.request; print(urllib.request.urlopen('http://127.0.0.1:25380/pull/car1/cles').read().decode())"
        told = self.wait_for(lambda: self.inside("python3", "-c", ask).stdout, "the gateway replies")
        self.assertIn('"node":"car1"', told)
        self.assertEqual(self.run_inside("ps", "-o", "user=", "-p", self.property("MainPID", "cles-gateway")).strip(), "cles")
        self.run_inside("systemctl", "stop", "cles-gateway")
        ended = [self.property(name, "cles-gateway") for name in ("ActiveState", "Result")]
        self.assertEqual(ended, ["inactive", "success"])


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cmake", required=True)
    for name in ("build", "source"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("tests", nargs="*")
    parser.parse_args(namespace=options)
    unittest.main(argv=[sys.argv[0], *options.tests])


if __name__ == "__main__":
    main()
