# SPDX-License-Identifier: BSL-1.0
"""Sessions over asyncio: streams and datagrams."""

from __future__ import annotations

import asyncio
import select
import socket
import struct
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol, cast

from .admission import LONGEST_LINE, Admission
from .core import Core, Peer
from .datagrams import Reflection
from .errors import Error
from .grammar import DATAGRAM, LineBuffer, Reply, is_reply, salvage, trim
from .liveness import Liveness
from .serving import failure_text
from .session import Session
from .timers import MS, Timer

_READ = 32_768  # bytes
_HIGH_WATER = 65_536
_LINES_A_WRITE = 32
_UDP_HEADERS = 48


class Host(Protocol):
    """The node that links belong to."""

    core: Core
    loop: asyncio.AbstractEventLoop

    def schedule(self) -> None:
        """Something may be due earlier than before."""

    def on_connected(self, link: Link) -> None: ...

    def on_link_open(self, link: StreamLink) -> None: ...

    def on_unusable(self, link: Link, why: str) -> None:
        """What is bound there is lost."""

    def on_link_gone(self, link: Link) -> None: ...


class Link:
    """A session and what carries it."""

    session: Session

    def __init__(self, host: Host) -> None:
        self.host = host
        self.usable = True  # for new requests
        self._flushes = False

    def wake(self) -> None:
        if not self._flushes:
            self._flushes = True
            self.host.loop.call_soon(self._flush_later)

    def _flush_later(self) -> None:
        self._flushes = False
        self.session.serve_more(self.host.core.now())
        self.flush()

    def flush(self) -> None:
        raise NotImplementedError

    def close(self) -> None:
        raise NotImplementedError

    def retire(self) -> None:
        """The peer leaves: what is sent from now on goes elsewhere."""
        self.usable = False
        self.host.on_unusable(self, "the publisher leaves")


def user_of(connection: socket.socket) -> int | None:
    """The user at the other end of a Unix socket."""
    try:
        credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    except OSError:
        return None
    return cast(int, struct.unpack("3i", credentials)[1])


