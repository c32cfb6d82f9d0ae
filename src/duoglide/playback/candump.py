"""Raw frames: a run as the candump log that ``canplayer`` reads, and such a log on a bus again."""

from __future__ import annotations

import re
import struct
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from duoglide.arrays import AXES
from duoglide.drives import pdo
from duoglide.errors import BusError, LogError
from duoglide.playback.run_data import machine_of
from duoglide.storage import EventKind, Log, LogKind, Topic
from duoglide.storage.atomic import appearing

if TYPE_CHECKING:
    import can

_LINE = re.compile(
    r"\((\d+\.\d+)\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#([0-9A-Fa-f]*)\s*\w?$"
)
_REMOTE = re.compile(r"\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]+#R\d?\s*\w?$")


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

    def line(self, channel: str) -> str:
        """Return the frame as a line of a candump log."""
        digits = 8 if self.extended else 3
        return f"({self.stamp:017.6f}) {channel} {self.can_id:0{digits}X}#{self.data.hex().upper()}"


def frames_of(log: Log) -> Iterator[Frame]:
    """Rebuild the frames of a run's cycles: SYNC, the drives' answers, the setpoints, emergencies.

    The log holds what they said and when each cycle began; within a cycle they are spaced as the
    bus carries them, worst-case stuffing counted. Heartbeats and the bring-up are not in a log.

    Raises:
        LogError: Not a run.
    """
    if log.kind is not LogKind.RUN:
        raise LogError(f"{log.path} is a {log.kind}, not a run: it holds no frames")
    drives = machine_of(log).drives
    bit = 1.0 / drives.bit_rate
    for t, record in log.records(Topic.CYCLE):
        stamp = log.anchor.stamp(t) * 1e-9
        frames = [(pdo.SYNC, b"")]
        for axis in range(AXES):
            if not record.missing >> axis & 1:
                answer = struct.pack("<Hi", record.statusword[axis], record.actual[axis])
                frames.append((pdo.TPDO1 + drives.node_ids[axis], answer))
        for axis in range(AXES):
            command = struct.pack("<Hi", record.controlword[axis], record.setpoint[axis])
            frames.append((pdo.RPDO1 + drives.node_ids[axis], command))
        for can_id, data in frames:
            yield Frame(stamp, can_id, data)
            stamp += bit * frame_bits(len(data))


def emergencies_of(log: Log) -> Iterator[Frame]:
    """Rebuild the emergency frames of a run."""
    nodes = machine_of(log).drives.node_ids
    for t, event in log.records(Topic.EVENT):
        if event.kind is EventKind.EMERGENCY and event.axis:
            data = pdo.pack_emergency(event.code, 1)
            yield Frame(log.anchor.stamp(t) * 1e-9, pdo.EMCY + nodes[event.axis - 1], data)


def frame_bits(size: int) -> int:
    """Return the longest a standard frame of ``size`` data bytes gets [bits] (CiA 301)."""
    return 47 + 8 * size + (34 + 8 * size - 1) // 4


def write_candump(log: Log, file: str | Path, channel: str = "can0") -> int:
    """Write a run as a candump log.

    Args:
        log: The run.
        file: Where to write.
        channel: What to call the interface.

    Returns:
        How many frames it has.

    Raises:
        LogError: Not a run, or the file cannot be written.
    """
    import heapq

    frames = heapq.merge(frames_of(log), emergencies_of(log), key=lambda frame: frame.stamp)
    count = 0
    with appearing(file) as temporary, temporary.open("w", encoding="ascii") as stream:
        for frame in frames:
            stream.write(frame.line(channel) + "\n")
            count += 1
    return count


def read_candump(file: str | Path) -> Iterator[Frame]:
    """Read the frames of a candump log, line by line; remote frames are left out.

    Raises:
        LogError: No such file, or a line that is not a frame; names the line.
    """
    try:
        with Path(file).open(encoding="ascii") as stream:
            for number, text in enumerate(stream, 1):
                line = text.strip()
                if line and not _REMOTE.match(line):
                    yield _frame(line, f"{file}, line {number}")
    except OSError as error:
        raise LogError(f"cannot read {file}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise LogError(f"{file} is not a candump log: {error}") from error


def _frame(line: str, where: str) -> Frame:
    match = _LINE.match(line)
    if match is None or len(match[4]) % 2 or len(match[4]) > 16:
        raise LogError(
            f"{where}: {line[:60]!r} is not a frame, as in (1700000000.000000) can0 123#00"
        )
    return Frame(float(match[1]), int(match[3], 16), bytes.fromhex(match[4]), len(match[3]) == 8)


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
    import can

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
