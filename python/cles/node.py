# SPDX-License-Identifier: BSL-1.0
"""A node over asyncio: it listens, serves tasks, publishes, and sends requests to other nodes."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import random
import secrets
import socket
import ssl
import stat
import time
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar, overload

from . import grammar, jsontext
from .admission import Admission
from .asking import Progress
from .confirmation import Confirmation
from .core import INTERVAL_MS, Access, Core, Peer, Task
from .datagrams import Reflection
from .errors import ConversionError, Error, RefusedError
from .feed import Feed, check_terms
from .fleet import Fleet, Roster
from .grammar import Reply, Trace, Verb
from .handlers import make_task
from .limits import Limits
from .links import DatagramClient, DatagramServer, Link, StreamLink, user_of
from .serving import failure_text
from .timers import MS
from .topics import update_body
from .types import from_json, to_json, unwrapped
from .urls import Url, parse_url

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])

# The clock runs on while the host is suspended, so that deadlines pass.
_clock = (lambda: time.clock_gettime_ns(time.CLOCK_BOOTTIME)) if hasattr(time, "CLOCK_BOOTTIME") else time.monotonic_ns


class _Waiting:
    """A future for a reply."""

    __slots__ = ("_on_reply", "future")

    def __init__(self, future: asyncio.Future[tuple[Any, Reply]], on_reply: Callable[[Any, Reply], None] | None) -> None:
        self.future = future
        self._on_reply = on_reply

    def resolve(self, value: Any, reply: Reply) -> None:
        if not self.future.done():
            if self._on_reply is not None:
                self._on_reply(value, reply)
            self.future.set_result((value, reply))

    def reject(self, error: Error) -> None:
        if not self.future.done():
            self.future.set_exception(error)


class _Answer:
    """Calls a function with the text of a reply, or with "" if there is none."""

    def __init__(self, answer: Callable[[str], None]) -> None:
        self._answer = answer

    def resolve(self, value: Any, reply: Reply) -> None:
        self._answer(reply.body)

    def reject(self, error: Error) -> None:
        self._answer("")


class Node:
    """A node of a CLES network.

        async with cles.Node("car1", listen=["tcp://127.0.0.1:25371"]) as car:
            car.publish("speed", 27.5)
            print(await car.pull("car2:speed"))

    `peers` has the URLs of other nodes by their names. Requests for all other targets, also `any` and `all`, are sent to
    `through`: the URL, or the name in `peers`, of a node that routes, such as `clesd`. `join` has URLs of such nodes to
    which this node makes itself known, so that it serves `any:` and `all:` of their pool.

    `keys` is the directory of a member of a secured fleet; the node then has the member's name.
    """

    def __init__(self, name: str | None = None, *, listen: Sequence[str] = (), peers: Mapping[str, str] | None = None,
                 through: str | None = None, join: Sequence[str] = (), pool: str = "",
                 keys: str | os.PathLike[str] | None = None, local_users: Mapping[int, str] | None = None,
                 insecure: bool = False, authorise: Callable[[Access], bool] | None = None,
                 limits: Limits | None = None) -> None:
        self.log = logging.getLogger("cles")
        self.fleet = Fleet(keys) if keys is not None else None
        if self.fleet is not None and name not in (None, self.fleet.name):
            raise RefusedError(f"the key in {keys} is that of '{self.fleet.name}', and this node is '{name}'")
        own = self.fleet.name if self.fleet else name or f"python-{os.getpid()}-{secrets.token_hex(2)}"
        if local_users and keys is None:
            raise RefusedError("local_users needs keys: without a fleet, nobody checks who connects")
        self.limits = limits or Limits()
        self.core = Core(own, _clock, self.limits)
        self.core.pool = pool
        self.core.authorise = self._guarded(authorise, False)
        self.core.security = self.fleet
        self.peers = dict(peers or {})
        self.through = through
        self.loop: asyncio.AbstractEventLoop
        self._listen = [(text, self._checked(text, insecure)) for text in listen]
        self._join = list(join)
        for text in (*self.peers.values(), *self._join, *([through] if through else [])):
            if text not in self.peers:
                parse_url(text)
        self._local_users = dict(local_users or {})
        self._servers: list[asyncio.AbstractServer] = []
        self._sockets: list[asyncio.BaseTransport] = []
        self._socket_files: list[tuple[str, int, int]] = []  # path, device, inode
        self._reflection = Reflection()
        self._open: set[Link] = set()
        self._accepted: set[StreamLink] = set()
        self._links: dict[tuple[str, str, int], Link] = {}  # by URL, expected name and number
        self._opening: dict[tuple[str, str, int], asyncio.Task[Link]] = {}
        self._learned: dict[Link, asyncio.Task[None]] = {}
        self._feeds: dict[Link, set[Feed[Any]]] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._background: set[asyncio.Task[Any]] = set()
        self._timer: asyncio.TimerHandle | None = None
        self._timer_due = 0
        self._next_datagram_id = random.randrange(1, 2**48)
        self._started = False

    def _checked(self, text: str, insecure: bool) -> Url:
        url = parse_url(text)
        if url.scheme == "tls":
            raise RefusedError(f"'{text}': Python's ssl cannot check the keys of those who connect. Listen on unix://, and let a "
                               "local clesd forward (docs/python.md)")
        if self.fleet is not None and url.scheme != "unix":
            raise RefusedError(f"'{text}': a node with keys listens on unix:// only, and a local clesd forwards (docs/python.md)")
        if not url.is_local and not insecure:
            raise RefusedError(f"'{text}': listening beyond this host needs insecure=True, because links carry no credentials")
        return url

    def _guarded(self, function: Callable[..., Any] | None, instead: Any = None) -> Callable[..., Any] | None:
        """A function of the program that is called while lines are read: what it raises is logged, and ends nothing."""
        if function is None:
            return None
        guarded = function

        def call(*arguments: Any) -> Any:
            try:
                return guarded(*arguments)
            except Exception:
                self.log.exception("%s failed", getattr(guarded, "__qualname__", guarded))
                return instead
        return call

    @property
    def name(self) -> str:
        return self.core.name

    @property
    def endpoints(self) -> list[str]:
        """The URLs at which the node listens, with the ports that the system has chosen."""
        return list(self.core.endpoints)

    # --- Start and end ---

    async def __aenter__(self) -> Node:
        await self.start()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def start(self) -> None:
        self.loop = asyncio.get_running_loop()
        self._started = True
        try:
            for text, url in self._listen:
                await self._start_listening(text, url)
        except BaseException:
            await self.close(grace=0)
            raise
        if self.fleet is not None:
            self.fleet.changed.append(self._on_roster)
            self._run(self._watch_files())
        for pool in self._join:
            self._run(self._stay_in_pool(pool))

    async def close(self, grace: float = 1.0) -> None:
        """Shuts down in order: within `grace` seconds, requests that have started may end, and subscribers get what was
        published; all other requests are `busy`, and each peer is told that what it has no reply to has not been started."""
        if not self._started:
            return
        self.core.leaving = True
        for task in list(self._background):
            task.cancel()
        await asyncio.gather(*self._background, return_exceptions=True)
        for server in self._servers:
            server.close()
        end = self.loop.time() + grace
        while self.core.running and self.loop.time() < end:
            await asyncio.sleep(0.01)
        self.core.topics.flush(self.core.now())
        for each in list(self._open):
            each.flush()
        for socket_of_datagrams in self._sockets:
            protocol = socket_of_datagrams.get_protocol()
            if isinstance(protocol, DatagramServer):
                protocol.flush()
        while self.core.topics.has_waiting() and self.loop.time() < end:  # subscribers that read slowly
            await asyncio.sleep(0.005)
        links = [link for link in self._open if isinstance(link, StreamLink) and link.has_session]
        for link in links:
            link.session.serving.abort_running()
            link.session.asking.lose(Error("cancelled", "the node was closed"))
            link.session.send_leave_notice()
            link.flush()
        deadline = max(end, self.loop.time() + min(self.limits.discard, 0.5))
        while any(link.unsent() for link in links) and self.loop.time() < deadline:
            await asyncio.sleep(0.005)
        for each in list(self._open):
            each.close()
        for transport in self._sockets:
            transport.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for path, device, inode in self._socket_files:
            with contextlib.suppress(OSError):
                now = os.lstat(path)
                if (now.st_dev, now.st_ino) == (device, inode):  # otherwise, it is that of another process
                    os.unlink(path)
        if self._timer is not None:
            self._timer.cancel()
        self._started = False
        await asyncio.sleep(0)

    def _run(self, work: Any) -> None:
        task = asyncio.ensure_future(work)
        self._background.add(task)
        task.add_done_callback(self._background.discard)

    # --- Time ---

    def schedule(self) -> None:
        due = self.core.timers.next_due()
        if due is None or (self._timer is not None and self._timer_due <= due):
            return  # a timer that is too early finds nothing to do
        if self._timer is not None:
            self._timer.cancel()
        self._timer_due = due
        self._timer = self.loop.call_later(max(due - self.core.now(), 0) / 1e9, self._on_time)

    def _on_time(self) -> None:
        self._timer = None
        self.core.timers.run(self.core.now())
        self.schedule()

    # --- Listening ---

    async def _start_listening(self, text: str, url: Url) -> None:
        if url.scheme == "udp":
            transport, _ = await self.loop.create_datagram_endpoint(lambda: DatagramServer(self, self._reflection),
                                                                    local_addr=(url.host, url.port))
            self._sockets.append(transport)
            self.core.endpoints.append(url.with_port(transport.get_extra_info("sockname")[1]))
        elif url.scheme == "unix":
            self._servers.append(await self._listen_unix(url))
            self.core.endpoints.append(text)
        else:
            server = await self.loop.create_server(lambda: self._accept("tcp"), url.host, url.port, backlog=1024)
            self._servers.append(server)
            self.core.endpoints += [url.with_port(each.getsockname()[1]) for each in server.sockets[:1]]

    async def _listen_unix(self, url: Url) -> asyncio.AbstractServer:
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            if not url.path.startswith("\0"):
                _remove_stale(url.path)
                before = os.umask(0o177)  # only the owner and root may connect
                try:
                    listener.bind(url.path)
                finally:
                    os.umask(before)
                made = os.lstat(url.path)
                self._socket_files.append((url.path, made.st_dev, made.st_ino))
                if self._local_users:
                    os.chmod(url.path, 0o666)  # others are refused when they connect
            else:
                listener.bind(url.path)
            return await self.loop.create_unix_server(lambda: self._accept("unix"), sock=listener, backlog=1024)
        except BaseException:
            listener.close()
            raise

    def _accept(self, transport: str) -> StreamLink:
        link = StreamLink(self, transport, accepted=True, identify=self._identify)
        self._accepted.add(link)
        return link

    def _identify(self, link: StreamLink) -> Peer:
        if link.transport_name != "unix":
            return Peer(link.transport_name, link.address())
        uid = user_of(link.transport.get_extra_info("socket"))
        return Peer("unix", f"uid {uid}", self._member_of(uid) if self.fleet else "", uid)

    def _member_of(self, uid: int | None) -> str:
        """The member that a user of this host counts as."""
        if uid in (0, os.geteuid()):
            return self.name
        if uid in self._local_users:
            return self._local_users[uid]
        raise Error("denied", f"user {uid} of this host is no member: name it in local_users")

    def on_connected(self, link: Link) -> None:
        self._open.add(link)

    def on_link_open(self, link: StreamLink) -> None:
        if link.accepted and len(self._accepted) > self.limits.links:
            self._make_room(link)
        elif self.fleet is not None and link.session.peer.name and link.transport_name == "tls":
            self._secure(link, self.fleet)

    def _secure(self, link: StreamLink, fleet: Fleet) -> None:
        session = link.session

        def ask(noun: str, answer: Callable[[str], None]) -> None:
            session.asking.send("PULL", noun, "", self.core.now() + 5_000 * MS, _Answer(answer))

        session.on_hello = lambda body: self._on_stated_roster(link, body)
        session.confirmation = Confirmation(fleet, session.peer.name, self.core.now, ask, session.deliver,
                                            self.core.count)

    def _make_room(self, new: StreamLink) -> None:
        """Closes another link, or refuses the new one (docs/protocol.md, "Closing a link")."""
        victim = self._link_to_evict(new) or new
        reply = failure_text(Error("busy", f"{self.name} has reached its limit of links", retry_ms=1000), self.name)
        if not victim.has_received:
            victim.session.put(reply)
        victim.finish()
        self._accepted.discard(victim)

    def _link_to_evict(self, new: StreamLink) -> StreamLink | None:
        others = [link for link in self._accepted if link is not new and link.has_session]
        address_of = {link: link.session.peer.address.rpartition(":")[0] for link in [new, *others]}
        now = self.core.now()
        silent = [link for link in others if not link.has_received]
        by_address: dict[str, list[StreamLink]] = {}
        for link in silent:
            by_address.setdefault(address_of[link], []).append(link)
        most: list[StreamLink] = max(by_address.values(), key=len, default=[])
        if len(most) > len(by_address.get(address_of[new], ())):
            return min(most, key=lambda link: link.began)
        ended = min((link for link in others if link.half_closed), key=lambda link: link.last_line, default=None)
        if ended is not None:
            return ended
        longest_silent = min(silent, key=lambda link: link.began, default=None)
        if longest_silent is not None and now - longest_silent.began >= 1_000 * MS:
            return longest_silent
        idle = sorted((link for link in others if link.is_idle), key=lambda link: link.last_line)
        for address in set(address_of.values()) - {address_of[new]}:
            held = [link for link in others if address_of[link] == address]
            if len(held) > self.limits.links * 3 // 4:
                return next((link for link in idle if link in held), max(held, key=lambda link: link.began))
        return idle[0] if idle and now - idle[0].last_line >= 60_000 * MS else None

    def on_unusable(self, link: Link, why: str) -> None:
        for key in [key for key, each in self._links.items() if each is link]:
            del self._links[key]
        for feed in list(self._feeds.pop(link, ())):
            feed.on_unusable(why)

    def on_link_gone(self, link: Link) -> None:
        self._open.discard(link)
        if isinstance(link, StreamLink):
            self._accepted.discard(link)
        self._learned.pop(link, None)

    # --- Tasks ---

    def _register(self, verb: Verb, task: str, description: str, parameters: Iterable[str], idempotent: bool) -> Callable[[F], F]:
        def decorate(function: F) -> F:
            self.core.add(verb, task, make_task(self.core, verb, function, self._tasks, description, tuple(parameters),
                                                idempotent))
            return function
        return decorate

    def on_pull(self, task: str, *, description: str = "", parameters: Iterable[str] = (), idempotent: bool = True,
                ) -> Callable[[F], F]:
        """Registers a function as the handler of PULL. It takes a `Request`, or nothing; it may be a coroutine."""
        return self._register("PULL", task, description, parameters, idempotent)

    def on_push(self, task: str, *, description: str = "", parameters: Iterable[str] = (), idempotent: bool = False,
                ) -> Callable[[F], F]:
        """Of PUSH. It takes a `Request`, the body, both, or nothing. The body is read as the type of the argument."""
        return self._register("PUSH", task, description, parameters, idempotent)

    def on_delegate(self, task: str, *, description: str = "", parameters: Iterable[str] = (), idempotent: bool = False,
                    ) -> Callable[[F], F]:
        """Of DELEGATE, as `on_push`. `Request.progress` reports how far it is."""
        return self._register("DELEGATE", task, description, parameters, idempotent)

    def on_update(self, task: str, *, description: str = "", parameters: Iterable[str] = (), idempotent: bool = False,
                  ) -> Callable[[F], F]:
        """Of UPDATE: another node asks this one to publish. What the body is, is published when the function has returned."""
        return self._register("UPDATE", task, description, parameters, idempotent)

    def on_bind(self, task: str, *, description: str = "", parameters: Iterable[str] = ()) -> Callable[[F], F]:
        """Opens a task for BIND before its first update; the function may refuse a subscriber by raising `Error`."""
        return self._register("BIND", task, description, parameters, False)

    def offer(self, task: str, type: Any = None, *, description: str = "", parameters: Iterable[str] = ()) -> None:
        """Opens a task for BIND, and tells the type of its updates."""
        from .schemas import check_told, content_schema
        schema = content_schema(type) if type is not None else {}
        types = check_told({"updates": schema}) if schema else {}
        self.core.add("BIND", task, Task(lambda call: call.done(), description, tuple(parameters), False, types))

    def publish(self, path: str, value: Any) -> None:
        """To all subscribers of a task, or of a task with parameters: `tyre/front`. Never waits. Parameters of any text are
        encoded by `encode_parameter`."""
        grammar.check_task(path.partition("/")[0])
        noun = grammar.parse_noun(f"self:{path}")
        try:
            self.core.publish(noun.path, update_body(value, to_json))
        except jsontext.Invalid as error:
            raise ConversionError(str(error)) from None
        self.schedule_if_started()

    def schedule_if_started(self) -> None:
        if self._started:
            self.schedule()

    def retire(self, path: str) -> bool:
        """Forgets the last value of a noun that was published."""
        return self.core.topics.retire(grammar.parse_noun(f"self:{path}").path)

    # --- Requests ---

    @overload
    async def pull(self, noun: str, *, deadline: float | None = None, at: str | None = None, urgent: bool = False,
                   trace: Trace | None = None) -> Any: ...

    @overload
    async def pull(self, noun: str, type: type[T], *, deadline: float | None = None, at: str | None = None,
                   urgent: bool = False, trace: Trace | None = None) -> T: ...

    async def pull(self, noun: str, type: Any = None, *, deadline: float | None = None, at: str | None = None,
                   urgent: bool = False, trace: Trace | None = None) -> Any:
        """Gets data once. `type` is what the reply is read as; without it, it is JSON, and a scalar is itself."""
        return await self._request("PULL", noun, None, type, deadline, at, urgent, trace, None)

    @overload
    async def push(self, noun: str, body: Any = None, *, deadline: float | None = None, at: str | None = None,
                   urgent: bool = False, trace: Trace | None = None) -> Any: ...

    @overload
    async def push(self, noun: str, body: Any = None, *, type: type[T], deadline: float | None = None, at: str | None = None,
                   urgent: bool = False, trace: Trace | None = None) -> T: ...

    async def push(self, noun: str, body: Any = None, *, type: Any = None, deadline: float | None = None,
                   at: str | None = None, urgent: bool = False, trace: Trace | None = None) -> Any:
        """Sends data; returns when the handler has run."""
        return await self._request("PUSH", noun, body, type, deadline, at, urgent, trace, None)

    @overload
    async def delegate(self, noun: str, body: Any = None, *, progress: Progress | None = None, deadline: float | None = None,
                       at: str | None = None, urgent: bool = False, trace: Trace | None = None) -> Any: ...

    @overload
    async def delegate(self, noun: str, body: Any = None, *, type: type[T], progress: Progress | None = None,
                       deadline: float | None = None, at: str | None = None, urgent: bool = False,
                       trace: Trace | None = None) -> T: ...

    async def delegate(self, noun: str, body: Any = None, *, type: Any = None, progress: Progress | None = None,
                       deadline: float | None = None, at: str | None = None, urgent: bool = False,
                       trace: Trace | None = None) -> Any:
        """Delegates work, and returns its result. `progress` is called with the fraction and the value of each report. If the
        awaiting task is cancelled, the work is cancelled."""
        return await self._request("DELEGATE", noun, body, type, deadline, at, urgent, trace, progress)

    async def update(self, noun: str, body: Any = None, *, deadline: float | None = None, at: str | None = None,
                     trace: Trace | None = None) -> Any:
        """Asks another node to publish."""
        return await self._request("UPDATE", noun, body, None, deadline, at, False, trace, None)

    @overload
    def bind(self, noun: str, *, every: float | None = None, keep: int | None = None, at: str | None = None,
             lost: Callable[[str], None] | None = None, rebound: Callable[[], None] | None = None) -> Feed[Any]: ...

    @overload
    def bind(self, noun: str, type: type[T], *, every: float | None = None, keep: int | None = None, at: str | None = None,
             lost: Callable[[str], None] | None = None, rebound: Callable[[], None] | None = None) -> Feed[T]: ...

    def bind(self, noun: str, type: Any = None, *, every: float | None = None, keep: int | None = None,
             at: str | None = None, lost: Callable[[str], None] | None = None,
             rebound: Callable[[], None] | None = None) -> Feed[Any]:
        """Subscribes to updates: `async with node.bind("car1:speed") as feed`. `every` is in seconds: at most one update in
        that time, the newest. `lost` and `rebound` are called when the publisher is lost, and is back."""
        every_ms, keep = check_terms(every, keep)
        return Feed(self, noun, type, every_ms=every_ms, keep=keep, at=at, lost=self._guarded(lost),
                    rebound=self._guarded(rebound))

    async def _request(self, verb: Verb, noun: str, body: Any, type: Any, deadline: float | None, at: str | None, urgent: bool,
                       trace: Trace | None, progress: Progress | None) -> Any:
        parts = grammar.parse_noun(noun)
        try:
            text = update_body(body, to_json) if body is not None else ""
        except jsontext.Invalid as error:
            raise ConversionError(f"the body of {verb} {noun}: {error}") from None
        seconds = grammar.default_deadline_ms(verb) / 1000 if deadline is None else deadline
        due = self.core.now() + int(min(max(seconds, 0.001), 86_400) * 1e9)
        if trace is not None and trace.recorded:
            value = await self._traced(verb, parts, noun, text, due, at, urgent, trace, progress)
        else:
            value = await self._exchange(verb, parts, noun, text, due, at, urgent, trace, progress)
        if type is None:
            return unwrapped(value)
        return from_json(value, type, is_content=True)

    async def _traced(self, verb: Verb, parts: grammar.Noun, noun: str, text: str, due: int, at: str | None, urgent: bool,
                      trace: Trace, progress: Progress | None) -> Any:
        spans = self.core.spans
        own = spans.send(verb, parts.target, parts.task, trace, self.core.now())
        outcome = "cancelled"
        try:
            value = await self._exchange(verb, parts, noun, text, due, at, urgent, own, progress)
            outcome = "ok"
            return value
        except Error as error:
            outcome = error.code
            raise
        finally:
            spans.end(own.span, outcome, self.core.now())

    async def _exchange(self, verb: Verb, parts: grammar.Noun, noun: str, text: str, due: int, at: str | None, urgent: bool,
                        trace: Trace | None, progress: Progress | None) -> Any:
        link = self._known_link(parts.target, at, urgent) or await self._open_link(parts.target, at, urgent, due)
        options: dict[str, Any] = {"urgent": urgent, "trace": trace}
        if progress is not None:
            options["progress"] = self._guarded(progress)
        try:
            value, _ = await self._ask(link, verb, noun, text, due, **options)
        except Error as error:
            signed = self._signed(error, verb, parts, text, due)
            if signed is None:
                raise
            value, _ = await self._ask(link, verb, signed[0], text, due, sig=signed[1], **options)
        return value

    def _signed(self, error: Error, verb: Verb, noun: grammar.Noun, body: str, due: int) -> tuple[str, str] | None:
        """The noun and the signature of the second attempt, if the first was denied because it was not signed."""
        node, challenge = error.details.get("node"), error.details.get("challenge")
        fleet = self.fleet
        if fleet is None or error.code != "denied" or not isinstance(node, str) or not isinstance(challenge, str) or \
                len(challenge) != 22 or node not in fleet.roster.by_name:
            return None
        is_chosen = noun.target == "any" and fleet.roster.by_name[node].offers.permits(verb, node, noun)
        if noun.target not in (node, "self") and not is_chosen:
            return None
        waits = max((due - self.core.now()) // MS, 1)
        return f"{node}:{noun.path}", fleet.sign_request(node, challenge, verb, noun.path, body, waits)

    async def _ask(self, link: Link, verb: Verb, noun: str, body: str, due: int, *,
                   on_reply: Callable[[Any, Reply], None] | None = None, **options: Any) -> tuple[Any, Reply]:
        future: asyncio.Future[tuple[Any, Reply]] = self.loop.create_future()
        asking = link.session.asking
        id = asking.send(verb, noun, body, due, _Waiting(future, on_reply), **options)
        try:
            return await future
        except asyncio.CancelledError:
            asking.cancel(id)
            raise

    async def ask_on(self, link: Link, verb: Verb, noun: str, body: str = "", *, deadline: float = 5.0,
                     **options: Any) -> tuple[Any, Reply]:
        return await self._ask(link, verb, noun, body, self.core.now() + int(deadline * 1e9), **options)

    # --- Links to other nodes ---

    def _address(self, target: str, at: str | None) -> tuple[str, str]:
        """The URL for a target, and the name of the node that has to be there, if it is known."""
        if at is not None:
            return self.peers.get(at, at), at if at in self.peers else ""
        if target in self.peers:
            return self.peers[target], target
        if self.through is None:
            raise Error("no_target", f"{self.name} knows no address of '{target}': give it in peers, or a node that routes as "
                                     "through")
        return self._address(target, self.through)

    def _known_link(self, target: str, at: str | None, urgent: bool) -> Link | None:
        url, expected = self._address(target, at)
        link = self._links.get((url, expected, 1 if urgent else 0))
        return link if link is not None and link.usable else None

    async def _open_link(self, target: str, at: str | None, urgent: bool, due: int) -> Link:
        url, expected = self._address(target, at)
        return await self._link_at((url, expected, 1 if urgent else 0), due)

    async def _link_at(self, key: tuple[str, str, int], due: int) -> Link:
        link = self._links.get(key)
        if link is not None and link.usable:
            return link
        if not self._started or self.core.leaving:
            raise Error("cancelled", "the node is not running")
        opening = self._opening.get(key)
        if opening is None:
            opening = self._opening[key] = asyncio.ensure_future(self._dial(key))
            opening.add_done_callback(lambda _: self._opening.pop(key, None))
            opening.add_done_callback(lambda done: done.cancelled() or done.exception())
        try:
            left = (due - self.core.now()) / 1e9
            return await asyncio.wait_for(asyncio.shield(opening), max(left, 0))
        except asyncio.TimeoutError:
            raise Error("deadline", "no answer was received in time") from None

    async def _dial(self, key: tuple[str, str, int]) -> Link:
        text, expected, _ = key
        url = parse_url(text)
        try:
            link = await asyncio.wait_for(self._connect(url, expected), self.limits.connect)
        except asyncio.TimeoutError:
            raise Error("unavailable", f"{text} did not answer in time") from None
        except OSError as error:
            why = error.reason if isinstance(error, ssl.SSLError) else error.strerror
            raise Error("unavailable", f"{text}: {why or error}") from None
        self._links[key] = link
        return link

    async def _connect(self, url: Url, expected: str) -> Link:
        if url.scheme == "udp":
            return await self._connect_udp(url)
        if url.scheme != "unix" and self.fleet is not None and url.scheme != "tls":
            raise RefusedError("a node with keys opens tls:// and unix:// only")
        admission = None
        if url.scheme == "tls":
            if self.fleet is None:
                raise RefusedError(f"'{url.with_port(url.port)}' needs the key of a member: give keys=DIRECTORY")
            admission = Admission(self.fleet, self.core.epoch, expected)
        link = StreamLink(self, url.scheme, accepted=False, admission=admission,
                          identify=lambda link: self._identify_server(link, admission, expected))
        # A daemon, unlike an address that is merely configured, is known to be a node.
        link.is_node = admission is not None or url == self._router_url()
        if url.scheme == "unix":
            await self.loop.create_unix_connection(lambda: link, url.path)
        else:
            context = self.fleet.context() if self.fleet is not None else None
            await self.loop.create_connection(lambda: link, url.host, url.port, happy_eyeballs_delay=0.25, ssl=context,
                                              server_hostname="" if context else None)
            if url.dscp and ":" not in url.host:
                link.transport.get_extra_info("socket").setsockopt(socket.IPPROTO_IP, socket.IP_TOS, url.dscp << 2)
        await link.opened
        return link

    def _router_url(self) -> Url | None:
        return None if self.through is None else parse_url(self.peers.get(self.through, self.through))

    def _identify_server(self, link: StreamLink, admission: Admission | None, expected: str) -> Peer:
        if admission is not None:
            return Peer("tls", link.address(), admission.name)
        if self.fleet is None or link.transport_name != "unix":
            return Peer(link.transport_name, link.address())
        # Whoever listens there answers in the name of the node: its user has to be trusted with that.
        uid = user_of(link.transport.get_extra_info("socket"))
        own = uid in (0, os.geteuid())
        name = expected or self.name if own else self._member_of(uid)
        if expected and name != expected:
            raise Error("denied", f"user {uid}, who listens there, is not {expected}")
        return Peer("unix", f"uid {uid}", name, uid)

    async def _connect_udp(self, url: Url) -> Link:
        if self.fleet is not None:
            raise RefusedError("sealed datagrams are not available here: use tls:// or a local clesd")
        first = self._next_datagram_id
        self._next_datagram_id += 2**40  # none is used again
        transport, protocol = await self.loop.create_datagram_endpoint(lambda: DatagramClient(self, first),
                                                                       remote_addr=(url.host, url.port))
        self._sockets.append(transport)
        return protocol.link

    async def link_for_feed(self, feed: Feed[Any], target: str, at: str | None) -> Link:
        """A link on which its updates can be told from those of other feeds."""
        url, expected = self._address(target, at)
        number = 0
        while True:
            link = await self._link_at((url, expected, number), self.core.now() + int(self.limits.connect * 1e9))
            if link.session.subscriptions.admits(feed.subscription):
                break
            number = 2 if number == 0 else number + 1
        if isinstance(link, StreamLink) and link.is_node:
            await self._learn(link)
        self._feeds.setdefault(link, set()).add(feed)
        return link

    def forget_feed(self, feed: Feed[Any], link: Link) -> None:
        self._feeds.get(link, set()).discard(feed)

    async def _learn(self, link: Link) -> None:
        """Asks the node there once what it understands, and how long a line may be."""
        async def ask() -> None:
            with contextlib.suppress(Error):
                await self.ask_on(link, "PULL", "self:cles")
        task = self._learned.get(link)
        if task is None:
            task = self._learned[link] = asyncio.ensure_future(ask())
        await asyncio.shield(task)

    # --- The fleet ---

    def _on_stated_roster(self, link: StreamLink, body: str) -> None:
        try:
            told = jsontext.read(body)
        except jsontext.Invalid:
            return
        version = told.get("version") if isinstance(told, dict) else None
        if self.fleet is not None and isinstance(version, int) and version > self.fleet.version:
            self._run(self._fetch_roster(link))

    async def _fetch_roster(self, link: StreamLink) -> None:
        def offer(_: Any, reply: Reply) -> None:
            if self.fleet is not None:
                self.fleet.offer(reply.body)
        try:
            await self.ask_on(link, "PULL", "self:cles/roster", on_reply=offer)
        except (Error, RefusedError) as error:
            self.log.warning("did not get the roster of %s: %s", link.session.peer.name, error)

    def _on_roster(self, former: Roster) -> None:
        fleet = self.fleet
        assert fleet is not None
        is_member = fleet.roster.by_key.get(fleet.own_key) is not None
        for link in list(self._open):
            if isinstance(link, StreamLink) and not link.has_session:
                continue
            name = link.session.peer.name
            before, now = former.by_name.get(name), fleet.roster.by_name.get(name)
            if not is_member or (name and (now is None or before is None or
                                           (now.number, now.key) != (before.number, before.key))):
                link.close()
                continue
            link.session.serving.drop_forbidden_bindings()
            if isinstance(link, StreamLink) and link.transport_name == "tls":
                link.session.put(f'PUSH self:cles/hello reply=no {{"version":{fleet.version},"epoch":"{self.core.epoch}"}}')
                link.flush()

    async def _watch_files(self) -> None:
        assert self.fleet is not None
        while True:
            await asyncio.sleep(1)
            self.fleet.check_files()

    # --- The pool ---

    async def _stay_in_pool(self, url: str) -> None:
        """Tells a node of the pool where this one is; the others learn it from that node."""
        key = self._address("", url)
        told = ""
        try:
            while True:
                try:
                    link = await self._link_at((*key, 0), self.core.now() + int(self.limits.connect * 1e9))
                    await self.ask_on(link, "PUSH", "self:cles/peers", self.core.entry())
                    told = ""
                except (Error, RefusedError) as error:
                    if str(error) != told:
                        self.log.warning("%s does not take this node into its pool: %s", url, error)
                    told = str(error)
                await asyncio.sleep(INTERVAL_MS / 1000 * random.uniform(0.75, 1))
        finally:
            known = self._links.get((*key, 0))
            if known is not None and known.usable:
                known.session.put(grammar.request_line("PUSH", "self:cles/peers", self.core.entry(leaving=True), wants_reply=False))
                known.flush()


def _remove_stale(path: str) -> None:
    """Removes a socket file that a process has left which was killed."""
    try:
        if not stat.S_ISSOCK(os.lstat(path).st_mode):
            return  # `bind` says what is wrong
    except OSError:
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(path)
        except ConnectionRefusedError:
            os.unlink(path)
        except OSError:
            pass  # there is none, or `bind` says what is wrong


@contextlib.asynccontextmanager
async def connect(url: str, *, keys: str | os.PathLike[str] | None = None, name: str | None = None,
                  limits: Limits | None = None) -> AsyncIterator[Node]:
    """A client of the node at this URL, which sends it all requests: `async with cles.connect("tcp://127.0.0.1") as car`."""
    async with Node(name, through=url, keys=keys, limits=limits) as node:
        yield node