class StreamLink(Link, asyncio.BufferedProtocol):
    """A TCP connection, with TLS or without, or a Unix socket. `admission` decides about it before it has a session."""

    transport: asyncio.Transport

    def __init__(self, host: Host, transport_name: str, *, accepted: bool, admission: Admission | None = None,
                 identify: Callable[[StreamLink], Peer] | None = None) -> None:
        super().__init__(host)
        self.transport_name = transport_name
        self.accepted = accepted
        self.is_node = False  # whether the peer is known as one
        self.opened: asyncio.Future[None] = host.loop.create_future()
        self._admission = admission
        self._identify = identify
        self._input = memoryview(bytearray(_READ))
        self._lines = LineBuffer(host.core.limits.line)
        self._pending: deque[str] = deque()  # lines that have been read
        self._has_session = False
        self._gone = False
        self._discards = False
        self._paused_by_session = False
        self._paused_by_output = False
        self._stall: Timer | None = None
        self._written = 0
        self._timers: list[Timer] = []
        self.has_received = False  # a line
        self.half_closed = False
        self.last_line = self.began = host.core.now()
        self._liveness: Liveness | None = None

    # --- asyncio ---

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast(asyncio.Transport, transport)
        self.host.on_connected(self)
        self.transport.set_write_buffer_limits(_HIGH_WATER, _HIGH_WATER // 2)
        connection = self.transport.get_extra_info("socket")
        if connection is not None and connection.family != socket.AF_UNIX:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            if hasattr(socket, "TCP_USER_TIMEOUT"):
                stall = int(self.host.core.limits.stall * 1000)
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, stall)
        if self._admission is not None:
            self._lines.limit = LONGEST_LINE  # each is checked when it is known what it may be
            self._write(self._admission.begin(self.transport))
            self._timers.append(self._after(self.host.core.limits.connect, lambda _: self.abandon("it took too long to open")))
        else:
            self._begin()

    def _begin(self) -> None:
        core = self.host.core
        try:
            peer = self._identify(self) if self._identify else Peer(self.transport_name, self.address())
        except Error as error:
            self.abandon(error.message)
            return
        for timer in self._timers:
            timer.cancel()
        self._timers = []
        self.session = Session(core, self, peer)
        self._has_session = True
        if not self.accepted:
            self._liveness = Liveness(core.timers, self, core.limits.silence)
        elif core.limits.first_line:
            self._timers.append(self._after(core.limits.first_line, self._on_no_line))
        if not self.opened.done():
            self.opened.set_result(None)
        self.host.on_link_open(self)
        self.host.schedule()

    def address(self) -> str:
        name = self.transport.get_extra_info("peername")
        return f"{name[0]}:{name[1]}" if isinstance(name, tuple) else "unix"

    def _after(self, seconds: float, call: Callable[[int], None]) -> Timer:
        core = self.host.core
        timer = core.timers.at(core.now() + int(seconds * 1e9), call)
        self.host.schedule()
        return timer

    def _on_no_line(self, _: int) -> None:
        if not self.has_received:
            self.abandon("it has received no line")

    def get_buffer(self, sizehint: int) -> memoryview:
        return self._input

    def buffer_updated(self, nbytes: int) -> None:
        if self._discards or self._gone:
            return
        lines = self._lines.feed(bytes(self._input[:nbytes]))
        if self._admission is not None:
            lines = self._admit(lines)
        if not self._has_session:
            return
        now = self.host.core.now()
        if self._liveness is not None:
            self._liveness.on_input(now)
        if lines:
            self.has_received = True
            self.last_line = now
            self._pending.extend(lines)
        self._serve_lines(now)

    def _serve_lines(self, now: int) -> None:
        """What has been read, as long as the peer reads the replies."""
        count = 0
        while self._pending and not self._gone:
            self.session.on_line(self._pending.popleft(), now)
            count += 1
            if count % _LINES_A_WRITE == 0:
                self.flush()
                if self._paused_by_output:
                    return
        if self._lines.overlong is not None and not self._gone:
            self.session.on_overlong(self._lines.overlong)
        self.flush()

    def _admit(self, lines: list[str]) -> list[str]:
        """Lines before the link is open; returns those that follow."""
        admission = self._admission
        assert admission is not None
        why = ""
        for number, line in enumerate(lines):
            if len(line) > admission.longest_line:
                break
            self._write(admission.on_line(line))
            why = admission.refused
            if why:
                break
            if admission.admitted:
                self._admission = None
                self._lines.limit = self.host.core.limits.line
                self.is_node = True
                self._begin()
                return lines[number + 1:]
        else:
            if self._lines.overlong is None and len(self._lines) <= admission.longest_line:
                return []
        self._end_after_output(why or "the other end sent a line that is too long")
        return []

    def eof_received(self) -> bool:
        if self._discards or not self._has_session or self._gone:
            return False
        self.usable = False
        self.session.on_cut(self._lines.unfinished())
        self.host.on_unusable(self, "the publisher has ended the link")
        self.session.on_end()
        self.flush()
        if self.transport_name == "tls":
            return False
        if self._has_hung_up():
            self.abandon("the peer has closed the link")
            return False
        self.half_closed = True
        self._timers.append(self._after(self.host.core.limits.probe, self._probe))
        return True

    def _has_hung_up(self) -> bool:
        """Of a Unix socket: whether the peer has closed it in both directions."""
        connection = self.transport.get_extra_info("socket")
        if connection is None or connection.family != socket.AF_UNIX:
            return False
        poll = select.poll()
        poll.register(connection.fileno(), 0)
        return any(events & select.POLLHUP for _, events in poll.poll(0))

    def _probe(self, _: int) -> None:
        if self._gone or self._discards:
            return
        if self._has_hung_up():
            self.abandon("the peer has closed the link")
            return
        if not self.unsent():
            self._write("\n")
        self._timers.append(self._after(min(self.host.core.limits.probe * 3, 15.0), self._probe))

    def connection_lost(self, exc: Exception | None) -> None:
        self._end("the link was lost" + (f": {exc}" if exc else ""))

    def pause_writing(self) -> None:
        pass

    def resume_writing(self) -> None:
        if self._has_session and not self._gone:
            now = self.host.core.now()
            self.session.on_writable(now)
            self.flush()
            if not self._paused_by_output:
                self._serve_lines(now)

    # --- For the session ---

    def flush(self) -> None:
        if not self._has_session:
            return
        if self._gone or self._discards:
            self.session.take_output()
            return
        while output := self.session.take_output():
            output.append("")
            self._write("\n".join(output))
            now = self.host.core.now()
            if self._liveness is not None:
                self._liveness.watch(now)
            self.session.resume_updates(now)
        self.host.schedule()
        behind = self.transport.get_write_buffer_size() > self.host.core.limits.unread
        if behind != self._paused_by_output:
            self._paused_by_output = behind
            self._set_reading()

    def _write(self, text: str) -> None:
        if text:
            data = text.encode()
            self._written += len(data)
            self.transport.write(data)
            if self._stall is None and self.transport.get_write_buffer_size():
                self._watch_output()

    def _watch_output(self) -> None:
        sent = self._written - self.transport.get_write_buffer_size()

        def check(_: int) -> None:
            self._stall = None
            left = self.transport.get_write_buffer_size()
            if self._gone or not left:
                return
            if self._written - left == sent:
                self.abandon("the peer reads nothing")
            else:
                self._watch_output()

        self._stall = self._after(self.host.core.limits.stall, check)

    def unsent(self) -> int:
        return self.transport.get_write_buffer_size()

    def pause(self, stop: bool) -> None:
        self._paused_by_session = stop
        self._set_reading()

    def _set_reading(self) -> None:
        if self._gone:
            return
        if self._paused_by_session or self._paused_by_output:
            self.transport.pause_reading()
        elif not self.transport.is_reading():
            self.transport.resume_reading()

    def finish(self) -> None:
        self.flush()
        self._end_after_output("the link has ended")

    def _end_after_output(self, why: str) -> None:
        if self._gone or self._discards:
            return
        self.usable = False
        self._discards = True
        if self._paused_by_output or self._paused_by_session:
            self._paused_by_output = self._paused_by_session = False
            self._set_reading()
        if not self.opened.done():
            self.opened.set_exception(Error("unavailable", why))
        if self.transport.can_write_eof():
            try:
                self.transport.write_eof()
            except OSError:  # the peer is gone already
                self.transport.abort()
                return
            self._timers.append(self._after(self.host.core.limits.discard, lambda _: self.transport.close()))
        else:
            self.transport.close()

    def close(self) -> None:
        self.abandon("the link was closed")

    def abandon(self, why: str) -> None:
        if not self._gone:
            self.transport.abort()
            self._end(why)

    def _end(self, why: str) -> None:
        if self._gone:
            return
        self._gone = True
        self.usable = False
        for timer in self._timers:
            timer.cancel()
        if self._stall is not None:
            self._stall.cancel()
        if self._liveness is not None:
            self._liveness.stop()
        if not self.opened.done():
            self.opened.set_exception(Error("unavailable", why))
        self.host.on_unusable(self, why)
        if self._has_session:
            self.session.on_lost(why)
        self.host.on_link_gone(self)

    @property
    def has_session(self) -> bool:
        return self._has_session

    @property
    def is_idle(self) -> bool:
        return self._has_session and self.session.serving.is_idle

    # --- The node at the other end ---

    def awaits_peer(self) -> bool:
        return not self._gone and (len(self.session.asking) > 0 or bool(self.session.subscriptions))

    def may_be_asked(self) -> bool:
        return self.is_node or self.session.asking.features is not None

    def ask_peer(self) -> None:
        core = self.host.core
        self.session.asking.send("PULL", "self:cles", "", core.now() + 5_000 * MS, _Ignored())

    def on_hung(self) -> None:
        self.abandon("the node there is silent")


