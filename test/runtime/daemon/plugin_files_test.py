#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Which files clesd loads as plugins: folders, owners, modes and SHA-256."""

import hashlib
import os
import re
import shutil
import signal
import subprocess
import unittest

from daemon import CLESD, DEFAULTS, FAULTY, PLUGINS, STUBBORN, Daemon, clean_environment, clesd
from secured import Fleet, Node
from support import PATIENCE, wait_until

IS_ROOT = os.geteuid() == 0


def sha256_of(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


class PluginFiles(unittest.TestCase):
    """Each test has a fleet, and a plugin in the only folder of `plugin_path`."""

    def setUp(self):
        self.fleet = Fleet("car1")
        self.addCleanup(self.fleet.__exit__)
        self.folder = self.fleet.file("lib/cles")
        os.makedirs(self.folder)
        for folder in (self.fleet.file("lib"), self.folder):
            os.chmod(folder, 0o755)
        self.plugin = self.copy(STUBBORN, self.folder, "mine.so")

    def copy(self, plugin, folder, name):
        path = os.path.join(folder, name)
        shutil.copyfile(plugin, path + ".new")
        os.chmod(path + ".new", 0o755)
        os.rename(path + ".new", path)  # as an installer does it
        return path

    def write(self, plugin="mine.so", *more, security=True, folder=None):
        lines = [f"security: {self.fleet.keys('car1')}" if security else "node: car1", f"listen: 'unix://{self.fleet.file('car1.sock')}'",
                 "multicast: off", f"plugin_path: {folder or self.folder}", "plugins:", f"  - path: {plugin}",
                 *(f"    {line}" for line in more)]
        return self.fleet.write("\n".join(lines) + "\n")

    def accepted(self, *arguments, program=CLESD, **options):
        file = self.write(*arguments, **options)
        done = subprocess.run([program, "--config", file, "--check"], capture_output=True, text=True,
                              env=clean_environment(), timeout=PATIENCE, check=False)
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, f"{file}: can be used\n", ""))

    def refused(self, why, *arguments, key="path", line=6, shown=None, **options):
        """A check and a start refuse it with the same line."""
        file = self.write(*arguments, **options)
        shown = shown or (arguments[0] if arguments else "mine.so")
        expected = f"clesd: {file}:{line}: plugins[0].{key}: {shown}: {why}\n"
        for more in (("--check",), ()):
            self.assertEqual(clesd("--config", file, *more, cwd=self.fleet.path), (2, "", expected))

    def mended_by(self, why):
        """After the command that ends the message, the plugin is accepted."""
        self.refused(why)
        subprocess.run(why.rsplit(": ", 1)[1], shell=True, check=True)
        self.accepted()

    # -- folders ---------------------------------------------------------------------------------------------------

    def test_an_allowed_folder(self):
        self.accepted("mine.so")
        self.accepted(self.plugin)
        self.accepted("lib/cles/mine.so")
        with self.subTest("a folder in it"):
            os.mkdir(os.path.join(self.folder, "more"), 0o755)
            self.accepted(self.copy(STUBBORN, os.path.join(self.folder, "more"), "mine.so"))
        with self.subTest("links"):
            os.symlink("mine.so", os.path.join(self.folder, "mine.so.1"))
            self.accepted("mine.so.1")
            os.symlink(self.folder, self.fleet.file("linked"))
            self.accepted("mine.so", folder=self.fleet.file("linked"))
            self.accepted(self.fleet.file("linked/mine.so"))

    def test_the_folder_of_the_plugins_of_cles(self):
        os.makedirs(self.fleet.file("bin"), 0o755)
        os.makedirs(self.fleet.file("plugins"), 0o755)
        os.chmod(self.fleet.file("plugins"), 0o755)
        shutil.copy(CLESD, self.fleet.file("bin/clesd"))
        self.copy(os.path.join(PLUGINS, "libcles-primes.so"), self.fleet.file("plugins"), "libcles-primes.so")
        self.accepted("libcles-primes.so", program=self.fleet.file("bin/clesd"))

    def test_other_folders(self):
        os.mkdir(self.fleet.file("lib/cles2"), 0o755)
        other = self.copy(STUBBORN, self.fleet.file("lib/cles2"), "other.so")
        why = ("with 'security', plugins are loaded only from the folders in 'plugin_path' and those that are part of "
               f"CLES: add {os.path.dirname(other)} to 'plugin_path', or move it")
        self.refused(why, other)
        self.refused(why, "lib/cles/../cles2/other.so", shown=other)
        os.symlink(other, os.path.join(self.folder, "linked.so"))
        self.refused(why, "linked.so")  # what counts is where the file is
        self.accepted(other, folder=f"[{self.folder}, {os.path.dirname(other)}]")
        self.accepted(other, security=False)

    # -- owners and modes ------------------------------------------------------------------------------------------

    def test_others_can_change_it(self):
        for path in (self.plugin, self.folder, self.fleet.file("lib")):
            with self.subTest(path):
                os.chmod(path, 0o757)
                self.accepted(security=False)
                self.mended_by(f"{path} can be changed by other users: chmod go-w {path}")

    def test_a_folder_in_which_only_owners_replace_files(self):
        os.chmod(self.folder, 0o1777)
        self.accepted()

    @unittest.skipUnless(IS_ROOT, "needs another user")
    def test_other_users_and_groups(self):
        other = 54321
        os.chown(self.plugin, other, 0)
        self.mended_by(f"{self.plugin} belongs to the user {other}, not to root: chown root {self.plugin}")
        os.chown(self.folder, other, 0)
        self.refused(f"{self.folder} belongs to the user {other}, who can replace what is in it: use another folder")
        os.chown(self.folder, 0, other)
        os.chmod(self.folder, 0o775)
        self.mended_by(f"{self.folder} can be changed by other users: chmod go-w {self.folder}")

    def test_what_is_not_a_file(self):
        os.mkfifo(os.path.join(self.folder, "fifo.so"))
        self.refused(f"{self.folder}/fifo.so is not a regular file", "fifo.so")
        self.refused(f"{self.folder} is not a regular file", self.folder)

    def test_one_that_is_not_required(self):
        os.chmod(self.plugin, 0o757)
        words = f"mine.so: {self.plugin} can be changed by other users: chmod go-w {self.plugin}"
        file = self.write("mine.so", "required: false")
        code, out, err = clesd("--config", file, "--check")
        self.assertEqual((code, out), (0, f"{file}: can be used\n"))
        self.assertEqual(err, f"clesd: {file}:6: plugins[0].path: {words} (it is not required)\n")
        more = f"plugin_path: {self.folder}\nplugins: [{{path: mine.so, required: false}}]\n"
        with Node(self.fleet, "car1", more) as node:
            self.assertIn(f"{words} (continuing without it)", "".join(node.messages()))

    # -- SHA-256 ---------------------------------------------------------------------------------------------------

    def wrong_pin(self):
        return (f"the SHA-256 of {self.plugin} is {sha256_of(self.plugin)}, not the configured one: if you know why the "
                "file has changed, set sha256 to this")

    def test_the_configured_content(self):
        pin = sha256_of(self.plugin)
        self.accepted("mine.so", f"sha256: {pin}")
        self.accepted("mine.so", f"sha256: {pin.upper()}")
        self.accepted("mine.so", f"sha256: '{pin}'", security=False)
        with open(self.plugin, "ab") as file:
            file.write(b"\0")
        self.refused(self.wrong_pin(), "mine.so", f"sha256: {pin}", key="sha256", line=7)
        self.accepted("mine.so", f"sha256: {sha256_of(self.plugin)}")
        self.accepted("mine.so")

    def test_without_security(self):
        """Nobody else may be able to change the file, but it may be in any folder."""
        pin = f"sha256: {sha256_of(self.plugin)}"
        self.accepted(self.plugin, pin, security=False, folder="/nowhere")
        self.refused(self.wrong_pin(), "mine.so", f"sha256: {'0' * 64}", key="sha256", line=7, security=False)
        os.chmod(self.folder, 0o757)
        self.accepted("mine.so", security=False)
        self.refused(f"{self.folder} can be changed by other users: chmod go-w {self.folder}", "mine.so", pin,
                     security=False)

    def test_values_that_are_no_sha256(self):
        digits = sha256_of(self.plugin)
        for value, why in (("''", "'' is not a SHA-256"), ("0", "'0' is not a SHA-256"), (digits[1:], "is not a SHA-256"),
                           (digits + "0", "is not a SHA-256"), ("g" + digits[1:], "is not a SHA-256"),
                           (f"sha256:{digits}", "is not a SHA-256"), ("", "has no value"),
                           (f"[{digits}]", "has to be a single value"), ("{a: b}", "has to be a single value")):
            with self.subTest(value):
                file = self.write("mine.so", f"sha256: {value}")
                code, out, err = clesd("--config", file, "--check")
                self.assertEqual((code, out), (2, ""))
                self.assertTrue(err.startswith(f"clesd: {file}:7: plugins[0].sha256: "), err)
                self.assertIn(why, err)

    def test_a_new_file_and_its_pin_count_at_the_next_start(self):
        def configured(pin):
            return f"plugin_path: {self.folder}\nplugins: [{{path: mine.so, sha256: {pin}}}]\n"

        with Daemon(configured(sha256_of(self.plugin)), base=DEFAULTS.replace("sat1", "car1")) as daemon:
            self.copy(f"{FAULTY}/sound.so", self.folder, "mine.so")
            daemon.send_signal(signal.SIGHUP)  # the old pin is still configured
            wait_until(lambda: daemon.log().count("reloaded") == 1, "it reloads")
            self.assertNotIn("take effect", daemon.log())
            daemon.write(DEFAULTS.replace("sat1", "car1") + configured(sha256_of(self.plugin)))
            daemon.send_signal(signal.SIGHUP)
            daemon.wait_for_entry("other changes of the configuration take effect at the next start")
            self.assertEqual(daemon.ask("PULL self:quick"), '{"value":42}')
            self.assertIn("no_task", daemon.ask("PULL self:number"))
            text = daemon.read("clesd.yaml")
            self.assertEqual(daemon.stop()[0], 0)
        with Daemon("", base=text) as daemon:
            self.assertEqual(daemon.ask("PULL self:number"), '{"value":42}')
            self.assertIn("no_task", daemon.ask("PULL self:quick"))

    # -- loading ---------------------------------------------------------------------------------------------------

    def test_messages_name_the_file(self):
        path = self.copy(f"{FAULTY}/undefined_symbol.so", self.folder, "lacks.so")
        file = self.write("lacks.so")
        code, _, err = clesd("--config", file, "--check")
        self.assertEqual(code, 2)
        self.assertIn(f"lacks.so: it cannot be loaded: {path}: undefined symbol", err)
        self.assertNotIn("/proc", err)

    def test_a_library_that_is_missing_beside_it(self):
        with open(self.plugin, "rb") as file:
            image = file.read()
        self.assertIn(b"libc.so.6\0", image)
        with open(self.plugin, "wb") as file:
            file.write(image.replace(b"libc.so.6\0", b"libC.so.6\0"))
        missing = "libC.so.6: cannot open shared object file: No such file or directory"
        self.refused(f"it cannot be loaded: {missing} (with 'security' or 'sha256', $ORIGIN in a plugin is not its folder)")
        self.refused(f"it cannot be loaded: {missing}", security=False)

    def test_without_proc(self):
        enter = ["unshare", "--mount"] if IS_ROOT else ["unshare", "--user", "--map-current-user", "--keep-caps", "--mount"]
        hide = [*enter, "sh", "-c", 'mount -t tmpfs none /proc && exec "$@"', "hide"]
        if subprocess.run([*hide, "true"], capture_output=True, check=False).returncode != 0:
            self.skipTest("this system does not permit mount namespaces")
        if subprocess.run([*hide, CLESD, "--version"], capture_output=True, check=False).returncode != 0:
            self.skipTest("a sanitizer needs /proc")

        def check(file):
            done = subprocess.run([*hide, CLESD, "--config", file, "--check"], capture_output=True, text=True,
                                  env=clean_environment(), timeout=PATIENCE, check=False)
            said = re.sub(r"^==\d+==WARNING: .*\n", "", done.stderr, flags=re.MULTILINE)  # by a sanitizer, which misses it
            return done.returncode, done.stdout, said

        file = self.write()
        self.assertEqual(check(file), (2, "", f"clesd: {file}:6: plugins[0].path: mine.so: the file that was checked cannot "
                                              "be loaded, because /proc is not mounted: mount it (mount -t proc proc "
                                              "/proc)\n"))
        self.assertEqual(check(self.write(security=False)), (0, f"{file}: can be used\n", ""))


if __name__ == "__main__":
    unittest.main()
