#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Completion: the candidates, and their treatment by the shells."""

import json
import os
import shutil
import socket
import subprocess
import tempfile
import unittest

import shells
from support import CLES, HAS_SECURITY, Node, ScriptedNode, cles, environment, free_port, id_of, wait_until

# The program by its name, so that the scripts find it as if it were installed.
FOLDER = os.path.dirname(os.path.abspath(shutil.which(CLES) or CLES))


GROUP = f"lo,239.255.25.37:{free_port()}"
ENVIRONMENT = environment(CLES_MULTICAST=GROUP, PATH=FOLDER + os.pathsep + os.environ["PATH"], LC_ALL="C.UTF-8")


def offered(*words, env=None):
    """The candidates for the last of these words, and their descriptions."""
    code, out, err = cles("__complete", *words, env=env or ENVIRONMENT)
    if (code, err) != (0, ""):
        raise AssertionError(f"ended with {code}: {err}")
    return dict(line.split("\t") for line in out.splitlines())


def soon(*words, env=None):
    """As `offered`, but repeated until there is a candidate: a node that has just announced itself pauses for as
    long as completion waits."""
    found = {}

    def ask():
        found.update(offered(*words, env=env))
        return found

    wait_until(ask, f"something is offered for {words}")
    return found


class WithoutNodes(unittest.TestCase):
    """Completion without requests to nodes."""

    def test_commands(self):
        found = offered("")
        for command in ("pull", "ls", "completion", "serve"):
            self.assertIn(command, found)
        self.assertEqual(list(offered("pul")), ["pull"])
        self.assertEqual(offered("pull")["pull"], "Get data once")
        self.assertEqual(list(offered("--verb")), ["--verbose"])
        self.assertEqual(list(offered("-v", "pin")), ["ping"])
        self.assertEqual(offered("fly", ""), {})

    def test_options(self):
        self.assertEqual(list(offered("pull", "--out")), ["--output"])
        self.assertIn("-t", offered("pull", "self:x", "-"))
        self.assertIn("--verbose", offered("pull", "--"))
        self.assertNotIn("--data", offered("pull", "--"))  # it is refused there
        self.assertIn("--data", offered("push", "--"))
        self.assertEqual(offered("pull", "--", "--"), {})

    def test_words_for_an_option(self):
        self.assertEqual(list(offered("pull", "-o", "")), ["table", "json", "raw"])
        self.assertEqual(list(offered("pull", "--output", "j")), ["json"])
        self.assertEqual(list(offered("pull", "--output=j")), ["--output=json"])
        self.assertEqual(set(offered("ping", "-o", "")), {"table", "json", "raw"})
        self.assertEqual(set(offered("top", "--sort", "")), {"load", "name"})
        self.assertEqual(offered("pull", "--coun")["--count"], "Number of requests")
        self.assertEqual(offered("pull", "-n", ""), {})
        self.assertEqual(set(offered("completion", "")), {"bash", "zsh", "fish"})
        self.assertEqual(set(offered("respond", "")), {"pull", "push", "delegate", "update"})
        self.assertEqual(offered("publish", ""), {})  # its node does not run yet

    def test_interfaces(self):
        found = offered("ls", "-m", "")
        self.assertEqual(found["lo"], "127.0.0.1")
        self.assertIn("off", found)
        self.assertIn("lo", offered("serve", "--multicast", "l"))

    def test_files_for_a_body(self):
        self.assertEqual(list(offered("push", "car1:x", "-d", "")), ["@", "-"])
        with tempfile.TemporaryDirectory() as folder:
            os.mkdir(os.path.join(folder, "inner"))
            for name in ("body.json", "bad name", "$(id)"):
                with open(os.path.join(folder, name), "w", encoding="utf-8"):
                    pass
            self.assertEqual(set(offered("push", "car1:x", "-d", f"@{folder}/")),
                             {f"@{folder}/body.json", f"@{folder}/inner/"})
            self.assertEqual(list(offered("push", "car1:x", "-d", f"@{folder}/b")), [f"@{folder}/body.json"])
        self.assertEqual(offered("push", "car1:x", "-d", "@/nowhere/"), {})

    @unittest.skipUnless(HAS_SECURITY, "cles was built without libsodium")
    def test_commands_in_commands(self):
        self.assertEqual(list(offered("keys", "")), ["new", "show", "join", "cert"])
        self.assertEqual(list(offered("fleet", "r")), ["rights", "remove", "rotate"])
        self.assertEqual(offered("-v", "fleet", "show")["show"], "Show the members of the fleet, and what they are permitted")
        self.assertEqual(offered("keys", "fly", ""), {})
        self.assertIn("--keys", offered("keys", "new", "--"))
        self.assertNotIn("--may", offered("fleet", "--"))
        self.assertIn("--may", offered("fleet", "add", "--m"))
        self.assertEqual(list(offered("fleet", "show", "--output=r")), ["--output=raw"])

    @unittest.skipUnless(HAS_SECURITY, "cles was built without libsodium")
    def test_members_and_files(self):
        with tempfile.TemporaryDirectory() as folder:
            fleet = os.path.join(folder, "fleet")
            self.assertEqual(cles("fleet", "init", fleet, "--with", "car1,sat1")[0], 0)
            env = {**ENVIRONMENT, "CLES_KEYS": fleet}
            self.assertEqual(offered("fleet", "rights", "", env=env), {"car1": "member 1", "sat1": "member 2"})
            self.assertEqual(list(offered("fleet", "remove", "car1", "s", env=env)), ["sat1"])
            self.assertEqual(list(offered("access", "c", env=env)), ["car1"])
            self.assertEqual(list(offered("access", "-k", fleet, "sat1", "pu")), ["pull", "push"])
            self.assertEqual(list(offered("access", f"--keys={fleet}", "sat1", "pull", "c")), ["car1:"])
            self.assertEqual(list(offered("access", "sat1", "pull", "car1:x", "--via", "s", env=env)), ["sat1"])
            self.assertEqual(offered("fleet", "rights", "", env={**ENVIRONMENT, "CLES_KEYS": "/nowhere"}), {})
            self.assertEqual(set(offered("fleet", "add", f"{fleet}/c")),
                             {f"{fleet}/car1/", f"{fleet}/car1.join"})
            self.assertEqual(list(offered("fleet", "add", "x", f"{fleet}/car1/c")), [f"{fleet}/car1/car1.pub"])
            self.assertEqual(list(offered("keys", "show", "--keys", f"{fleet}/c")), [f"{fleet}/car1/"])

    def test_nobody_is_there(self):
        env = environment(CLES_MULTICAST=f"lo,239.255.25.38:{free_port()}")
        self.assertEqual(list(offered("pull", "", env=env)), ["self:", "any:", "all:"])
        self.assertEqual(offered("pull", "car1:", env=env), {})
        self.assertEqual(offered("pull", "a", env=env), {"any:": "a node that offers the task",
                                                         "all:": "all nodes that offer the task"})

    def test_it_never_fails(self):
        for words in ((), ("",), ("pull", "--at", "nowhere", ""), ("pull", "-p", "", ""), ("pull", "--nonsense", "x"),
                      ("pull", "a:b:c"), ("pull", ":"), ("pull", "-t"), ("pull", "ä:"), ("serve", "x", "y"),
                      ("pull", "--at", "tcp://127.0.0.1:1", "self:"), ("pull", "-h", ""), ("pull", "[", "]", "{}", "")):
            offered(*words)
        offered("pull", "", env=environment(CLES_MULTICAST="nowhere0"))


