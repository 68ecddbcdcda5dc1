#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The localization exchange by hand and by CLES (perf/effort): both programs pass the same test, so that their sizes can
be compared."""

import os
import re
import select
import socket
import struct
import subprocess
import threading
import time
import unittest

PATIENCE = float(os.environ.get("CLES_TEST_PATIENCE", "30"))
LIMIT = 1  # seconds, that a client waits for an answer
VALUES = re.compile(r"\d+ 48\.137154 11\.576124 27\.31 -0\.12\n")


def read_line(process):
    """The next line, or a failure if none arrives. Bypasses Python's buffer."""
    line = b""
    end = time.monotonic() + PATIENCE
    while not line.endswith(b"\n"):
        if not select.select([process.stdout], [], [], max(0, end - time.monotonic()))[0]:
            raise AssertionError(f"no line came, but {line!r}")
        byte = os.read(process.stdout.fileno(), 1)
        if not byte:
            break
        line += byte
    return line.decode()


class Server:
    def __init__(self, program, port=0):
        self.process = subprocess.Popen([program, "server", "--port", str(port)], stdin=subprocess.DEVNULL,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.port = int(read_line(self.process).rsplit(":", 1)[1])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()


class Client:
    def __init__(self, program, port):
        self.process = subprocess.Popen([program, "client", f"127.0.0.1:{port}"], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def ask(self):
        self.process.stdin.write(b"\n")
        self.process.stdin.flush()
        return read_line(self.process)

    def end(self):
        """The exit code and its error output."""
        _, errors = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, errors.decode()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()


class Peer:
    """A server that follows a script: `act(connection, request)` is called for the first request of each client."""

    def __init__(self, act):
        self.act = act
        self.over = threading.Event()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.thread = threading.Thread(target=self.serve)
        self.thread.start()

    def serve(self):
        while not self.over.is_set():
            ready, _, _ = select.select([self.listener], [], [], 0.05)
            if not ready:
                continue
            client, _ = self.listener.accept()
            with client:
                client.settimeout(PATIENCE)
                try:
                    self.act(client, client.recv(4096), self.over)
                except OSError:
                    pass  # the client has disconnected

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.over.set()
        self.thread.join(PATIENCE)
        self.listener.close()


def silent(_client, _request, over):
    over.wait(PATIENCE)


class Behaviour:
    """The requirements for both programs; a subclass defines the format of each."""

    program = None

    def reply(self, request):
        """A valid reply to these bytes."""
        raise NotImplementedError

    def wrong_replies(self, request):
        """Invalid replies, each with a description."""
        raise NotImplementedError

    wrong_requests = ()
    half_request = b""

    def run_against(self, act):
        """One request to a scripted server: exit code, errors, seconds."""
        with Peer(act) as peer:
            began = time.monotonic()
            done = subprocess.run([self.program, "client", f"127.0.0.1:{peer.port}"], input=b"\n", capture_output=True,
                                  timeout=PATIENCE, check=False)
            took = time.monotonic() - began
        self.last_output = done.stdout.decode()
        return done.returncode, done.stderr.decode(), took

    def fails(self, act):
        code, errors, took = self.run_against(act)
        self.assertEqual(code, 1, errors)
        self.assertEqual(self.last_output, "")
        self.assertTrue(errors.startswith(os.path.basename(self.program) + ": "), errors)
        self.assertEqual(errors.count("\n"), 1, errors)
        return took

    def test_the_values_come_once_for_each_line(self):
        with Server(self.program) as server, Client(self.program, server.port) as client:
            for _ in range(3):
                line = client.ask()
                self.assertRegex(line, VALUES)
                self.assertLess(abs(float(line.split()[0]) - time.time()), PATIENCE)
            self.assertEqual(client.end(), (0, ""))

    def test_a_scripted_reply_is_understood(self):
        # So that the following failures have the expected cause, and not an error in the script.
        code, errors, _ = self.run_against(lambda client, request, over: client.sendall(self.reply(request)))
        self.assertEqual((code, errors, self.last_output), (0, "", "1700000000 1.000000 -2.000000 3.50 0.00\n"))

    def test_a_reply_in_pieces_is_put_together(self):
        def act(client, request, over):
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for byte in self.reply(request):
                client.sendall(bytes([byte]))
            silent(client, request, over)

        code, errors, _ = self.run_against(act)
        self.assertEqual((code, errors), (0, ""))

    def test_clients_that_say_nothing_hold_nobody_up(self):
        with Server(self.program) as server:
            idle = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(3)]
            idle[0].sendall(self.half_request)
            with Client(self.program, server.port) as one, Client(self.program, server.port) as other:
                for client in (one, other, one, other):
                    self.assertRegex(client.ask(), VALUES)
            for each in idle:
                each.close()

    def test_the_client_goes_on_with_a_server_that_was_restarted(self):
        with Server(self.program) as server:
            client = Client(self.program, server.port)
            self.assertRegex(client.ask(), VALUES)
        with client, Server(self.program, server.port):
            self.assertRegex(client.ask(), VALUES)
            self.assertRegex(client.ask(), VALUES)
            self.assertEqual(client.end(), (0, ""))

    def test_the_client_tells_that_the_server_is_gone(self):
        with Server(self.program) as server:
            client = Client(self.program, server.port)
            self.assertRegex(client.ask(), VALUES)
        with client:
            self.assertEqual(client.ask(), "")
            code, errors = client.end()
            self.assertEqual(code, 1)
            self.assertTrue(errors.startswith(os.path.basename(self.program) + ": "), errors)

    def test_a_silent_server_is_given_up_in_time(self):
        took = self.fails(silent)
        self.assertGreater(took, 0.9 * LIMIT)
        self.assertLess(took, LIMIT + PATIENCE / 3)

    def test_a_server_that_trickles_is_given_up_too(self):
        def act(client, request, over):
            for byte in self.reply(request):
                client.sendall(bytes([byte]))
                over.wait(0.2)  # the complete run would take several times the limit

        self.fails(act)

    def test_a_server_that_hangs_up_is_told(self):
        self.fails(lambda client, request, over: None)

    def test_a_truncated_reply_is_told(self):
        self.fails(lambda client, request, over: client.sendall(self.reply(request)[:-9]))

        def half_and_silence(client, request, over):
            client.sendall(self.reply(request)[:-9])
            silent(client, request, over)

        self.fails(half_and_silence)

    def test_what_is_no_reply_is_told(self):
        for name in ("garbage", "zeros", "wrong_size"):
            def act(client, request, over, name=name):
                client.sendall(self.wrong_replies(request)[name])
                silent(client, request, over)

            with self.subTest(name):
                self.fails(act)

    def test_the_server_survives_whatever_comes(self):
        with Server(self.program) as server:
            for garbage in (*self.wrong_requests, self.half_request, bytes(range(256)) * 16, b"\0" * 5000, b"\n" * 100):
                with socket.create_connection(("127.0.0.1", server.port)) as peer:
                    try:
                        peer.sendall(garbage)
                        peer.shutdown(socket.SHUT_WR)
                        peer.settimeout(PATIENCE)
                        while peer.recv(4096):
                            pass
                    except TimeoutError:
                        raise
                    except OSError:
                        pass  # it disconnected, which is allowed
            abrupt = socket.create_connection(("127.0.0.1", server.port))
            abrupt.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            abrupt.sendall(self.half_request)
            abrupt.close()  # by a reset
            with Client(self.program, server.port) as client:
                self.assertRegex(client.ask(), VALUES)
            self.assertIsNone(server.process.poll())

    def test_a_wrong_command_line_is_told(self):
        for words in ([], ["client"], ["server", "--port"], ["server", "--port", "no"], ["server", "--port", "70000"],
                      ["client", "nowhere"], ["client", "127.0.0.1:no"], ["serve", "--port", "0"]):
            with self.subTest(words):
                done = subprocess.run([self.program, *words], input=b"\n", capture_output=True, timeout=PATIENCE,
                                      check=False)
                self.assertEqual(done.returncode, 1)
                self.assertTrue(done.stderr.startswith(os.path.basename(self.program).encode() + b": "), done.stderr)

    def test_a_port_that_is_taken_is_told(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = taken.getsockname()[1]
            done = subprocess.run([self.program, "server", "--port", str(port)], capture_output=True, timeout=PATIENCE,
                                  check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn(str(port).encode(), done.stderr)


class ByHand(Behaviour, unittest.TestCase):
    program = os.environ["ICD_LOCALIZATION"]
    half_request = b"\x00\x01"
    wrong_requests = (b"\x00\x01\x00\x05", b"\x00\x02\x00\x04", b"\x00\x01\x00\x04" * 3 + b"\xff" * 4)

    def reply(self, request):
        self.assertEqual(request, b"\x00\x01\x00\x04")
        return struct.pack("!HH5d", 2, 44, 1.7e9, 1, -2, 3.5, 0)

    def wrong_replies(self, request):
        return {"garbage": bytes(range(255, 0, -1)), "zeros": b"\0" * 100,
                "wrong_size": struct.pack("!HH4d", 2, 36, 1.7e9, 1, -2, 3.5)}


class ByCles(Behaviour, unittest.TestCase):
    program = os.environ["CLES_LOCALIZATION"]
    half_request = b"PULL self:local"
    wrong_requests = (b"PULL self:nothing\n", b"PULL\n", b'PUSH self:localization {"a":\n', b"PULL self:localization/x\n" * 3)

    def head_of(self, request):
        found = re.match(rb"PULL self:localization .*?\b(id=\d+)", request)
        self.assertTrue(found, request)
        return found[1]

    def reply(self, request):
        return self.head_of(request) + b' {"utc":1.7e9,"lat":1,"lon":-2,"velocity":3.5,"acceleration":0}\n'

    def wrong_replies(self, request):
        return {"garbage": bytes(range(255, 0, -1)), "zeros": b"\0" * 100,
                "wrong_size": self.head_of(request) + b' {"utc":1.7e9,"lat":1,"lon":-2,"velocity":3.5}\n'}


if __name__ == "__main__":
    unittest.main()
