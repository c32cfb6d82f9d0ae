"""Raw frames from the logs of other programs, and such frames on a bus again.

python-can reads the formats of Vector and PEAK. It leaves out what it does not understand, so every
line that holds a frame has to come back as one. candump's lines are read here: python-can's reader
takes an error frame for data, and four digits for an identifier of 29 bits.
"""

from __future__ import annotations

import io
import logging
import re
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import can
import numpy as np
from numpy.typing import NDArray

from duoglide.errors import BusError, DuoglideError, LogError
from duoglide.playback._blf import require_whole

SUFFIXES = (".log", ".asc", ".blf", ".trc")
"""Of the files that are read here, in small letters or capitals."""

_CANDUMP = re.compile(
    r"\((?P<stamp>\d{1,12}\.\d{1,9})\)\s+(?P<channel>[!-~]{1,32})\s+"
    r"(?P<id>[0-9A-F]{3}|[0-9A-F]{8})#(?P<data>(?:[0-9A-F]{2}){0,8})(?:\s+[RT])?",
    re.IGNORECASE | re.ASCII,
)
_CANDUMP_OTHER = re.compile(
    r"\(\d+\.\d+\)\s+(?P<channel>[!-~]{1,32})\s+[0-9A-F]+#(?P<kind>R|#)\S*(?:\s+[RT])?",
    re.IGNORECASE | re.ASCII,
)
_ASC_STATUS = frozenset(("Statistic", "Status", "J1939TP", "OverloadFrame"))
_TRC_STATUS = frozenset(("FFFFFFFF", "Warng", "Error", "ER", "ST", "EC", "EV"))
_ERROR_FLAG = 0x2000_0000  # candump marks error frames with it
_FLAGS_FROM = 0x4000_0000
_LARGEST_ID = {False: 0x7FF, True: 0x1FFF_FFFF}
_BACK = 1e-3  # [s]: frames may be noted this much out of order
_PAUSE = 3600.0  # [s]: a longer one is a clock that was set
_AT_ONCE = 4096
_ROW = np.dtype(
    [
        ("stamp", "f8"),
        ("can_id", "u4"),
        ("extended", "?"),
        ("size", "u1"),
        ("data", "<u8"),
        ("channel", "u2"),
    ]
)


@dataclass(frozen=True, slots=True)
class Frame:
    """A classic CAN frame.

    Attributes:
        stamp: When [s], since 1970 or since anything else.
        can_id: 11 bits, or 29 if ``extended``.
        data: 0 to 8 bytes.
        extended: Whether the identifier has 29 bits.
    """

    stamp: float
    can_id: int
    data: bytes
    extended: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class FrameLog:
    """The frames of one interface, read and judged as a whole.

    Attributes:
        channel: What the log calls the interface.
        skipped: How many error frames and lines on the bus's state were left out.
    """

    channel: str
    skipped: int
    _rows: NDArray[Any]

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[Frame]:
        for start in range(0, len(self._rows), _AT_ONCE):
            rows = self._rows[start : start + _AT_ONCE].tolist()
            for stamp, can_id, extended, size, data, _ in rows:
                yield Frame(stamp, can_id, data.to_bytes(8, "little")[:size], extended)


class _Read(NamedTuple):
    """A frame as it was read, and where."""

    where: str
    channel: str
    message: can.Message


def read_frames(file: str | Path, channel: str | None = None) -> FrameLog:
    """Read the frames of one interface from a log of candump, Vector (asc, blf) or PEAK (trc).

    Error frames and lines on the state of the bus are left out and counted. All else is read
    exactly, or the log is refused.

    Args:
        file: The log; its suffix says which kind it is.
        channel: Which interface; None where it holds the frames of one only.

    Raises:
        LogError: No such file, none of these kinds, a line that is no frame, a frame that cannot
            be sent (remote, CAN FD, an identifier out of range), times that do not fit, or
            several interfaces and none chosen; says where.
    """
    path = Path(file)
    readers = {".log": _candump, ".asc": _asc, ".blf": _blf, ".trc": _trc}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise LogError(f"{file}: frames are read from {', '.join(SUFFIXES)} only")
    skipped: Counter[str] = Counter()
    names: dict[str, int] = {}
    counts: Counter[str] = Counter()

    def rows() -> Iterator[tuple[float, int, bool, int, int, int]]:
        before = None
        for where, name, message in reader(path, skipped):
            if message.is_error_frame:
                skipped["error"] += 1
                continue
            counts[name] += 1
            if channel not in (None, name):
                continue
            before = _judge(message, where, before)
            data = int.from_bytes(message.data, "little")
            yield (
                message.timestamp,
                message.arbitration_id,
                message.is_extended_id,
                message.dlc,
                data,
                names.setdefault(name, len(names)),
            )

    try:
        if not path.is_file():
            raise FileNotFoundError(None, "no such file")
        table = np.fromiter(rows(), dtype=_ROW)
    except OSError as error:
        raise LogError(f"cannot read {file}: {error.strerror or error}") from error
    except LogError as error:
        raise LogError(f"{file}: {error}") from error
    _require_one(file, channel, counts)
    return FrameLog(next(iter(names)), skipped.total(), table)


