# SPDX-License-Identifier: BSL-1.0
"""Starting a process so that it is ended whenever its script is."""

import signal
import threading


class InOnePiece:
    """Nothing tells the script to end between the start of a process and the moment from which it would be ended too:
    that waits until then."""

    def __enter__(self):
        self.told, self.handlers = [], {}
        if threading.current_thread() is threading.main_thread():  # no other is told
            for number in (signal.SIGTERM, signal.SIGINT):
                self.handlers[number] = signal.signal(number, lambda *told: self.told.append(told))

    def __exit__(self, *_):
        for number, handler in self.handlers.items():
            signal.signal(number, handler)
        for told in self.told:
            signal.raise_signal(told[0])