class _Ignored:
    def resolve(self, value: Any, reply: Reply) -> None:
        pass

    def reject(self, error: Error) -> None:
        pass



class DatagramLink(Link):
    """A source of datagrams, or the node to which a client sends them."""

    def __init__(self, host: Host, send: Callable[[bytes], None], peer: Peer, *, accepted: bool, first_id: int = 1,
                 reflection: Reflection | None = None) -> None:
        super().__init__(host)
        self._send = send
        self._reflection = reflection
        self.accepted = accepted
        self.last = host.core.now()
        self.session = Session(host.core, self, peer, by_datagram=True, first_id=first_id)

    def receive(self, data: bytes) -> None:
        if data[:1] >= b"\x80":  # sealed: for nodes with security
            return
        now = self.last = self.host.core.now()
        text = data.decode("utf-8", "surrogateescape")
        if len(data) > DATAGRAM:
            self.session.on_overlong(text.partition("\n")[0])
        else:
            self.session.on_line(text[:-1] if text.endswith("\n") else text, now)
        self.flush()
        self.host.schedule()

    def flush(self) -> None:
        while output := self.session.take_output():
            now = self.host.core.now()
            for line in output:
                data = line.encode() + b"\n"
                if len(data) > DATAGRAM:
                    data = data[:-1]
                address = self.session.peer.address.rpartition(":")[0]
                if self._reflection is None or self._reflection.admits(address, len(data) + _UDP_HEADERS, now):
                    self._send(data)
                else:
                    self.host.core.count("datagrams_withheld")
            self.session.resume_updates(now)
        self.host.schedule()

    def unsent(self) -> int:
        return 0

    def pause(self, stop: bool) -> None:
        pass

    def finish(self) -> None:
        self.close()

    def close(self) -> None:
        if self.usable:
            self.usable = False
            self.host.on_unusable(self, "the link was closed")
            self.session.on_lost("the link was closed")
            self.host.on_link_gone(self)


