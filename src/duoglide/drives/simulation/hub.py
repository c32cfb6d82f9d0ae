"""A CAN bus on the loopback: a TCP server that speaks socketcand's protocol in raw mode.

Clients on Linux that know Duoglide's hub come through a Unix socket beside the TCP port.

Every client hears every other client and the station in this process, in one order. Frames for a
client are collected and written once a turn. One thread, no locks.
"""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable
from typing import Protocol

from duoglide.drives.bus.socketcand import (
    LOOPBACK,
    MessageSplitter,
    decode_send,
    encode_frame,
    local_name,
)
from duoglide.errors import BusError

_MOST_WAITING = 4_000_000  # bytes that a client may leave unread before it is dropped
_SETTLING = 0.05  # python-can's client fails if a frame comes in one segment with the last "ok" [s]


class Station(Protocol):
    """A participant in the hub's own process."""

    def attach(self, send: Callable[[int, bytes], None]) -> None:
        """Learn where to send."""

    @property
    def patience(self) -> float:
        """How long it may be left alone [s]."""

    def receive(self, can_id: int, data: bytes, now: int, behind: int = 0) -> None:
        """Take a frame at ``now`` [us]; so many SYNCs are known to wait ``behind`` it."""

    def poll(self, now: int) -> None:
        """Let time pass."""

    def abandon(self) -> None:
        """Learn that the client that sent SYNC is gone."""


class _Client:
    """One connection."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        self.splitter = MessageSplitter()
        self.waiting = bytearray(b"< hi >")
        self.frames = bytearray()  # kept apart until the handshake has settled
        self.listens = False
        self.raw_since = 0.0
        self.settled = False
        self.leads = False  # sends SYNC

    def flush(self) -> bool:
        """Write what can be written; False if the client is gone or does not read."""
        if self.listens and not self.settled:
            self.settled = time.monotonic() - self.raw_since > _SETTLING
        if self.settled and self.frames:
            self.waiting += self.frames
            self.frames.clear()
        if self.waiting:
            try:
                del self.waiting[: self.socket.send(self.waiting)]
            except BlockingIOError:
                pass
            except OSError:
                return False
        return len(self.waiting) + len(self.frames) < _MOST_WAITING


class Hub:
    """The server; a context manager.

    Args:
        station: The participant in this process.
        port: TCP port on 127.0.0.1; 0 picks a free one.
    """

    def __init__(self, station: Station, port: int = 0) -> None:
        self._station = station
        self._port = port
        self._clients: dict[int, _Client] = {}
        self._watched: dict[int, Callable[[], None]] = {}
        self.frames = 0  # handled so far

    def __enter__(self) -> Hub:
        try:
            tcp = socket.create_server((LOOPBACK, self._port), backlog=16)
        except OSError as error:
            raise BusError(f"cannot listen on {LOOPBACK}:{self._port}: {error}") from error
        self._port = tcp.getsockname()[1]
        self._listeners = {listener.fileno(): listener for listener in (tcp, *_local(self._port))}
        self._epoll = select.epoll()
        for listener in self._listeners.values():
            listener.setblocking(False)
            self._epoll.register(listener, select.EPOLLIN)
        self._station.attach(self.broadcast)
        return self

    def __exit__(self, *_: object) -> None:
        for client in self._clients.values():
            client.socket.close()
        self._clients.clear()
        self._epoll.close()
        for listener in self._listeners.values():
            listener.close()

    @property
    def address(self) -> str:
        """The name of this bus for ``open_bus``."""
        return f"socketcand:{LOOPBACK}:{self._port}"

    @property
    def clients(self) -> int:
        """How many are connected."""
        return len(self._clients)

    def watch(self, descriptor: int, ready: Callable[[], None]) -> None:
        """Call ``ready`` when something can be read from ``descriptor``."""
        self._watched[descriptor] = ready
        self._epoll.register(descriptor, select.EPOLLIN)

    def forget(self, descriptor: int) -> None:
        """Stop watching a descriptor."""
        del self._watched[descriptor]
        self._epoll.unregister(descriptor)

    def broadcast(self, can_id: int, data: bytes, sender: _Client | None = None) -> None:
        """Hand a frame to every client but the one that sent it."""
        self.frames += 1
        listeners = [c for c in self._clients.values() if c is not sender and c.listens]
        if listeners:
            message = encode_frame(can_id, data, time.time())
            for client in listeners:
                client.frames += message

    def turn(self) -> None:
        """Wait for something to happen, deal with it, let time pass, write."""
        now = time.monotonic_ns() // 1000  # before looking: all that came until now will be read
        ready = self._epoll.poll(self._station.patience)
        for descriptor, _ in ready:
            if descriptor in self._clients:
                self._read(descriptor)
            elif descriptor in self._watched:
                self._watched[descriptor]()
            else:
                self._accept(self._listeners[descriptor])
        self._station.poll(now)
        for descriptor, client in list(self._clients.items()):
            if not client.flush():
                self._drop(descriptor)

    def _accept(self, listener: socket.socket) -> None:
        connection, _ = listener.accept()
        connection.setblocking(False)
        if connection.family == socket.AF_INET:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._clients[connection.fileno()] = _Client(connection)
        self._epoll.register(connection, select.EPOLLIN)

    def _drop(self, descriptor: int) -> None:
        client = self._clients.pop(descriptor)
        self._epoll.unregister(descriptor)
        client.socket.close()
        if client.leads:
            self._station.abandon()

    def _read(self, descriptor: int) -> None:
        client = self._clients[descriptor]
        try:
            data = client.socket.recv(65536)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._drop(descriptor)
            return
        now = time.monotonic_ns() // 1000
        waiting = list(client.splitter.feed(data))
        syncs = sum(map(_is_sync, waiting))
        for words in waiting:
            if words[0] == b"send":
                if _is_sync(words):
                    client.leads = True
                    syncs -= 1
                self._frame(client, words, now, syncs)
            else:
                self._answer(client, words[0])

    def _frame(self, client: _Client, words: list[bytes], now: int, behind: int) -> None:
        try:
            can_id, data = decode_send(words)
        except (ValueError, IndexError):
            client.waiting += b"< error could not parse frame >"
            return
        client.settled = True
        self.broadcast(can_id, data, client)
        self._station.receive(can_id, data, now, behind)

    def _answer(self, client: _Client, word: bytes) -> None:
        if word == b"rawmode":
            client.listens, client.raw_since = True, time.monotonic()
        known = word in (b"open", b"rawmode")
        client.waiting += b"< ok >" if known else b"< echo >" if word == b"echo" else b"< error >"


def _local(port: int) -> tuple[socket.socket, ...]:
    """Listen beside a TCP port; nowhere if that cannot be, for clients come by TCP then."""
    name = local_name(port)
    if name is None:
        return ()
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        listener.bind(name)
    except OSError:
        listener.close()
        return ()
    listener.listen(16)
    return (listener,)


def _is_sync(words: list[bytes]) -> bool:
    return words[0] == b"send" and words[1:2] in ([b"80"], [b"080"])
