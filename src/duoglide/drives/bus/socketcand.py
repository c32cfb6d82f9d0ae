"""The socketcand protocol in raw mode: its messages, and a client that is quick and quiet.

``< send ID LENGTH BYTE ... >`` goes to the server, ``< frame ID SECONDS DATA >`` comes from it
(https://github.com/linux-can/socketcand, doc/protocol.md). TCP cuts and joins messages as it
likes: what counts is the brackets. python-can has a client too; it reads 1 kB at a time and
writes a warning for every message that is cut, which at 8000 frames a second is no use.
"""

from __future__ import annotations

import select
import socket
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence

import can

from duoglide.drives.pdo import ERROR_FRAME

Frame = tuple[int, bytes]  # identifier, data

LOOPBACK = "127.0.0.1"
EXTENDED = 1 << 31  # set in the identifier of a 29-bit frame, as SocketCAN has it
_EXTENDED_IDS = 1 << 29
_STANDARD_IDS = 1 << 11
_STANDARD_DIGITS = 3
_WRITE_PATIENCE = 0.1  # how long a send may wait for room in the socket [s]


def encode_send(can_id: int, data: bytes | bytearray) -> bytes:
    """Return the message by which a client sends a frame."""
    return f"< send {_name(can_id)} {len(data):X} {data.hex(' ')} >".encode()


def encode_frame(can_id: int, data: bytes | bytearray, seconds: float) -> bytes:
    """Return the message by which the server hands a frame on."""
    return f"< frame {_name(can_id)} {seconds:.6f} {data.hex()} >".encode()


def _name(can_id: int) -> str:
    """Write an identifier: the number of digits says whether it is extended."""
    return f"{can_id & ~EXTENDED:08X}" if can_id & EXTENDED else f"{can_id:03X}"


def decode_send(words: list[bytes]) -> Frame:
    """Read the words of a ``send`` message.

    Raises:
        ValueError: Not a frame: no such identifier, or another number of bytes than it says.
    """
    data = bytes([int(word, 16) for word in words[3:]])
    can_id, extended = int(words[1], 16), len(words[1]) > _STANDARD_DIGITS
    known = 0 <= can_id < (_EXTENDED_IDS if extended else _STANDARD_IDS)
    if len(data) != int(words[2], 16) or len(data) > 8 or not known:
        raise ValueError(f"not a frame: {b' '.join(words)!r}")
    return can_id | EXTENDED if extended else can_id, data


def decode_received(words: list[bytes]) -> Frame | None:
    """Read the words of a message from a server: a ``frame``, or an ``error`` frame.

    An error frame comes as ``ERROR_FRAME``, and its data begins with the low byte of its
    identifier. What a server says beside frames, or says wrongly, is None: it is data from outside
    and must not end whoever reads it. A frame that was meant is then missed like any lost one.
    """
    if len(words) < 3 or words[0] not in (b"frame", b"error") or not words[1].isalnum():
        return None
    try:
        can_id = int(words[1], 16)
        data = bytes.fromhex(b"".join(words[3:]).decode())
    except ValueError:
        return None
    if words[0] == b"error":
        return ERROR_FRAME, bytes((can_id & 0xFF,)) + data[:8]
    extended = len(words[1]) > _STANDARD_DIGITS
    if len(data) > 8 or can_id >= (_EXTENDED_IDS if extended else _STANDARD_IDS):
        return None
    return can_id | EXTENDED if extended else can_id, data


def local_name(port: int) -> str | None:
    """Return where a hub on this computer listens beside its TCP port; None where it cannot.

    An abstract Unix socket: handing over a cycle's frames takes less of the streamer's time.
    """
    return f"\0duoglide-hub-{port}" if sys.platform == "linux" else None


def _connect(host: str, port: int, timeout: float) -> socket.socket:
    """Connect to a server; to a hub on this computer without the detour over TCP."""
    name = local_name(port)
    if host == LOOPBACK and name is not None:
        local = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        local.settimeout(timeout)
        try:
            local.connect(name)
            return local
        except OSError:  # not one of ours
            local.close()
    connection = socket.create_connection((host, port), timeout)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


def _seconds(text: bytes) -> float:
    """Read a time stamp; 0 where it is none."""
    try:
        return float(text)
    except ValueError:
        return 0.0


