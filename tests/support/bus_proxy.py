"""A proxy between a hub and whoever connects: it loses, delays and changes frames.

It speaks socketcand's raw mode and knows nothing of Duoglide: only the standard library is
imported, so that it can bear witness. Run as a program it takes the hub's port, prints its own, and
reads orders, one JSON object a line, each answered by ``ok``::

    python bus_proxy.py 40001
    {"order": "spoil", "spoilers": [{"way": "drives", "can_id": 513, "act": "drop", "times": 5}]}
    {"order": "send", "way": "host", "frames": [[385, "3712ffffff7f"]]}
    {"order": "raw", "way": "host", "data": "3c206f68203e"}
    {"order": "cut"}

Frames are spoiled only on the connection that sends SYNC: who merely listens hears the truth.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import selectors
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

Way = Literal["host", "drives"]
Frame = tuple[int, bytes]
Act = Literal[
    "drop",  # it never comes
    "hold",  # it comes ``by`` frames of its identifier later, for as long as this lasts
    "late",  # it comes right before the next one
    "swap",  # it comes right after the next one
    "copy",  # it comes ``by`` times
    "cut",  # its first ``by`` bytes come
    "pad",  # it comes with zero bytes up to eight
    "scramble",  # its bytes come as chance has it
    "set",  # the bits ``by`` of its first word are set
    "clear",  # the bits ``by`` of its first word are cleared
    "shift",  # its position comes ``by`` increments farther
    "creep",  # its position comes ``by`` increments farther for each frame
    "shake",  # its position comes up to ``by`` increments off, either way
    "freeze",  # its position comes as it was at first
    "place",  # its position comes as ``by``
]
_WORD = struct.Struct("<H")  # first in the cyclic frames of both ways
_POSITION = struct.Struct("<i")  # then this
_INT32 = 2**31


@dataclass(frozen=True, slots=True)
class Spoiler:
    """What happens to some frames.

    Attributes:
        way: Where they are going.
        act: What happens to them.
        can_id: Their identifier; None for all.
        by: How much, see ``Act``.
        times: To how many; None for all that come.
        after: How many are let through first.
    """

    way: Way
    act: Act
    can_id: int | None = None
    by: int = 0
    times: int | None = 1
    after: int = 0


class BusProxy:
    """A proxy in a process of its own; a context manager.

    Args:
        address: The bus that it stands before, ``socketcand:HOST:PORT``.
    """

    def __init__(self, address: str) -> None:
        self._upstream = address.rsplit(":", 1)[1]

    def __enter__(self) -> BusProxy:
        self._process = subprocess.Popen(
            [sys.executable, "-I", str(Path(__file__)), self._upstream],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.address = f"socketcand:127.0.0.1:{self._read()}"
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def spoil(self, *spoilers: Spoiler) -> None:
        """Let this happen from the next frame on, and nothing else."""
        self._order(order="spoil", spoilers=[asdict(spoiler) for spoiler in spoilers])

    def send(self, way: Way, *frames: Frame) -> None:
        """Send frames of its own."""
        self._order(order="send", way=way, frames=[(i, data.hex()) for i, data in frames])

    def send_raw(self, way: Way, data: bytes) -> None:
        """Send bytes that need not be a message."""
        self._order(order="raw", way=way, data=data.hex())

    def cut(self) -> None:
        """Close the connection that sends SYNC."""
        self._order(order="cut")

    def _order(self, **what: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(what) + "\n")
        self._process.stdin.flush()
        answer = self._read()
        if answer != "ok":
            raise RuntimeError(f"the proxy says {answer!r}")

    def _read(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()


# The process


@dataclass(slots=True)
class _Active:
    """A spoiler at work."""

    rule: Spoiler
    seen: int = 0
    first: int | None = None  # the position that it saw first

    def spoils(self, way: Way, can_id: int) -> bool:
        """Count a frame; whether it is one of those that are spoiled."""
        if way != self.rule.way or self.rule.can_id not in (None, can_id):
            return False
        self.seen += 1
        return self.acted > 0 and (self.rule.times is None or self.acted <= self.rule.times)

    @property
    def acted(self) -> int:
        """How many frames have been spoiled, this one counted; not above 0 before it begins."""
        return self.seen - self.rule.after

    def keep_first(self, position: int) -> int:
        """Return the position that came first."""
        self.first = position if self.first is None else self.first
        return self.first


class _Spoiling:
    """All that happens to the frames of one connection."""

    def __init__(self) -> None:
        self._active: list[_Active] = []
        self._held: dict[tuple[Way, int], list[Frame]] = {}
        self._before: dict[tuple[Way, int], list[Frame]] = {}
        self._behind: dict[tuple[Way, int], list[Frame]] = {}
        self._chance = random.Random(1)

    def begin(self, spoilers: list[Spoiler]) -> None:
        """Forget the spoilers that were; frames that they keep back come with the next ones."""
        self._held.clear()
        self._active = [_Active(rule) for rule in spoilers]

    def pass_on(self, way: Way, frame: Frame) -> list[Frame]:
        """Return the frames that come instead of one, in their order."""
        key = (way, frame[0])
        before, behind = self._before.pop(key, []), self._behind.pop(key, [])
        came = [frame]
        for active in [active for active in self._active if active.spoils(way, frame[0])]:
            came = [out for one in came for out in self._spoil(active, key, one)]
        return [*before, *came, *behind]

    def _spoil(self, active: _Active, key: tuple[Way, int], frame: Frame) -> list[Frame]:
        by = active.rule.by
        match active.rule.act:
            case "drop":
                return []
            case "hold":
                queue = self._held.setdefault(key, [])
                queue.append(frame)
                return [queue.pop(0)] if len(queue) > by else []
            case "late" | "swap" as act:
                (self._before if act == "late" else self._behind)[key] = [frame]
                return []
            case "copy":
                return [frame] * by
        return [(frame[0], self._change(active, frame[1]))]

    def _change(self, active: _Active, data: bytes) -> bytes:
        """Return other bytes for a frame's."""
        by, chance = active.rule.by, self._chance
        changes: dict[Act, Callable[[], bytes]] = {
            "cut": lambda: data[:by],
            "pad": lambda: data.ljust(8, b"\0"),
            "scramble": lambda: chance.randbytes(len(data)),
            "set": lambda: _change_word(data, lambda word: word | by),
            "clear": lambda: _change_word(data, lambda word: word & ~by & 0xFFFF),
            "shift": lambda: _change_position(data, lambda place: place + by),
            "creep": lambda: _change_position(data, lambda place: place + by * active.acted),
            "shake": lambda: _change_position(data, lambda place: place + chance.randint(-by, by)),
            "freeze": lambda: _change_position(data, active.keep_first),
            "place": lambda: _change_position(data, lambda place: by),
        }
        return changes[active.rule.act]()


