"""A log with everything that follows from it, for Foxglove and PlotJuggler to show."""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

from duoglide.arrays import AXES
from duoglide.drives.cia402 import decode
from duoglide.errors import DriveError
from duoglide.playback.columns import FAMILIES, Columns, run_columns
from duoglide.playback.shown.foxglove_scene import (
    DONE,
    JOINTS,
    MECHANISM,
    PLANNED,
    TRANSFORMS,
    Message,
    scene_messages,
    time_of,
)
from duoglide.playback.shown.foxglove_schemas import SCHEMAS, schema_text
from duoglide.playback.shown.scene import Scene, read_scene
from duoglide.storage import Log, Topic
from duoglide.storage.atomic import appearing
from duoglide.storage.schemas import schema_name, schema_of
from duoglide.storage.writer import add_channel, open_mcap

_NUMBER = {"type": ["number", "null"]}
GROUPS: dict[str, tuple[str, ...]] = {
    "/path": ("path_time_s", "rate", "lateness_us"),
    "/carriage_1": ("setpoint_1_mm", "actual_1_mm", "following_error_1_mm"),
    "/carriage_2": ("setpoint_2_mm", "actual_2_mm", "following_error_2_mm"),
    "/carriage_3": ("setpoint_3_mm", "actual_3_mm", "following_error_3_mm"),
    "/platform": ("x_mm", "y_mm", "z_mm"),
    "/margins": ("clearance_mm", *(f"{name}_mm" for name in FAMILIES)),
}
"""Topic to the columns that it has, of each cycle of a run."""
_WELL_KNOWN = {
    "/pose": "foxglove.PoseInFrame",
    "/log": "foxglove.Log",
    MECHANISM: "foxglove.SceneUpdate",
    PLANNED: "foxglove.SceneUpdate",
    DONE: "foxglove.SceneUpdate",
    TRANSFORMS: "foxglove.FrameTransforms",
    JOINTS: "foxglove.JointStates",
}
_INFO, _ERROR = 2, 4  # levels of foxglove.Log


def write_foxglove(log: Log, file: str | Path) -> int:
    """Write a log with derived topics: series, events, the mechanism and its path in 3D.

    ``duoglide log --layout`` writes a layout that shows them.

    Args:
        log: A plan or a run; a plan keeps its own topic.
        file: Where to write MCAP.

    Returns:
        How many messages it has.

    Raises:
        LogError: The log cannot be read or the file cannot be written.
    """
    scene = read_scene(log)
    streams = (_events(log), scene_messages(scene), _rows(log, scene))
    count = 0
    with appearing(file) as temporary, temporary.open("wb") as stream:
        writer = open_mcap(stream)
        numbers = {
            topic: add_channel(writer, topic, name, text) for topic, name, text in _channels()
        }
        for stamp, topic, message in heapq.merge(*streams, key=itemgetter(0)):
            content = json.dumps(message, allow_nan=False).encode()
            count += 1
            writer.add_message(numbers[topic], stamp, content, stamp, count)
        writer.finish()
    return count


def _channels() -> Iterator[tuple[str, str, bytes]]:
    """Yield topic, name and text of the schema of each channel."""
    states = {f"state_{n}": {"type": "string"} for n in (1, 2, 3)}
    ours: dict[str, dict[str, Any]] = {
        **{topic: dict.fromkeys(names, _NUMBER) for topic, names in GROUPS.items()},
        "/drives": states,
    }
    for topic, properties in ours.items():
        title = f"duoglide.{topic.strip('/')}"
        yield topic, title, schema_text(title, {"type": "object", "properties": properties})
    for topic, title in _WELL_KNOWN.items():
        yield topic, title, schema_text(title, SCHEMAS[title])
    yield Topic.MOTION, schema_name(Topic.MOTION), schema_of(Topic.MOTION)


def _events(log: Log) -> Iterator[Message]:
    """Yield what happened, in order of time."""
    events = sorted(log.records(Topic.EVENT), key=itemgetter(0))
    for t, event in events:
        stamp = log.anchor.stamp(t)
        level = _ERROR if event.code or event.kind in ("fault", "emergency", "bus") else _INFO
        yield stamp, "/log", {
            "timestamp": time_of(stamp), "level": level, "message": event.text,
            "name": event.kind.value, "file": "", "line": 0,
        }  # fmt: skip


def _rows(log: Log, scene: Scene) -> Iterator[Message]:
    """Yield the series: of a plan its own records, of a run what each cycle says."""
    if scene.run is None:
        for t, record in log.records(Topic.MOTION):
            yield log.anchor.stamp(t), Topic.MOTION, json.loads(record.to_json())
        return
    columns = {name: values.tolist() for name, values in run_columns(scene.run).items()}
    for row, stamp in enumerate(scene.stamps.tolist()):
        for topic, names in GROUPS.items():
            yield stamp, topic, {name: _number(columns[name][row]) for name in names}
        yield (
            stamp,
            "/drives",
            {f"state_{n}": _state(columns[f"statusword_{n}"][row]) for n in range(1, AXES + 1)},
        )
        yield from _pose(stamp, columns, row)


def _pose(stamp: int, columns: Columns, row: int) -> Iterator[Message]:
    """Yield the platform's pose in metres, as Foxglove's 3D panel wants it."""
    position = {name: columns[f"{name}_mm"][row] / 1000.0 for name in "xyz"}
    if all(map(math.isfinite, position.values())):
        turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
        yield (
            stamp,
            "/pose",
            {
                "timestamp": time_of(stamp),
                "frame_id": "base",
                "pose": {"position": position, "orientation": turn},
            },
        )


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _state(statusword: int) -> str:
    try:
        return decode(statusword).name.lower()
    except DriveError:
        return f"undefined 0x{statusword:04X}"