class MessageSplitter:
    """Cuts a stream of bytes into the words of its bracketed messages."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[list[bytes]]:
        """Return the words of every message that is complete now, brackets taken off."""
        *whole, self._rest = (self._rest + data).split(b">")
        if len(self._rest) > 4096:  # no message is that long: this is not socketcand
            self._rest = b""
        return [words for text in whole if (words := text[text.find(b"<") + 1 :].split())]


class SocketcandBus(can.BusABC):
    """A CAN bus behind a socketcand server.

    Args:
        host: Name or address of the server.
        port: Its TCP port.
        channel: The interface that it shall open.
        timeout: How long to wait for the connection and each answer [s].
        can_filters: As in python-can.

    Raises:
        OSError: No connection.
        can.CanInitializationError: The server does not speak the protocol or refuses the channel.
    """

    def __init__(
        self,
        host: str,
        port: int,
        channel: str = "can0",
        timeout: float = 5.0,
        can_filters: can.typechecking.CanFilters | None = None,
    ) -> None:
        self._splitter = MessageSplitter()
        self._received: deque[can.Message] = deque()
        self.channel_info = f"socketcand {channel} at {host}:{port}"
        self._channel = channel
        self._socket = _connect(host, port, timeout)
        try:
            self._shake_hands(timeout)
        except (OSError, can.CanError):
            self._socket.close()
            raise
        self._socket.setblocking(False)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)
        super().__init__(channel=channel, can_filters=can_filters)

    def _shake_hands(self, timeout: float) -> None:
        self._expect(b"hi", timeout)
        for request in (f"< open {self._channel} >", "< rawmode >"):
            self._socket.sendall(request.encode())
            self._expect(b"ok", timeout)

    def _expect(self, word: bytes, timeout: float) -> None:
        """Wait for one answer; frames that come merged with it are kept."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            data = self._socket.recv(4096)
            if not data:
                break
            messages = self._splitter.feed(data)
            self._received.extend(self._messages(messages))
            answers = [m for m in messages if m[0] != b"frame"]
            if answers and answers[0][0] == word:
                return
            if answers:
                text = b" ".join(answers[0]).decode("ascii", "replace")
                raise can.CanInitializationError(f"{self.channel_info} answered {text!r}")
        raise can.CanInitializationError(f"{self.channel_info} does not speak socketcand")

    def _messages(self, messages: list[list[bytes]]) -> Iterator[can.Message]:
        """Yield the frames among a server's messages."""
        for words in messages:
            frame = decode_received(words)
            if frame is None:
                continue
            can_id, data = frame
            failed = can_id == ERROR_FRAME
            yield can.Message(
                timestamp=_seconds(words[2]),
                arbitration_id=data[0] if failed else can_id & ~EXTENDED,
                is_extended_id=not failed and bool(can_id & EXTENDED),
                is_error_frame=failed,
                data=data[1:] if failed else data,
                channel=self._channel,
            )

    def fileno(self) -> int:
        """Return the socket's descriptor, to wait on."""
        return self._socket.fileno()

    def receive_frames(self) -> list[Frame]:
        """Return the standard frames that have come, oldest first, without waiting.

        An error frame comes as ``ERROR_FRAME`` and the low byte of its identifier.

        Raises:
            can.CanOperationError: The connection is gone.
        """
        frames = [
            (m.arbitration_id, bytes(m.data))
            for m in self._received
            if not (m.is_extended_id or m.is_error_frame)
        ]
        self._received.clear()
        for words in self._read():
            frame = decode_received(words)
            if frame is not None and frame[0] < EXTENDED:
                frames.append(frame)
        return frames

    def _read(self) -> list[list[bytes]]:
        """Return the messages that have come."""
        try:
            data = self._socket.recv(65536)
        except BlockingIOError:
            return []
        except OSError as error:
            raise can.CanOperationError(f"{self.channel_info}: {error}") from error
        if not data:
            raise can.CanOperationError(f"{self.channel_info} has closed the connection")
        return self._splitter.feed(data)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._received and self._poll.poll(None if timeout is None else timeout * 1e3):
            self._received.extend(self._messages(self._read()))
        return (self._received.popleft() if self._received else None), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one frame.

        Raises:
            can.CanOperationError: As ``send_frames``; or a remote frame, which the protocol lacks.
        """
        if msg.is_remote_frame:
            raise can.CanOperationError("socketcand cannot send remote frames")
        can_id = msg.arbitration_id | (EXTENDED if msg.is_extended_id else 0)
        self._write(encode_send(can_id, bytes(msg.data)))

    def send_frames(self, frames: Sequence[Frame]) -> None:
        """Send several frames by one system call, in their order.

        Raises:
            can.CanOperationError: The connection is gone, or full for a tenth of a second.
        """
        self._write(b"".join([encode_send(can_id, data) for can_id, data in frames]))

    def _write(self, data: bytes) -> None:
        deadline = 0.0
        while True:
            try:
                data = data[self._socket.send(data) :]
            except BlockingIOError:
                deadline = deadline or time.monotonic() + _WRITE_PATIENCE
                left = deadline - time.monotonic()
                if left <= 0.0:
                    raise can.CanOperationError(f"{self.channel_info}: send buffer full") from None
                select.select([], [self._socket], [], left)
            except OSError as error:
                raise can.CanOperationError(f"{self.channel_info}: {error}") from error
            if not data:
                return

    def shutdown(self) -> None:
        """Close the connection."""
        super().shutdown()
        self._socket.close()