def _require_one(file: str | Path, channel: str | None, counts: Counter[str]) -> None:
    """Refuse a log without frames of the interface, and one of several where none is chosen."""
    held = ", ".join(f"{name}: {count}" for name, count in counts.items())
    if not counts:
        raise LogError(f"{file} holds no frame")
    if channel is None and len(counts) > 1:
        name = next(iter(counts))
        raise LogError(
            f"{file} holds frames of {len(counts)} interfaces ({held:.200});"
            f" --channel {name} takes those of one"
        )
    if channel is not None and channel not in counts:
        raise LogError(f"{file} holds no frame of interface {channel} ({held:.200})")


def _judge(message: can.Message, where: str, before: float | None) -> float:
    """Refuse a frame that cannot be sent as it was; return its time."""
    largest = _LARGEST_ID[message.is_extended_id]
    if message.is_remote_frame or message.is_fd:
        kind = "remote" if message.is_remote_frame else "CAN FD"
        raise LogError(f"{where}: a {kind} frame; only classic data frames can be replayed")
    if not 0 <= message.arbitration_id <= largest:
        bits = 29 if message.is_extended_id else 11
        raise LogError(
            f"{where}: identifier {message.arbitration_id:X} has more than {bits} bits"
            f" (at most {largest:X})"
        )
    if message.dlc > 8 or len(message.data) != message.dlc:
        raise LogError(f"{where}: {len(message.data)} bytes of data, {message.dlc} are announced")
    if not 0.0 <= message.timestamp < 1e12:
        raise LogError(f"{where}: a time of {message.timestamp:g} s")
    if before is None:
        return message.timestamp
    step = message.timestamp - before
    if step < -_BACK:
        raise LogError(f"{where}: its time is {-step:g} s before that of the frame it follows")
    if step > _PAUSE:
        raise LogError(
            f"{where}: its time is {step:g} s after that of the frame it follows; the clock was set"
        )
    return max(message.timestamp, before)


def _candump(file: Path, skipped: Counter[str]) -> Iterator[_Read]:
    """Read ``candump -L``."""
    with file.open("rb") as stream:
        for number, raw in enumerate(stream, 1):
            text = raw.decode("ascii", "replace").strip()
            where = f"line {number}"
            if match := _CANDUMP.fullmatch(text):
                can_id, extended = int(match["id"], 16), len(match["id"]) == 8
                error = extended and _ERROR_FLAG <= can_id < _FLAGS_FROM
                data = bytes.fromhex(match["data"])
                message = can.Message(
                    timestamp=float(match["stamp"]),
                    arbitration_id=can_id,
                    is_extended_id=extended,
                    is_error_frame=error,
                    data=data,
                )
                yield _Read(where, match["channel"], message)
            elif other := _CANDUMP_OTHER.fullmatch(text):
                remote = other["kind"] != "#"
                kind = can.Message(is_remote_frame=remote, is_fd=not remote)
                yield _Read(where, other["channel"], kind)
            elif text:
                raise LogError(
                    f"{where}: {text[:60]!r} is no frame as `candump -L` writes it,"
                    " (1700000000.000000) can0 123#00"
                )
            if text and not raw.endswith(b"\n"):
                raise _cut(where, text)


def _cut(where: str, text: str) -> LogError:
    """Say that the last line may be only the beginning of one, of other data."""
    return LogError(
        f"{where}: {text[:60]!r} has no end of line, so that the log may be cut within it; delete"
        " the line, or end it"
    )


class _Lines(io.TextIOWrapper):
    """The lines of a text file, which remembers those that hold a frame until it was read."""

    def __init__(self, file: io.BufferedReader, holds_frame: Callable[[str], bool]) -> None:
        super().__init__(file, encoding="ascii", errors="replace")
        self._holds_frame = holds_frame
        self._number = 0
        self._waiting: list[tuple[int, str]] = []

    def __next__(self) -> str:  # type: ignore[override]  # typeshed calls it the bytes of IOBase
        line = super().__next__()
        self._number += 1
        if self._holds_frame(line.strip()):
            if not line.endswith("\n"):
                raise _cut(f"line {self._number}", line.strip())
            self._waiting.append((self._number, line.strip()))
        return line

    @property
    def where(self) -> str:
        return f"line {self._number}"

    def require_none_left(self, allowed: int) -> None:
        """Refuse a line whose frame the reader has left out."""
        if len(self._waiting) != allowed:
            number, text = self._waiting[0] if self._waiting else (self._number, "")
            raise LogError(f"line {number}: {text[:60]!r} cannot be read as a frame")
        self._waiting.clear()


