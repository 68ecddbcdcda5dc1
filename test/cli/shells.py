# SPDX-License-Identifier: BSL-1.0
"""Interactive shells on a separate terminal, so that completion works as for a user who types."""

import os
import pty
import re
import select
import signal
import time

from support import PATIENCE

# A key that shows the current line, so that a test sees the result of completion.
SHOW = "\x07"
SHOWN = re.compile(rb"<<<(.*?)>>>")


class Shell:
    def __init__(self, arguments, env, setup):
        """Starts the shell, and sends it the lines of `setup`."""
        self.pid, self.terminal = pty.fork()
        if self.pid == 0:
            os.execvpe(arguments[0], arguments, env)
        self.seen = b""
        for line in setup:
            self.send(line + "\n")
        # The two parts are joined only if it has been run.
        self.send("echo rea''dy\n")
        self.wait_for(re.compile(rb"ready\r\n"))

    def send(self, text):
        os.write(self.terminal, text.encode())

    def wait_for(self, pattern):
        end = time.monotonic() + PATIENCE
        while not (found := pattern.search(self.seen)):
            ready, _, _ = select.select([self.terminal], [], [], max(0, end - time.monotonic()))
            try:
                data = os.read(self.terminal, 65536) if ready else b""
            except OSError:
                data = b""
            if not data:
                raise AssertionError(f"waited in vain for {pattern.pattern!r}; the terminal showed {self.seen!r}")
            self.seen += data
        self.seen = self.seen[found.end():]
        return found

    def complete(self, typed):
        """The line after TAB."""
        self.send(typed + "\t")
        self.send(SHOW)
        line = self.wait_for(SHOWN)[1].decode()
        self.send("\x15")  # kills the line
        return line

    def list(self, typed):
        """What several TABs show below the line.

        Nodes announce themselves at most every 100 ms, and a completion waits 80 ms. So a TAB directly after a
        successful one may find no node. bash lists from the second TAB on: here that one or the third finds it.
        """
        self.send(typed + "\t\t\t")
        self.send(SHOW)
        end = time.monotonic() + PATIENCE
        while not SHOWN.search(self.seen) and time.monotonic() < end:
            if select.select([self.terminal], [], [], 0.1)[0]:
                self.seen += os.read(self.terminal, 65536)
        shown = SHOWN.split(self.seen)[0].decode()
        self.wait_for(SHOWN)
        self.send("\x15")
        return shown

    def close(self):
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        os.close(self.terminal)


def bash(env, *setup):
    return Shell(["bash", "--noprofile", "--norc", "-i"], env,
                 ["set +o history", "bind 'set enable-bracketed-paste off'",
                  'bind -x \'"\\C-g": printf "<<<%s>>>" "$READLINE_LINE"\'', *setup])


def zsh(env, *setup):
    return Shell(["zsh", "-f", "-i"], env,
                 ["unsetopt beep", "show() { print -n -- \"<<<$BUFFER>>>\" }", "zle -N show", "bindkey '^G' show",
                  "bindkey '^U' kill-whole-line", "autoload -U compinit", "compinit -u -D", *setup])
