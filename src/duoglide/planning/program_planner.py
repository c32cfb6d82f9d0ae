"""Plan a long program piece by piece: one trajectory after the other, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from duoglide.errors import PathError
from duoglide.machine import Machine
from duoglide.motion.path import Path
from duoglide.motion.path_segments import COINCIDENT, distance, show
from duoglide.motion.trajectory import Trajectory
from duoglide.planning.plan import plan

Count = Callable[[int, float], None]
"""Told after each path how many are planned, and how long they take together [s]."""


def plan_program(
    machine: Machine,
    paths: Iterable[Path],
    brake_safe: bool = True,
    progress: Count | None = None,
) -> Iterator[Trajectory]:
    """Plan one path after the other, each from rest to rest from where the last one ended.

    Nothing is planned before it is asked for, and nothing is kept but the last end: the paths may
    be a generator, as long as wished.

    Args:
        machine: The machine that is to move.
        paths: What it is to do, such as ``picks`` yields.
        brake_safe: See ``plan``.
        progress: Told after each path.

    Raises:
        PathError: Names the path, and where, what and by how much; or that it does not start where
            the one before ends.
    """
    total, end = 0.0, None
    for number, path in enumerate(paths, start=1):
        if end is not None and distance(end, path.start) >= COINCIDENT:
            raise PathError(
                f"path {number} starts at {show(path.start)} mm,"
                f" {distance(end, path.start):.6g} mm from where path {number - 1} ends",
                position=path.start,
                quantity="start",
                amount=float(np.linalg.norm(np.subtract(end, path.start))),
            )
        try:
            trajectory = plan(machine, path, brake_safe)
        except PathError as error:
            raise PathError(
                f"path {number}: {error}",
                arc_length=error.arc_length,
                position=error.position,
                quantity=error.quantity,
                amount=error.amount,
            ) from error
        end, total = path.end, total + trajectory.duration
        if progress is not None:
            progress(number, total)
        yield trajectory
