"""The mechanism along a plan or a run, read once for every program that shows it.

Series have a row a cycle. Bodies are placed at most 60 times a second: an eye sees no more, and a
shift's log stays small.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics.export import Tree, body_poses, build_tree, joint_values
from duoglide.kinematics.model import reachable
from duoglide.machine import Geometry, Machine
from duoglide.planning.trajectory import Trajectory
from duoglide.playback.columns import platform
from duoglide.playback.rebuild import plan_of
from duoglide.playback.run_data import IntArray, RunData, machine_of, read_run
from duoglide.storage import Document, Log, LogKind, Topic

FRAMES = 60.0  # a second
POINTS = 2000  # of the planned path, however long
STEPS = 100  # in which the path done is drawn
FOOT = "base"
"""The frame that stands still; every body's frame has the body's name."""


class Box(NamedTuple):
    """A block of a body, or of the base, along the axes of its frame.

    Attributes:
        body: Whose; ``base`` for what stands still.
        centre: In the body's frame [mm].
        size: Along x, y and z [mm].
    """

    body: str
    centre: tuple[float, float, float]
    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """Where the bodies are at each frame.

    Attributes:
        tree: The mechanism; its reference pose is that of the first frame.
        rows: Which rows of the scene the frames are, shape (f,).
        centre: Platform centre O' [mm], shape (f, 3).
        values: Name of the body to what its joint reads [mm, rad], shape (f,).
        poses: Name of the body to its origin [mm], shape (f, 3), and quaternion, shape (f, 4).
    """

    tree: Tree
    rows: IntArray
    centre: FloatArray
    values: dict[str, FloatArray]
    poses: dict[str, tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A plan or a run as a picture over time.

    Attributes:
        machine: Whose.
        plan: What was planned; None where the log does not hold it.
        run: The run; None of a plan.
        stamps: When each row was [ns since 1970], shape (n,).
        carriages: Where the carriages were measured to be, or of a plan shall be [mm], (n, 3).
        bodies: Where the mechanism was; None where it is known at no time.
    """

    machine: Machine
    plan: Trajectory | None
    run: RunData | None
    stamps: IntArray
    carriages: FloatArray
    bodies: Bodies | None

    @property
    def planned(self) -> FloatArray:
        """The path that was planned [mm], shape (m, 3); no point where there is none."""
        if self.plan is None:
            return np.empty((0, 3))
        return self.plan.position_at(np.linspace(0.0, self.plan.duration, POINTS))

    def done(self) -> list[tuple[int, FloatArray]]:
        """Return when the path that was done is drawn again, and as what: [ns], [mm] (k, 3)."""
        if self.bodies is None or self.run is None:
            return []
        centre, rows = self.bodies.centre, self.bodies.rows
        coarse = len(rows) // POINTS + 1
        ends = np.unique(np.linspace(1, len(rows), STEPS).astype(int)).tolist()
        return [
            (
                int(self.stamps[rows[end - 1]]),
                np.concatenate([centre[: end - 1 : coarse], centre[end - 1 : end]]),
            )
            for end in ends
        ]


def read_scene(log: Log) -> Scene:
    """Read a plan or a run as a scene.

    Raises:
        LogError: It cannot be read, or does not hold its machine.
    """
    plan = plan_of(log) if Document.TRAJECTORY in log.documents else None
    if log.kind is LogKind.RUN:
        run = read_run(log)
        start = next((t for t, _ in log.records(Topic.CYCLE)), 0.0)
        times = start + run.time
        machine, carriages = run.machine, run.actual_mm
        position = platform(machine.geometry, carriages)
    else:
        run = None
        machine = plan.machine if plan is not None else machine_of(log)
        records = list(log.records(Topic.MOTION))
        times = np.array([t for t, _ in records])
        carriages = np.array([record.carriages for _, record in records]).reshape(-1, 3)
        position = np.array([record.position for _, record in records]).reshape(-1, 3)
    stamps = np.array([log.anchor.stamp(t) for t in times.tolist()], dtype=np.int64)
    bodies = _place(machine.geometry, times, position)
    return Scene(machine, plan, run, stamps, carriages, bodies)


def boxes(geometry: Geometry, tree: Tree) -> tuple[Box, ...]:
    """Return rails, carriages and platform as blocks."""
    rail = (26.0, 2.0 * geometry.rail_half_length + 60.0, 12.0)
    plate = (abs(2.0 * geometry.platform_half_width) + 24.0, 60.0, 10.0)
    spacing = geometry.rail_half_spacing
    return (
        Box(FOOT, (spacing, 0.0, -16.0), rail),
        Box(FOOT, (-spacing, 0.0, -16.0), rail),
        *(Box(f"carriage_{n}", (0.0, 0.0, 0.0), (44.0, 52.0, 20.0)) for n in (1, 2, 3)),
        Box("platform", tree.platform_offset, plate),
    )


def _place(geometry: Geometry, times: FloatArray, position: FloatArray) -> Bodies | None:
    """Place the bodies at some of the rows; those where the links do not close are left out."""
    known: BoolArray = np.asarray(np.isfinite(position).all(axis=-1))
    known[known] = reachable(geometry, position[known])
    rows = np.flatnonzero(known)
    if not len(rows):
        return None
    slot = np.floor((times[rows] - times[rows[0]]) * FRAMES + 1e-6)
    first = np.append(True, np.diff(slot) > 0.0)
    first[-1] = True
    rows = rows[first]
    centre = position[rows]
    tree = build_tree(geometry, centre[0])
    values = joint_values(tree, geometry, centre)
    return Bodies(tree, rows, centre, values, body_poses(tree, values))