def _change_word(data: bytes, change: Callable[[int], int]) -> bytes:
    """Change the status- or controlword of a frame that has one."""
    if len(data) < _WORD.size:
        return data
    return _WORD.pack(change(_WORD.unpack_from(data)[0])) + data[2:]


def _change_position(data: bytes, change: Callable[[int], int]) -> bytes:
    """Change the position of a frame that has one, as far as 32 bits go."""
    if len(data) < _WORD.size + _POSITION.size:
        return data
    position = min(max(change(_POSITION.unpack_from(data, 2)[0]), -_INT32), _INT32 - 1)
    return data[:2] + _POSITION.pack(position) + data[6:]


class _Pair:
    """A client and its connection to the hub."""

    def __init__(self, client: socket.socket, upstream: int) -> None:
        self.sockets: dict[Way, socket.socket] = {
            "host": client,
            "drives": socket.create_connection(("127.0.0.1", upstream)),
        }
        for end in self.sockets.values():
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.rest: dict[Way, bytes] = {"host": b"", "drives": b""}
        self.leads = False  # sends SYNC
        self.spoiling = _Spoiling()

    def pump(self, way: Way) -> bool:
        """Carry what has come on its way; False where an end has closed."""
        source = self.sockets["drives" if way == "host" else "host"]
        try:
            data = source.recv(65536)
            if not data:
                return False
            *whole, self.rest[way] = (self.rest[way] + data).split(b">")
            self.sockets[way].sendall(b"".join(self._carry(way, text) for text in whole))
        except OSError:
            return False
        return True

    def _carry(self, way: Way, text: bytes) -> bytes:
        words = text[text.find(b"<") + 1 :].split()
        if words[:1] != [b"frame" if way == "host" else b"send"]:
            return text + b">"
        data = bytes.fromhex(b"".join(words[3:]).decode())
        can_id = int(words[1], 16)
        self.leads |= way == "drives" and can_id == 0x80
        if not self.leads or len(words[1]) > 3:
            return text + b">"
        came = self.spoiling.pass_on(way, (can_id, data))
        return b"".join(encode(way, frame) for frame in came)


def encode(way: Way, frame: Frame) -> bytes:
    """Return the message that carries a frame to the host (from the hub) or to the drives."""
    can_id, data = frame
    if way == "host":
        return f"< frame {can_id:03X} {time.time():.6f} {data.hex()} >".encode()
    return f"< send {can_id:03X} {len(data):X} {data.hex(' ')} >".encode()


class _Proxy:
    """The process's whole work."""

    def __init__(self, upstream: int) -> None:
        self._upstream = upstream
        self._pairs: list[_Pair] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._selector.register(0, selectors.EVENT_READ)
        self._typed = b""

    def run(self) -> None:
        """Serve until standard input closes."""
        print(self._listener.getsockname()[1], flush=True)
        while True:
            for key, _ in self._selector.select():
                if key.fileobj is self._listener:
                    self._accept()
                elif key.fileobj == 0:
                    typed = os.read(0, 65536)
                    if not typed:
                        return
                    *lines, self._typed = (self._typed + typed).split(b"\n")
                    for line in lines:
                        self._obey(json.loads(line))
                        print("ok", flush=True)
                else:
                    pair, way = key.data
                    if pair in self._pairs and not pair.pump(way):
                        self._close(pair)

    def _accept(self) -> None:
        client, _ = self._listener.accept()
        try:
            pair = _Pair(client, self._upstream)
        except OSError:  # the hub has gone
            client.close()
            return
        self._pairs.append(pair)
        for end, way in (("host", "drives"), ("drives", "host")):
            self._selector.register(pair.sockets[end], selectors.EVENT_READ, (pair, way))  # type: ignore[index]

    def _close(self, pair: _Pair) -> None:
        for end in pair.sockets.values():
            self._selector.unregister(end)
            end.close()
        self._pairs.remove(pair)

    def _obey(self, order: dict[str, Any]) -> None:
        for pair in [pair for pair in self._pairs if pair.leads]:
            match order["order"]:
                case "spoil":
                    pair.spoiling.begin([Spoiler(**spoiler) for spoiler in order["spoilers"]])
                case "send":
                    frames = [(i, bytes.fromhex(data)) for i, data in order["frames"]]
                    messages = b"".join(encode(order["way"], frame) for frame in frames)
                    pair.sockets[order["way"]].sendall(messages)
                case "raw":
                    pair.sockets[order["way"]].sendall(bytes.fromhex(order["data"]))
                case "cut":
                    self._close(pair)


if __name__ == "__main__":
    with contextlib.suppress(OSError, AttributeError):  # an ordinary user may not
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(2))
    _Proxy(int(sys.argv[1])).run()
