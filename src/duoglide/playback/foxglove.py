"""A log with everything that follows from it, for Foxglove and PlotJuggler to show."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from duoglide.arrays import AXES
from duoglide.drives.cia402 import decode
from duoglide.errors import DriveError
from duoglide.playback.columns import FAMILIES, Columns, run_columns
from duoglide.playback.run_data import read_run
from duoglide.storage import Log, LogKind, Topic
from duoglide.storage.atomic import appearing
from duoglide.storage.writer import add_channel, open_mcap

_NUMBER = {"type": ["number", "null"]}
_GROUPS: dict[str, tuple[str, ...]] = {
    "/path": ("path_time_s", "rate", "lateness_us"),
    "/carriage_1": ("setpoint_1_mm", "actual_1_mm", "following_error_1_mm"),
    "/carriage_2": ("setpoint_2_mm", "actual_2_mm", "following_error_2_mm"),
    "/carriage_3": ("setpoint_3_mm", "actual_3_mm", "following_error_3_mm"),
    "/platform": ("x_mm", "y_mm", "z_mm"),
    "/margins": ("clearance_mm", *(f"{name}_mm" for name in FAMILIES)),
}
_POSE = "foxglove.PoseInFrame"
_LOG = "foxglove.Log"
_INFO, _ERROR = 2, 4  # levels of foxglove.Log


def write_foxglove(log: Log, file: str | Path) -> int:
    """Write a log with derived topics: carriages, platform, margins, drive states, events, pose.

    A plan has them already and is written with its own topics.

    Returns:
        How many messages it has.

    Raises:
        LogError: The log cannot be read or the file cannot be written.
    """
    count = 0
    with appearing(file) as temporary, temporary.open("wb") as stream:
        writer = open_mcap(stream)
        numbers = {
            topic: add_channel(writer, topic, name, text) for topic, name, text in _channels()
        }
        for stamp, topic, message in _messages(log):
            content = json.dumps(message, allow_nan=False).encode()
            count += 1
            writer.add_message(numbers[topic], stamp, content, stamp, count)
        writer.finish()
    return count


def _channels() -> Iterator[tuple[str, str, bytes]]:
    """Yield topic, name and text of the schema of each channel."""
    for topic, names in _GROUPS.items():
        title = f"duoglide.{topic.strip('/')}"
        yield (topic, title, _schema(title, dict.fromkeys(names, _NUMBER)))
    yield (
        "/drives",
        "duoglide.drives",
        _schema("duoglide.drives", {f"state_{n}": {"type": "string"} for n in (1, 2, 3)}),
    )
    whole = {"type": "integer"}
    time = {"type": "object", "title": "time", "properties": {"sec": whole, "nsec": whole}}
    xyz = {"type": "object", "properties": {k: {"type": "number"} for k in "xyz"}}
    turn = {"type": "object", "properties": {k: {"type": "number"} for k in "xyzw"}}
    pose = {"type": "object", "properties": {"position": xyz, "orientation": turn}}
    text = {"type": "string"}
    yield ("/pose", _POSE, _schema(_POSE, {"timestamp": time, "frame_id": text, "pose": pose}))
    yield (
        "/log",
        _LOG,
        _schema(
            _LOG,
            {
                "timestamp": time,
                "level": whole,
                "message": text,
                "name": text,
                "file": text,
                "line": whole,
            },
        ),
    )
    from duoglide.storage.schemas import schema_name, schema_of

    yield (Topic.MOTION, schema_name(Topic.MOTION), schema_of(Topic.MOTION))


def _schema(title: str, properties: dict[str, Any]) -> bytes:
    return json.dumps({"title": title, "type": "object", "properties": properties}).encode()


def _messages(log: Log) -> Iterator[tuple[int, str, dict[str, Any]]]:
    """Yield stamp, topic and content of every message of the export, in order of time."""
    for t, event in log.records(Topic.EVENT):
        stamp = log.anchor.stamp(t)
        level = _ERROR if event.code or event.kind in ("fault", "emergency", "bus") else _INFO
        yield stamp, "/log", {
            "timestamp": _time(stamp), "level": level, "message": event.text,
            "name": event.kind.value, "file": "", "line": 0,
        }  # fmt: skip
    if log.kind is LogKind.PLAN:
        for t, record in log.records(Topic.MOTION):
            yield log.anchor.stamp(t), Topic.MOTION, json.loads(record.to_json())
        return
    data = read_run(log)
    columns = {name: values.tolist() for name, values in run_columns(data).items()}
    times = [t for t, _ in log.records(Topic.CYCLE)]
    for row, t in enumerate(times):
        stamp = log.anchor.stamp(t)
        for topic, names in _GROUPS.items():
            yield stamp, topic, {name: _number(columns[name][row]) for name in names}
        yield (
            stamp,
            "/drives",
            {f"state_{n}": _state(columns[f"statusword_{n}"][row]) for n in range(1, AXES + 1)},
        )
        yield from _pose(stamp, columns, row)


def _pose(stamp: int, columns: Columns, row: int) -> Iterator[tuple[int, str, dict[str, Any]]]:
    """Yield the platform's pose in metres, as Foxglove's 3D panel wants it."""
    position = {name: columns[f"{name}_mm"][row] / 1000.0 for name in "xyz"}
    if all(map(math.isfinite, position.values())):
        turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
        yield (
            stamp,
            "/pose",
            {
                "timestamp": _time(stamp),
                "frame_id": "base",
                "pose": {"position": position, "orientation": turn},
            },
        )


def _time(stamp: int) -> dict[str, int]:
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    return {"sec": seconds, "nsec": nanoseconds}


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _state(statusword: int) -> str:
    try:
        return decode(statusword).name.lower()
    except DriveError:
        return f"undefined 0x{statusword:04X}"
