"""A run as the frames that were on the bus, in the log formats of other programs."""

from __future__ import annotations

import heapq
import struct
from collections.abc import Iterator
from pathlib import Path

import can

from duoglide.arrays import AXES
from duoglide.drives import pdo
from duoglide.errors import LogError
from duoglide.playback.can_log import Frame
from duoglide.playback.run_data import machine_of
from duoglide.storage import EventKind, Log, LogKind, Topic
from duoglide.storage.atomic import appearing

_WRITERS = {".asc": can.ASCWriter, ".blf": can.BLFWriter, ".trc": can.TRCWriter}
"""By suffix; all others are written as candump does."""


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
    """Write a run as the log that candump would have made, which ``canplayer`` reads.

    Args:
        log: The run.
        file: Where to write; ``.asc``, ``.blf`` and ``.trc`` make it what these are.
        channel: What to call the interface.

    Returns:
        How many frames it has.

    Raises:
        LogError: Not a run, or the file cannot be written.
    """
    frames = heapq.merge(frames_of(log), emergencies_of(log), key=lambda frame: frame.stamp)
    writer = _WRITERS.get(Path(file).suffix.lower(), can.CanutilsLogWriter)
    count = 0
    with appearing(file) as temporary, writer(temporary) as stream:
        for frame in frames:
            message = can.Message(
                timestamp=frame.stamp,
                arbitration_id=frame.can_id,
                is_extended_id=frame.extended,
                data=frame.data,
                channel=channel,
            )
            stream.on_message_received(message)
            count += 1
    return count
