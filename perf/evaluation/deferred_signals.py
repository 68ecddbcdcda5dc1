# SPDX-License-Identifier: BSL-1.0
"""How a script starts a process, and waits for its first line, so that the signals that end the script leave no process."""

import select
import signal
import threading


class DeferredSignals:
    """SIGTERM and SIGINT take effect at the end of the block, when the started process will be ended too."""

    def __enter__(self):
        self.received, self.handlers = [], {}
        if threading.current_thread() is threading.main_thread():  # only this thread handles signals
            for number in (signal.SIGTERM, signal.SIGINT):
                self.handlers[number] = signal.signal(number, lambda number, _: self.received.append(number))

    def __exit__(self, *_):
        for number, handler in self.handlers.items():
            signal.signal(number, handler)
        for number in self.received:
            signal.raise_signal(number)


def first_line(process, seconds):
    """The first line that a process prints; empty if it prints none in that time."""
    for _ in range(max(1, round(seconds))):
        # A signal just before the call does not interrupt it, and is handled when it returns.
        if select.select([process.stdout], [], [], 1)[0]:
            return process.stdout.readline()
    return ""