class DatagramClient(asyncio.DatagramProtocol):
    """The socket of one link to a node."""

    link: DatagramLink

    def __init__(self, host: Host, first_id: int) -> None:
        self._host = host
        self._first_id = first_id

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        sender = cast(asyncio.DatagramTransport, transport)
        name = transport.get_extra_info("peername")
        self.link = DatagramLink(self._host, sender.sendto, Peer("udp", f"{name[0]}:{name[1]}"), accepted=False,
                                 first_id=self._first_id)
        self._host.on_connected(self.link)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self.link.receive(data)

    def error_received(self, exc: Exception) -> None:
        pass  # only replies show whether a node is there


class DatagramServer(asyncio.DatagramProtocol):
    """A socket at which a node listens; each source has a link."""

    def __init__(self, host: Host, reflection: Reflection) -> None:
        self._host = host
        self._reflection = reflection
        self._transport: asyncio.DatagramTransport | None = None
        self.links: dict[Any, DatagramLink] = {}

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        link = self.links.get(addr)
        if link is None and len(self.links) >= self._host.core.limits.links and not self._forget_idle():
            self._refuse(data, addr)
        else:
            (link or self._make(addr)).receive(data)

    def flush(self) -> None:
        for link in list(self.links.values()):
            link.flush()

    def _refuse(self, data: bytes, addr: Any) -> None:
        core = self._host.core
        core.count("sources_refused")
        line = trim(data[:DATAGRAM].decode("utf-8", "surrogateescape").partition("\n")[0])
        what = salvage(line) if line else None
        if what is not None and what.wants_reply and not is_reply(line) and self._transport is not None:
            reply = failure_text(Error("busy", f"{core.name} has reached its limit of links", retry_ms=1000), core.name)
            text = (f"id={what.id} {reply}" if what.id else reply).encode()
            if self._is_trusted(addr) or self._reflection.admits(addr[0], len(text) + _UDP_HEADERS, core.now()):
                self._transport.sendto(text, addr)

    @staticmethod
    def _is_trusted(addr: Any) -> bool:
        return bool(addr[0] == "::1" or addr[0].startswith("127."))

    def _make(self, addr: Any) -> DatagramLink:
        transport = cast(asyncio.DatagramTransport, self._transport)
        link = DatagramLink(self._host, lambda data: transport.sendto(data, addr), Peer("udp", f"{addr[0]}:{addr[1]}"),
                            accepted=True, reflection=None if self._is_trusted(addr) else self._reflection)
        self.links[addr] = link
        return link

    def _forget_idle(self) -> bool:
        """Sources for which nothing is kept; True if there were any."""
        idle = [addr for addr, link in self.links.items() if link.session.serving.is_idle]
        for addr in idle:
            self.links.pop(addr).close()
        return bool(idle)

    def error_received(self, exc: Exception) -> None:
        pass
