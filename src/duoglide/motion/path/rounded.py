"""A path with its corners rounded: what is checked, and what nothing moves afterwards."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from duoglide.machine import Machine
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.path import Path
from duoglide.motion.rounding.blend import Blend
from duoglide.motion.rounding.course import Course, lay_course
from duoglide.motion.rounding.round_segments import RoundedCurve, Sorted, round_course


@dataclass(frozen=True, slots=True)
class SpeedCap:
    """A cap on the tool's speed along a part of the curve.

    Attributes:
        start: Where it begins, sigma [mm].
        end: Where it ends, sigma [mm].
        speed: The cap [mm/s].
    """

    start: float
    end: float
    speed: float


@dataclass(frozen=True, slots=True, eq=False)
class RoundedPath(RoundedCurve):
    """The curve of a path, and what became of its corners.

    Attributes:
        path: What was programmed; its corners are those that were rounded.
    """

    path: Path

    def platform_curve(self, machine: Machine) -> Curve:
        """Return where the platform's centre goes in the base frame, if the tool goes this way."""
        return self.curve.moved(np.subtract(machine.work_frame, machine.tool_offset))

    @property
    def speed_caps(self) -> tuple[SpeedCap, ...]:
        """The caps on the tool's speed, those of the segments and that of the whole path."""
        caps: list[SpeedCap] = []
        ends = self.waypoints.tolist()
        for segment, start, end in zip(self.path.segments, ends[:-1], ends[1:], strict=True):
            speeds = [cap for cap in (segment.speed, self.path.tool_speed) if cap is not None]
            if not speeds or end <= start:
                continue
            joined = caps and caps[-1].end == start and caps[-1].speed == min(speeds)
            caps.append(SpeedCap(caps.pop().start if joined else start, end, min(speeds)))
        return tuple(caps)


def round_corners(path: Path) -> RoundedPath:
    """Fit dense points and every blend of a path, and join the pieces to one curve.

    Raises:
        PathError: Explicit blends that overlap, are longer than their segment, or stand at a
            reversal.
    """
    return round_again(path, lay_course(path.segments, path.corners, path.halts))


def round_again(path: Path, course: Course, known: Sorted | None = None) -> RoundedPath:
    """Round a path on its course, whose corners may have been chosen since.

    Args:
        path: The path.
        course: Its course.
        known: See ``round_course``.

    Raises:
        PathError: See ``round_corners``.
    """
    rounded = round_course(course, known)
    corners = list(path.corners)
    for waypoint, corner in zip(course.origin[1:-1], course.corners, strict=True):
        if waypoint > 0 and isinstance(corner, Blend):
            corners[waypoint - 1] = corner
    return RoundedPath(
        rounded.course,
        rounded.curve,
        rounded.waypoints,
        rounded.before,
        rounded.after,
        rounded.shape,
        rounded.deviation,
        replace(path, corners=tuple(corners)),
    )
