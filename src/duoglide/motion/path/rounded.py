"""A path with its corners rounded: what is checked, and what nothing moves afterwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.machine import Machine
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.path import Path
from duoglide.motion.rounding.round_segments import RoundedCurve, round_segments


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
            if not speeds:
                continue
            joined = caps and caps[-1].end == start and caps[-1].speed == min(speeds)
            caps.append(SpeedCap(caps.pop().start if joined else start, end, min(speeds)))
        return tuple(caps)


def round_corners(path: Path) -> RoundedPath:
    """Fix every blend of a path, and join its pieces to one curve.

    Raises:
        PathError: Explicit blends that overlap, are longer than their segment, or stand at a
            reversal.
    """
    rounded = round_segments(path.segments, path.corners, path.halts)
    return RoundedPath(
        rounded.curve,
        rounded.waypoints,
        rounded.before,
        rounded.after,
        rounded.shape,
        rounded.deviation,
        path,
    )