def _asc(file: Path, skipped: Counter[str]) -> Iterator[_Read]:
    """Read what Vector's tools write as text."""

    def holds_frame(line: str) -> bool:
        if not line[:1].isdecimal():
            return False  # of the head, a comment, a block
        words = line.split(maxsplit=3)
        channel, event = (*words[1:3], "", "")[:2]
        other = not channel.isdecimal() and channel != "CANFD"  # of another bus, of the tool
        status = other or event.rstrip(":") in _ASC_STATUS
        skipped["status"] += status
        return not status

    with file.open("rb") as stream, _Lines(stream, holds_frame) as lines:
        reader = can.ASCReader(lines)
        for message in _guarded(reader, lambda: lines.where):
            _require_asc_header(reader)
            lines.require_none_left(1)
            yield _Read(lines.where, _numbered(message), message)
        lines.require_none_left(0)


def _require_asc_header(reader: can.ASCReader) -> None:
    """Refuse a head that leaves open what the numbers and the times mean."""
    if reader.timestamps_format is None:
        raise LogError("its head does not say `base hex` or `base dec`")
    if reader.timestamps_format.lower() == "relative":
        raise LogError("its times count from the line before; save it with absolute ones")


def _trc(file: Path, skipped: Counter[str]) -> Iterator[_Read]:
    """Read what PEAK's tools write."""

    def holds_frame(line: str) -> bool:
        if not line or line.startswith(";"):
            return False
        status = not _TRC_STATUS.isdisjoint(line.split()[2:4])
        skipped["status"] += status
        return not status

    with file.open("rb") as stream:
        head = stream.read(4096).decode("ascii", "replace")
        version = re.search(r"^;\$FILEVERSION=(\S+)", head, re.MULTILINE)
        if version and version[1] not in ("1.1", "1.3", "2.0", "2.1"):
            raise LogError(
                f"its version {version[1][:10]!r} is not read; 1.1, 1.3, 2.0 and 2.1 are"
            )
        stream.seek(0)
        with _Lines(stream, holds_frame) as lines:
            for message in _guarded(can.TRCReader(lines), lambda: lines.where):
                lines.require_none_left(1)
                yield _Read(lines.where, str(message.channel), message)
            lines.require_none_left(0)


def _blf(file: Path, skipped: Counter[str]) -> Iterator[_Read]:
    """Read what Vector's tools write as bytes."""
    with file.open("rb") as stream:
        expected = require_whole(stream)
        stream.seek(0)
        number = 0

        def where() -> str:
            return f"frame {number}"

        for message in _guarded(can.BLFReader(stream), where):
            number += 1
            yield _Read(where(), _numbered(message), message)
    if number != expected:
        raise LogError(f"{number} frames of {expected} can be read: the file is damaged")


def _numbered(message: can.Message) -> str:
    """Return the channel as Vector's tools count it; python-can counts from 0."""
    return str(message.channel + 1) if isinstance(message.channel, int) else "1"


def _guarded(reader: Iterable[can.Message], where: Callable[[], str]) -> Iterator[can.Message]:
    """Read with a reader of python-can, which raises what comes of damaged text and bytes."""
    with _quiet():
        try:
            yield from reader
        except (DuoglideError, OSError):
            raise
        except Exception as error:  # a reader of others on bytes of others
            raise LogError(f"{where()}: cannot be read: {error!r:.100}") from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep python-can from writing to stderr what is refused anyway."""
    logger, handler = logging.getLogger("can.io"), logging.NullHandler()
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


def play(
    frames: Iterable[Frame],
    bus: can.BusABC,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> int:
    """Send frames with the time between them that they had, on absolute deadlines.

    A frame that is late does not delay those after it.

    Args:
        frames: What to send, in order.
        bus: Where.
        clock: What time it is [s].
        sleep: How to wait [s].

    Returns:
        How many were sent.

    Raises:
        BusError: The bus does not take a frame.
    """
    offset: float | None = None
    count = 0
    for frame in frames:
        if offset is None:
            offset = clock() - frame.stamp
        if (wait := frame.stamp + offset - clock()) > 0.0:
            sleep(wait)
        message = can.Message(
            arbitration_id=frame.can_id, data=frame.data, is_extended_id=frame.extended
        )
        try:
            bus.send(message)
        except can.CanError as error:
            raise BusError(
                f"frame {count + 1} (0x{frame.can_id:X}) was not sent: {error}"
            ) from error
        count += 1
    return count