class TwoNodes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.nodes = [Node("--name", name, "--multicast", GROUP) for name in ("car1", "car2")]

    @classmethod
    def tearDownClass(cls):
        codes = [node.stop() for node in cls.nodes]
        if any(codes):
            raise AssertionError(f"nodes ended with {codes}")


class Nouns(TwoNodes):
    def test_nodes(self):
        wait_until(lambda: list(offered("pull", "")) == ["car1:", "car2:", "self:", "any:", "all:"], "both nodes are heard")
        wait_until(lambda: list(offered("pull", "c")) == ["car1:", "car2:"], "both nodes are heard")
        wait_until(lambda: list(offered("ping", "c")) == ["car1", "car2"], "both nodes are heard")
        self.assertEqual(soon("pull", "car1")["car1:"], self.nodes[0].url)
        self.assertEqual(list(soon("info", "car2")), ["car2"])

    def test_nouns_of_a_node_by_verb(self):
        found = soon("pull", "car1:")
        self.assertEqual(set(found), {"car1:localization", "car1:echo/", "car1:systemTime/", "car1:cles", "car1:cles/metrics",
                                      "car1:cles/peers"})
        self.assertEqual(found["car1:echo/"], "Returns its parameters")
        self.assertEqual(list(soon("pull", "car1:loc")), ["car1:localization"])
        self.assertEqual(set(soon("push", "car1:")), {"car1:echo"})
        self.assertEqual(set(soon("delegate", "car1:")),
                         {"car1:echo", "car1:sleep/", "car1:fail", "car1:systemTime/"})
        for command in ("bind", "hz"):
            self.assertEqual(set(soon(command, "car1:")), {"car1:localization", "car1:notice"})
        self.assertEqual(set(soon("update", "car1:")), {"car1:notice"})

    def test_nouns_of_whoever_offers_them(self):
        for target in ("any", "all"):
            self.assertEqual(set(soon("delegate", f"{target}:s")), {f"{target}:sleep/", f"{target}:systemTime/"})

    def test_a_noun_is_the_first_argument_alone(self):
        self.assertEqual(offered("pull", "car1:localization", "c"), {})
        self.assertEqual(list(soon("pull", "-n", "3", "-o", "json", "car1:l")), ["car1:localization"])

    def test_several_nouns(self):
        self.assertEqual(list(soon("bind", "car1:notice", "car1:l")), ["car1:localization"])
        self.assertEqual(set(soon("sniff", "car1:")), {"car1:localization", "car1:notice"})

    def test_where_the_line_says(self):
        url = self.nodes[1].url
        for line in (("pull", "--at", url), ("pull", "-a", url)):
            self.assertIn("self:localization", soon(*line, "self:"))
            wait_until(lambda: list(offered(*line, "car")) == ["car1:", "car2:"], "car2 hears of car1")
        self.assertIn("self:localization", soon("pull", "self:", env={**ENVIRONMENT, "CLES_AT": url}))
        self.assertEqual(list(offered("pull", "--peer", f"truck={url}", "t")), ["truck:"])
        self.assertIn("car2:localization", soon("pull", "--peer", f"car2={url}", "car2:"))

    def test_urls(self):
        wait_until(lambda: self.nodes[0].url in offered("pull", "--at", ""), "car1 is heard")
        wait_until(lambda: set(offered("pull", "--peer", "")) == {"car1=", "car2="}, "both nodes are heard")

    def test_a_silent_node_is_not_waited_for(self):
        with socket.create_server(("127.0.0.1", 0)) as silent:
            url = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
            self.assertEqual(offered("pull", "--at", url, "self:"), {})

    def test_an_example_of_a_body(self):
        for name, wanted in (("lat", ["@", "-", '{"lat":0}']), ("it's", ["@", "-"]), ("$(id)", ["@", "-"])):
            told = {"PUSH": {"body": {"type": "object", "properties": {name: {"type": "number"}}, "required": [name]}}}
            with ScriptedNode(lambda line, send, told=told: send(id_of(line) + json.dumps(told))) as node:
                self.assertEqual(list(offered("push", "--at", node.url, "car1:target", "-d", "")), wanted)

    def test_what_a_shell_would_run_is_not_offered(self):
        def answer(line, send):
            send(id_of(line) + '{"node":"bad","tasks":[{"verb":"PULL","task":"a$(id)"},{"verb":"PULL","task":"b;c"},'
                 '{"verb":"PULL","task":"good","description":"one\\n\\u001b[31mtwo\\tthree"}]}')

        with ScriptedNode(answer) as node:
            found = offered("pull", "--at", node.url, "self:")
            self.assertEqual(set(found) - {"self:cles", "self:cles/metrics", "self:cles/peers"}, {"self:good"})
            self.assertEqual(found["self:good"], "one\\n\\u001b[31mtwo\\tthree")


