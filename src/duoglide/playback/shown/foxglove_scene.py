"""The mechanism and its path as messages of Foxglove: SceneUpdate, FrameTransforms, JointStates.

Bodies are drawn once, each in a frame of its own, and only the frames move. Whoever seeks in
Foxglove sees the last message of each topic, so each message has the whole of its picture.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.export import COLOURS, RADIUS, Bar, Body
from duoglide.playback.shown.scene import FOOT, Bodies, Box, Scene, boxes

METRE = 1e-3  # one millimetre
TRANSFORMS, JOINTS = "/tf", "/joint_states"
MECHANISM, PLANNED, DONE = "/mechanism", "/path_planned", "/path_done"
_RAIL = (0.59, 0.61, 0.63)
PLANNED_COLOUR, DONE_COLOUR = (0.55, 0.57, 0.6), (0.8, 0.0, 0.31)
_LEVEL = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}

Message = tuple[int, str, dict[str, Any]]
"""Stamp [ns], topic, content."""


def time_of(stamp: int) -> dict[str, int]:
    """Return nanoseconds as Foxglove writes a time in JSON."""
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    return {"sec": seconds, "nsec": nanoseconds}


def xyz(point: FloatArray | tuple[float, float, float]) -> dict[str, float]:
    """Return a point [mm] in metres, to a nanometre."""
    x, y, z = (round(float(value) * METRE, 9) for value in point)
    return {"x": x, "y": y, "z": z}


def scene_messages(scene: Scene) -> Iterator[Message]:
    """Yield what shows the mechanism and its path, in order of time."""
    if not len(scene.stamps):
        return
    begin = int(scene.stamps[0])
    if scene.plan is not None:
        line = _line(begin, "planned", scene.planned, PLANNED_COLOUR)
        yield begin, PLANNED, {"deletions": [], "entities": [line]}
    if scene.bodies is None:
        return
    yield begin, MECHANISM, {"deletions": [], "entities": _drawn(scene, scene.bodies, begin)}
    moving = _moving(scene.bodies, scene.stamps[scene.bodies.rows].tolist())
    done = dict(scene.done())
    for stamp, topic, message in moving:
        yield stamp, topic, message
        if topic == JOINTS and stamp in done:
            line = _line(stamp, "done", done[stamp], DONE_COLOUR)
            yield stamp, DONE, {"deletions": [], "entities": [line]}


def _moving(bodies: Bodies, stamps: list[int]) -> Iterator[Message]:
    """Yield transforms and joint states of each frame."""
    units = {
        body.name: METRE if body.name.startswith("carriage") else 1.0 for body in bodies.tree.bodies
    }
    for frame, stamp in enumerate(stamps):
        time = time_of(stamp)
        transforms = [
            {
                "timestamp": time,
                "parent_frame_id": FOOT,
                "child_frame_id": name,
                "translation": xyz(origin[frame]),
                "rotation": dict(zip("xyzw", np.round(turn[frame], 9).tolist(), strict=True)),
            }
            for name, (origin, turn) in bodies.poses.items()
        ]
        yield stamp, TRANSFORMS, {"transforms": transforms}
        joints = [
            {"name": name, "position": round(float(values[frame]) * units[name], 9)}
            for name, values in bodies.values.items()
        ]
        yield stamp, JOINTS, {"timestamp": time, "joints": joints}


def _drawn(scene: Scene, bodies: Bodies, stamp: int) -> list[dict[str, Any]]:
    """Return the bodies, each in its own frame."""
    blocks = boxes(scene.machine.geometry, bodies.tree)
    entities = [
        _entity(
            stamp,
            FOOT,
            "rails",
            cubes=[_cube(block, _RAIL) for block in blocks if block.body == FOOT],
        )
    ]
    for body in bodies.tree.bodies:
        cylinders = [
            _cylinder(body, bar, COLOURS[body.name]) for bar in body.bars if bar.start != bar.end
        ]
        cubes = [_cube(block, COLOURS[body.name]) for block in blocks if block.body == body.name]
        texts = [_number(body)] if body.name.startswith("carriage") else []
        entities.append(
            _entity(stamp, body.name, body.name, cylinders=cylinders, cubes=cubes, texts=texts)
        )
    return entities


def _entity(
    stamp: int, frame: str, name: str, **primitives: list[dict[str, Any]]
) -> dict[str, Any]:
    kinds = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    return {
        "timestamp": time_of(stamp),
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [],
        **{kind: primitives.get(kind, []) for kind in kinds},
    }


def _line(
    stamp: int, name: str, points: FloatArray, colour: tuple[float, float, float]
) -> dict[str, Any]:
    """Draw a path in the base frame, as wide on every screen."""
    line = {
        "type": 0,  # a strip
        "pose": {"position": xyz((0.0, 0.0, 0.0)), "orientation": _LEVEL},
        "thickness": 2.0,
        "scale_invariant": True,
        "points": [xyz(point) for point in points],
        "color": _rgba(colour),
        "colors": [],
        "indices": [],
    }
    return _entity(stamp, FOOT, name, lines=[line])


def _cube(block: Box, colour: tuple[float, float, float]) -> dict[str, Any]:
    return {
        "pose": {"position": xyz(block.centre), "orientation": _LEVEL},
        "size": xyz(block.size),
        "color": _rgba(colour),
    }


def _cylinder(body: Body, bar: Bar, colour: tuple[float, float, float]) -> dict[str, Any]:
    """Draw a bar in its body's frame; a cylinder stands along its own z."""
    way = np.subtract(bar.end, bar.start)
    length = float(np.linalg.norm(way))
    return {
        "pose": {
            "position": xyz(np.add(bar.start, bar.end) / 2.0 - body.origin),
            "orientation": dict(zip("xyzw", from_z(way / length), strict=True)),
        },
        "size": xyz((2.0 * RADIUS, 2.0 * RADIUS, length)),
        "bottom_scale": 1.0,
        "top_scale": 1.0,
        "color": _rgba(colour),
    }


def _number(body: Body) -> dict[str, Any]:
    """Write a carriage's number beside it."""
    return {
        "pose": {"position": xyz((0.0, 0.0, 30.0)), "orientation": _LEVEL},
        "billboard": True,
        "font_size": 0.03,
        "scale_invariant": False,
        "color": _rgba(COLOURS[body.name]),
        "text": body.name.removeprefix("carriage_"),
    }


def from_z(direction: FloatArray) -> tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) that turns +z into a unit ``direction``, shape (3,)."""
    x, y, z = direction.tolist()
    if z < -1.0 + 1e-12:
        return 1.0, 0.0, 0.0, 0.0
    w = float(np.sqrt((1.0 + z) / 2.0))
    return -y / (2.0 * w), x / (2.0 * w), 0.0, w


def _rgba(colour: tuple[float, float, float]) -> dict[str, float]:
    r, g, b = colour
    return {"r": r, "g": g, "b": b, "a": 1.0}
