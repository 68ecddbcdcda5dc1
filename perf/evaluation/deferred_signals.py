# SPDX-License-Identifier: BSL-1.0
"""Defers the signals that end a script while it starts a process."""

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