class Scripts(unittest.TestCase):
    def test_they_are_printed(self):
        for shell in ("bash", "zsh", "fish"):
            code, out, err = cles("completion", shell)
            self.assertEqual((code, err), (0, ""))
            self.assertIn("__complete", out)
        code, out, err = cles("completion", "csh")
        self.assertEqual((code, out), (2, ""))
        code, out, err = cles("completion")
        self.assertEqual((code, out), (2, ""))

    def test_bash_reads_it(self):
        done = subprocess.run(["bash", "-n"], input=cles("completion", "bash")[1], text=True, check=False,
                              capture_output=True)
        self.assertEqual((done.returncode, done.stderr), (0, ""))


class Shells(unittest.TestCase):
    """The same lines in each shell."""

    @classmethod
    def setUpClass(cls):
        cls.node = Node("--name", "car1", "--multicast", GROUP)

    @classmethod
    def tearDownClass(cls):
        code = cls.node.stop()
        if code != 0:
            raise AssertionError(f"the node ended with {code}")

    def check(self, shell):
        try:
            def completes(typed, line):
                wait_until(lambda: shell.complete(typed) == line, f"'{typed}' becomes '{line}'")

            completes("cles pin", "cles ping ")
            completes("cles pull car", "cles pull car1:")
            completes("cles pull car1:loc", "cles pull car1:localization ")
            completes("cles pull car1:e", "cles pull car1:echo/")
            completes("cles  -v pull -n 3 car1:loc", "cles  -v pull -n 3 car1:localization ")
            completes("cles pull --at " + self.node.url + " self:loc",
                      "cles pull --at " + self.node.url + " self:localization ")
            completes("cles pull --outp", "cles pull --output ")
            if HAS_SECURITY:
                completes("cles fleet rot", "cles fleet rotate ")
            completes("cles pull --output=j", "cles pull --output=json ")
            completes("cles pull --peer truck=" + self.node.url + " tr",
                      "cles pull --peer truck=" + self.node.url + " truck:")
            self.assertEqual(shell.complete("cles pull nothing:x"), "cles pull nothing:x")
            shown = []
            wait_until(lambda: shown.append(shell.list("cles delegate car1:")) or "fail" in shown[-1], "a list")
            self.assertIn("echo", shown[-1])
            self.assertIn("sleep/", shown[-1])
            self.assertNotIn("localization", shown[-1])
        finally:
            shell.close()

    def test_bash(self):
        self.check(shells.bash(ENVIRONMENT, "source <(cles completion bash)"))

    def test_bash_with_other_word_breaks(self):
        self.check(shells.bash(ENVIRONMENT, "COMP_WORDBREAKS=${COMP_WORDBREAKS//[:=@]/}",
                               "source <(cles completion bash)"))

    def test_bash_by_another_name(self):
        shell = shells.bash(ENVIRONMENT, "source <(cles completion bash)", "alias c=cles", "complete -F _cles c")
        try:
            wait_until(lambda: shell.complete("c pull car1:loc") == "c pull car1:localization ", "a noun")
        finally:
            shell.close()

    @unittest.skipUnless(shutil.which("zsh"), "zsh is not installed")
    def test_zsh(self):
        self.check(shells.zsh(ENVIRONMENT, "source <(cles completion zsh)"))

    @unittest.skipUnless(shutil.which("zsh"), "zsh is not installed")
    def test_zsh_finds_it_in_a_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, "_cles"), "w", encoding="utf-8") as script:
                script.write(cles("completion", "zsh")[1])
            shell = shells.zsh(ENVIRONMENT, f"fpath=({folder} $fpath)", "compinit -u -D")
            try:
                wait_until(lambda: shell.complete("cles pull car1:loc") == "cles pull car1:localization ", "a noun")
            finally:
                shell.close()

    @unittest.skipUnless(shutil.which("fish"), "fish is not installed")
    def test_fish(self):
        def completions(typed):
            found = {}

            def ask():
                done = subprocess.run(
                    ["fish", "--no-config", "-c", "cles completion fish | source; complete -C $argv[1]", typed],
                    env=ENVIRONMENT, capture_output=True, text=True, check=False)
                self.assertEqual((done.returncode, done.stderr), (0, ""))
                found.update((line + "\t").split("\t")[:2] for line in done.stdout.splitlines())
                return found

            wait_until(ask, f"fish completes '{typed}'")
            return found

        self.assertEqual(completions("cles pin"), {"ping": "Measure the round trip time of a small PULL"})
        self.assertEqual(set(completions("cles pull car")), {"car1:"})
        self.assertEqual(set(completions("cles pull car1:loc")), {"car1:localization"})
        self.assertEqual(completions("cles pull car1:e")["car1:echo/"], "Returns its parameters")
        self.assertEqual(set(completions("cles delegate car1:")),
                         {"car1:echo", "car1:sleep/", "car1:fail", "car1:systemTime/"})
        self.assertEqual(set(completions("cles pull --output=j")), {"--output=json"})
        self.assertIn("self:localization", completions("cles pull --at " + self.node.url + " self:"))


if __name__ == "__main__":
    unittest.main()
