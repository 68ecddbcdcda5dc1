#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""clesd --check, --print-config, and the sources of the configuration."""

import json
import os
import shutil
import signal
import socket
import subprocess
import time
import unittest

from daemon import CLESD, DEFAULTS, FAULTY, PLUGINS, STUBBORN, Daemon, Folder, clean_environment, clesd
from support import PATIENCE, finish, free_port, read_line, wait_until

SLOWNESS = max(PATIENCE / 30, 1)  # of sanitizers


def children_of(pid):
    with open(f"/proc/{pid}/task/{pid}/children", encoding="utf-8") as children:
        return children.read().split()


def has_ended(pid):
    """Whether it has ended, even if it has not been waited for."""
    try:
        with open(f"/proc/{pid}/stat", encoding="utf-8") as stat:
            return stat.read().rpartition(")")[2].split()[0] in "ZX"
    except FileNotFoundError:
        return True


ROOT = os.path.join(os.path.dirname(__file__), "..", "..", "..")


class Check(unittest.TestCase):
    def test_a_valid_configuration(self):
        with Folder() as f:
            file = f.write("node: sat1\nlisten: tcp://127.0.0.1:0\n")
            self.assertEqual(clesd("--config", file, "--check"), (0, f"{file}: can be used\n", ""))

    def test_an_error_names_file_line_and_key(self):
        with Folder() as f:
            file = f.write("node: sat1\nmulticast:\n  prot: 1\n")
            code, out, err = clesd("--config", file, "--check")
            self.assertEqual((code, out), (2, ""))
            self.assertEqual(err, f"clesd: {file}:3: multicast.prot: unknown key; "
                                  "known here: group, interface, port, required\n")

    def test_an_error_prevents_the_start(self):
        with Folder() as f:
            file = f.write("workers: none\n")
            code, out, err = clesd("--config", file)
            self.assertEqual((code, out), (2, ""))
            self.assertEqual(err, f"clesd: {file}:1: workers: 'none' is not a number from 1 to 1024\n")

    def test_a_missing_plugin(self):
        with Folder() as f:
            missing = f.file("missing.so")
            file = f.write(f"plugins:\n  - path: {missing}\n")
            code, out, err = clesd("--config", file, "--check")
            self.assertEqual((code, out), (2, ""))
            self.assertEqual(err, f"clesd: {file}:2: plugins[0].path: {missing}: there is no such file\n")

            file = f.write(f"plugins:\n  - path: {missing}\n    required: false\n")
            code, out, err = clesd("--config", file, "--check")
            self.assertEqual((code, out), (0, f"{file}: can be used\n"))
            self.assertIn("is not required", err)

    def test_plugin_paths_are_relative_to_the_file(self):
        with Folder() as f:
            f.write("", "plugins/mine.so")
            shutil.copy(STUBBORN, f.file("plugins/mine.so"))
            file = f.write("plugins: [plugins/mine.so]\n")
            self.assertEqual(clesd("--config", file, "--check", cwd="/")[0], 0)
            file = f.write("plugin_path: plugins\nplugins: [mine.so]\n")
            self.assertEqual(clesd("--config", file, "--check", cwd="/")[0], 0)
            file = f.write("plugins: [mine.so]\n")
            self.assertEqual(clesd("--config", file, "--check", cwd="/")[0], 2)

    def refused(self, text, line, key, words, within=1.0):
        """A check and the daemon refuse it with the same message."""
        with Folder() as f:
            file = f.write(text)
            begun = time.monotonic()
            code, out, err = clesd("--config", file, "--check")
            took = time.monotonic() - begun
            self.assertEqual((code, out), (2, ""), err)
            self.assertTrue(err.startswith(f"clesd: {file}:{line}: {key}: "), err)
            self.assertIn(words, err)
            self.assertEqual(err.count("\n"), 1, err)
            self.assertLess(took, within * SLOWNESS)
            self.assertEqual(clesd("--config", file, "--node", "a", "--listen", "tcp://127.0.0.1:0"), (2, "", err))

    def test_unusable_plugins(self):
        for name, words in (("crashes_in_entry", "its entry point ends the process by signal 11"),
                            ("exits_when_loaded", "ends the process"),
                            ("wrong_major", "this host has 1.7"),
                            ("newer_minor", "this host has 1.7"),
                            ("no_entry", "it is not a plugin"),
                            ("undefined_symbol", "cannot be loaded"),
                            ("crashes_in_check", "its settings check ends the process by signal 6")):
            with self.subTest(name):
                self.refused(f"node: a\nplugins:\n  - path: {FAULTY}/{name}.so\n", 3, "plugins[0].path", words)

    def test_a_plugin_for_another_machine(self):
        with Folder() as f, open(STUBBORN, "rb") as library:
            image = bytearray(library.read())
            image[18] = 243  # e_machine: RISC-V
            path = f.file("mine.so")
            with open(path, "wb") as out:
                out.write(image)
            self.refused(f"plugins: [{path}]\n", 1, "plugins[0].path", "it cannot be loaded: ")

    def test_signal_settings_of_the_parent_are_reset(self):
        """Some supervisors pass on ignored and blocked signals."""
        def careless():
            signal.signal(signal.SIGCHLD, signal.SIG_IGN)
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGCHLD, signal.SIGALRM})

        with Folder() as f:
            file = f.write(f"node: a\nlisten: tcp://127.0.0.1:0\nmulticast: off\nplugins: [{STUBBORN}]\n")
            done = subprocess.run([CLESD, "--config", file, "--check"], env=clean_environment(), preexec_fn=careless,
                                  capture_output=True, text=True, timeout=PATIENCE, check=False)
            self.assertEqual((done.returncode, done.stdout, done.stderr), (0, f"{file}: can be used\n", ""))
            process = subprocess.Popen([CLESD, "--config", file], env=clean_environment(), preexec_fn=careless,
                                       stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            self.assertIn("listening", read_line(process))
            process.send_signal(signal.SIGTERM)
            self.assertEqual(finish(process)[0], 0)

    def test_a_check_does_not_start_plugins(self):
        with Folder() as f:
            for name in ("crashes_in_start", "hangs_in_start", "refuses"):
                file = f.write(f"plugins:\n  - path: {FAULTY}/{name}.so\n")
                self.assertEqual(clesd("--config", file, "--check"), (0, f"{file}: can be used\n", ""))

    def test_a_check_of_a_plugin_that_hangs_while_loading_can_be_stopped(self):
        for name in ("hangs_when_loaded", "hangs_in_entry"):
            with Folder() as f:
                file = f.write(f"plugins:\n  - path: {FAULTY}/{name}.so\n")
                process = subprocess.Popen([CLESD, "--config", file], env=clean_environment(),
                                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                try:
                    wait_until(lambda: children_of(process.pid), "it tries the plugin")
                    child = children_of(process.pid)[0]
                    process.send_signal(signal.SIGTERM)
                    self.assertEqual(process.wait(timeout=5), -signal.SIGTERM)
                    wait_until(lambda: has_ended(child), "the child has gone")
                finally:
                    process.kill()
                    process.wait()

    def test_a_plugin_that_hangs_while_loading_is_given_up(self):
        self.refused(f"plugins: [{FAULTY}/hangs_when_loaded.so]\n", 1, "plugins[0].path", "does not end", within=15)

    def test_plugins_check_settings_and_the_message_names_the_key(self):
        plugin = f"plugins:\n  - path: {FAULTY}/sound.so\n    required: true\n    config:\n"
        self.refused(plugin + "      number: many\n", 5, "plugins[0].config.number", "expected")
        self.refused(plugin + "      refuse: no\n      number: 1001\n", 6, "plugins[0].config.number", "1000 at most")
        self.refused(plugin + "      numer: 7\n", 5, "plugins[0].config.numer", "it has no setting 'numer'")
        self.refused(f"plugins:\n  - path: {STUBBORN}\n    config: {{a: 1}}\n", 3, "plugins[0].config.a",
                     "it has no settings")
        # The installed plugins.
        for name, key, value, words in (("digits", "files", "[]", "at least one"),
                                        ("digits", "files", "[/nonexistent]", "/nonexistent: it cannot be read"),
                                        ("fmv", "streams", "65", "1 to 64"),
                                        ("fmv", "idle_s", "0", "1 to 3600"),
                                        ("primes", "limit", "1000000000001", "at most"),
                                        ("sgd", "per_class", "0", "1 to 10000000"),
                                        ("sgd", "per_class", "10000001", "1 to 10000000"),
                                        ("sgd", "separation", "far", "expected"),
                                        ("strike", "weapons", "1001", "1000 at most"),
                                        ("strike", "speed", "0", "more than 0"),
                                        ("strike", "scans", "31", "30 at most"),
                                        ("strike", "range_m", "0", "more than 0"),
                                        ("system", "interval_ms", "9", "interval_ms")):
            with self.subTest(f"{name} {key}: {value}"):
                self.refused(f"node: a\nplugins:\n  - path: {PLUGINS}/libcles-{name}.so\n    config:\n"
                             f"      {key}: {value}\n", 5, f"plugins[0].config.{key}", words)
        # The longest part of the key that the file contains.
        self.refused(f"plugins:\n  - path: {FAULTY}/refuses_setting.so\n    config:\n      cameras:\n"
                     "        - rate: 30\n        - name: left\n          rate: 90\n", 7,
                     "plugins[0].config.cameras[1].rate", "60 at most")

    def test_an_invalid_file(self):
        for text, line in (("%%%\n", 1), ("# a comment\n%%%\n", 2), ("%%%\n---\nnode: a\n", 1), ("~\n", 1),
                           ("hello\n", 1), ("&a\n", 1), ("\ufeff%%%\n", 1), ("node: a\n...\n%%%\n", 3)):
            with self.subTest(text), Folder() as f:
                file = f.write(text)
                for more in (["--check"], []):
                    code, out, err = clesd("--config", file, *more)
                    self.assertEqual((code, out), (2, ""), err)
                    self.assertTrue(err.startswith(f"clesd: {file}:{line}: "), err)
        for text in ("", "# nothing\n", "---\n# nothing\n...\n", "%YAML 1.2\n---\nnode: a\n", "\ufeff# nothing\n"):
            with self.subTest(text), Folder() as f:
                self.assertEqual(clesd("--config", f.write(text), "--check")[0], 0)

    def test_the_installed_configuration_is_valid_and_contains_the_defaults(self):
        file = os.path.join(ROOT, "config", "clesd.yaml")
        self.assertEqual(clesd("--config", file, "--check")[0], 0)
        with Folder() as f:
            said = clesd("--config", file, "--print-config", "--node", "a")[1]
            unsaid = clesd("--config", f.write("# nothing\n"), "--print-config", "--node", "a")[1]

        def values(text):
            return [line.split("  # ")[0] for line in text.splitlines() if not line.startswith("#")]
        self.assertEqual(values(said), values(unsaid))


class Start(unittest.TestCase):
    """A check tries what the start does first."""

    def test_an_address_that_another_program_has(self):
        with Folder() as f, socket.create_server(("127.0.0.1", 0)) as taken:
            url = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
            file = f.write(f"node: a\nlisten: {url}\nmulticast: off\n")
            refused = clesd("--config", file)
            self.assertEqual(refused, (1, "", f"clesd: cannot listen on '{url}': Address already in use\n"))
            self.assertEqual(clesd("--config", file, "--check"), refused)

    def test_a_group_that_cannot_be_joined(self):
        with Folder() as f:
            file = f.write("node: a\nlisten: tcp://127.0.0.1:0\nmulticast: {interface: nowhere0, required: true}\n"
                           "insecure: true\n")
            code, out, err = clesd("--config", file, "--check")
            self.assertEqual((code, out), (1, ""))
            self.assertIn("on 'nowhere0': No such device", err)
            self.assertEqual(clesd("--config", file), (code, out, err))
            file = f.write("node: a\nlisten: tcp://127.0.0.1:0\nmulticast: {interface: nowhere0, required: false}\n"
                           "insecure: true\n")
            code, out, err = clesd("--config", file, "--check")
            self.assertEqual((code, out), (0, f"{file}: can be used\n"))
            self.assertRegex(err, r"^clesd: warning: no multicast: cannot join .* on 'nowhere0': No such device\n$")

    def test_the_daemon_itself_may_run_already(self):
        with Daemon() as d, socket.create_server(("127.0.0.1", 0)) as taken:
            urls = [d.url, f"unix://{d.file('socket')}"]
            file = d.write(DEFAULTS.replace("tcp://127.0.0.1:0", f"[{', '.join(urls)}]"), "running.yaml")
            self.assertEqual(clesd("--config", file, "--check"), (0, f"{file}: can be used; the node sat1 listens already\n", ""))
            other = d.write(DEFAULTS.replace("sat1", "sat2").replace("tcp://127.0.0.1:0", d.url), "other.yaml")
            self.assertEqual(clesd("--config", other, "--check")[0], 1)
            urls.append(f"tcp://127.0.0.1:{taken.getsockname()[1]}")
            file = d.write(DEFAULTS.replace("tcp://127.0.0.1:0", f"[{', '.join(urls)}]"), "running.yaml")
            self.assertEqual(clesd("--config", file, "--check")[0], 1)
            self.assertEqual(json.loads(d.ask("PULL self:cles"))["node"], "sat1")

    def test_other_nodes_do_not_notice(self):
        group = f"multicast: {{interface: lo, port: {free_port()}}}"
        base = DEFAULTS.replace("multicast: off", group)
        with Daemon(base=base) as d:
            for name in ("sat1", "sat2"):
                file = d.write(base.replace("sat1", name), f"{name}-too.yaml")
                self.assertEqual(clesd("--config", file, "--check"), (0, f"{file}: can be used\n", ""))
            self.assertEqual(json.loads(d.ask("PULL self:cles/peers"))["peers"], [])
            self.assertEqual(json.loads(d.ask("PULL self:cles/metrics"))["group_received"], 0)


class Sources(unittest.TestCase):
    def print_config(self, *arguments, env=None, cwd=None):
        code, out, err = clesd("--print-config", *arguments, env=env, cwd=cwd)
        self.assertEqual((code, err), (0, ""))
        return out

    def test_printed_configuration_reads_back(self):
        with Folder() as f:
            file = f.write("node: sat1\nplugins:\n  - path: /x.so\n    config: {a: [1, 'b']}\n    required: false\n")
            first = self.print_config("--config", file)
            again = f.write(first, "again.yaml")
            second = self.print_config("--config", again)
            without_origins = [[line.split("  # ")[0] for line in text.splitlines()[1:]] for text in (first, second)]
            self.assertEqual(*without_origins)

    def test_flags_override_the_environment_and_the_file(self):
        with Folder() as f:
            file = f.write("node: from_file\nseeds: [tcp://127.0.0.1:1]\n")
            self.assertIn(f'node: "from_file"  # {file}:1\n', self.print_config("--config", file))
            env = clean_environment(CLES_NODE="from_environment", CLES_SEEDS="tcp://127.0.0.1:2,tcp://127.0.0.1:3",
                                    CLES_LISTEN="tcp://127.0.0.1:4", CLES_LOG="debug,json", CLES_CONFIG=file)
            out = self.print_config(env=env)
            self.assertIn('node: "from_environment"  # CLES_NODE\n', out)
            self.assertIn('seeds: ["tcp://127.0.0.1:2", "tcp://127.0.0.1:3"]  # CLES_SEEDS\n', out)
            self.assertIn('listen: ["tcp://127.0.0.1:4"]  # CLES_LISTEN\n', out)
            self.assertIn("log: {level: debug, format: json}  # CLES_LOG\n", out)
            out = self.print_config("--node", "from_flag", "--seed", "tcp://127.0.0.1:5", env=env)
            self.assertIn('node: "from_flag"  # --node\n', out)
            self.assertIn('seeds: ["tcp://127.0.0.1:5"]  # --seed\n', out)

    def test_an_error_in_the_environment_names_the_variable(self):
        code, _, err = clesd("--check", env=clean_environment(CLES_LISTEN="there"))
        self.assertEqual(code, 2)
        self.assertTrue(err.startswith("clesd: CLES_LISTEN: "), err)

    def test_default_locations(self):
        with Folder() as f:
            f.write("node: in_home\n", "home/.config/cles/clesd.yaml")
            f.write("node: in_xdg\n", "xdg/cles/clesd.yaml")
            f.write("node: in_folder\n", "here/clesd.yaml")
            f.write("", "empty/nothing")
            homeless = clean_environment(HOME=f.file("home"))
            del homeless["XDG_CONFIG_HOME"]
            self.assertIn('"in_home"', self.print_config(env=homeless, cwd=f.file("empty")))
            with_xdg = clean_environment(HOME=f.file("home"), XDG_CONFIG_HOME=f.file("xdg"))
            self.assertIn('"in_xdg"', self.print_config(env=with_xdg, cwd=f.file("empty")))
            self.assertIn('"in_folder"', self.print_config(env=with_xdg, cwd=f.file("here")))

    def test_usage(self):
        code, out, err = clesd("--verbose")
        self.assertEqual((code, out), (2, ""))
        self.assertIn("clesd --help", err)
        self.assertEqual(clesd("--help")[0], 0)
        self.assertRegex(clesd("--version")[1], r"^clesd \d+\.\d+\.\d+\n$")


if __name__ == "__main__":
    unittest.main()
