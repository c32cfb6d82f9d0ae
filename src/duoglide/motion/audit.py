"""What a trajectory really asks of the carriages, measured on the positions that will be sent."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import FloatArray, read_only
from duoglide.machine import CarriageLimits

if TYPE_CHECKING:
    from duoglide.motion.trajectory import Trajectory

RATE = 20_000.0  # samples per second of the finite differences
AT_LIMIT = 0.98  # use from which a limit counts as the one that holds the motion back
_CHUNK = 1 << 16
_ROUNDING = 8.0 * 1.2e-13  # of a third difference of positions of some 500 mm [mm]


class Limit(IntEnum):
    """Which derivative of a carriage's position is limited."""

    VELOCITY = 1
    ACCELERATION = 2
    JERK = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Share:
    """How long one limit of one carriage holds the motion back.

    Attributes:
        carriage: 1 to 3.
        limit: Which of its limits.
        share: Of the duration, 0 to 1.
    """

    carriage: int
    limit: Limit
    share: float

    def __str__(self) -> str:
        name = self.limit.name.lower()
        return f"carriage {self.carriage} {name}, {100.0 * self.share:.0f} % of the time"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Audit:
    """Worst use of each limit, by finite differences of the positions that will be sent.

    Attributes:
        velocity: Worst use of each carriage's velocity limit, 1.0 = at the limit, shape (3,).
        acceleration: The same for acceleration, shape (3,).
        jerk: The same for jerk, shape (3,).
        period: Step of the differences [s].
        duration: Of the trajectory [s].
        times: Where ``limiting`` and ``use`` were taken [s], shape (n,).
        use: Largest use of any limit at each time, shape (n,).
        limiting: Which limit that is: 3 (limit - 1) + (carriage - 1), shape (n,).
        shares: The limits that hold the motion back, the longest first.
        fallback: Why the timing is a slower, certified one instead of the near-optimal one; empty
            where it is not.
        least_clearance: Least distance to a singular surface or edge of reach on the path [mm].
    """

    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    period: float
    duration: float
    times: FloatArray
    use: FloatArray
    limiting: FloatArray
    shares: tuple[Share, ...]
    fallback: str
    least_clearance: float

    @property
    def worst(self) -> float:
        """The largest use of any limit; 1.0 = at the limit."""
        return float(max(self.velocity.max(), self.acceleration.max(), self.jerk.max()))

    @property
    def picks_per_minute(self) -> float:
        """Picks per minute if this motion is one way of a cycle that goes there and back."""
        return 30.0 / self.duration if self.duration > 0.0 else float("inf")

    def explain(self) -> str:
        """Say in words what limits the motion."""
        if not self.shares:
            return "no carriage limit holds the motion back"
        return "; ".join(str(share) for share in self.shares)

    def __str__(self) -> str:
        lines = [
            f"duration {self.duration:.4f} s, {self.picks_per_minute:.1f} picks per minute",
            *(
                f"{name}: worst use {', '.join(f'{100.0 * u:.2f} %' for u in uses)}"
                for name, uses in (
                    ("velocity", self.velocity),
                    ("acceleration", self.acceleration),
                    ("jerk", self.jerk),
                )
            ),
            f"limited by: {self.explain()}",
            f"least clearance {self.least_clearance:.3f} mm",
        ]
        if self.fallback:
            lines.append(f"slower certified timing: {self.fallback}")
        return "\n".join(lines)


def audit(trajectory: Trajectory) -> Audit:
    """Measure ``trajectory``: see ``Trajectory.audit``."""
    limits = trajectory.machine.limits
    step = _step(trajectory, limits)
    worst = np.zeros((3, 3))
    times, uses = [], []
    # At rest the motion goes on as it is, so that the differences reach over the ends.
    first, last = (-3 if trajectory.starts_at_rest else 0), 3 if trajectory.ends_at_rest else 0
    count = int(np.floor(trajectory.duration / step)) + last
    for begin in range(first, count + 1, _CHUNK):
        grid = np.arange(begin, min(begin + _CHUNK, count) + 4) * step
        grid = grid if last else grid[grid <= trajectory.duration]
        uses_here = _difference_uses(trajectory.at(grid).carriages, step, limits)
        for row, use in zip(worst, uses_here, strict=True):
            np.maximum(row, use.max(axis=0, initial=0.0), out=row)
        size = len(uses_here[2])
        times.append(grid[:size] + 1.5 * step)
        uses.append(np.concatenate([use[:size] for use in uses_here], axis=-1))
    time, use = np.concatenate(times), np.concatenate(uses)
    limiting = use.argmax(axis=-1)
    peak = use.max(axis=-1)
    return Audit(
        velocity=read_only(worst[0]),
        acceleration=read_only(worst[1]),
        jerk=read_only(worst[2]),
        period=step,
        duration=trajectory.duration,
        times=read_only(time),
        use=read_only(peak),
        limiting=limiting,
        shares=_shares(limiting, peak),
        fallback=trajectory.report.reason,
        least_clearance=trajectory.path.least_clearance,
    )


def _step(trajectory: Trajectory, limits: CarriageLimits) -> float:
    """Return the step of the differences: 20 kHz, or as small as rounding lets a jerk be seen."""
    seen = (_ROUNDING / (1e-4 * limits.jerk.min())) ** (1.0 / 3.0)
    return float(max(1.0 / RATE, seen, trajectory.duration / 5e6))


def _difference_uses(
    carriages: FloatArray, step: float, limits: CarriageLimits
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the uses of velocity, acceleration and jerk limits, shapes (n - 1, 3) and less."""
    first = np.diff(carriages, axis=0) / step
    second = np.diff(first, axis=0) / step
    third = np.diff(second, axis=0) / step
    return (
        np.abs(first) / limits.velocity,
        np.abs(second) / limits.acceleration,
        np.abs(third) / limits.jerk,
    )


def _shares(limiting: FloatArray, peak: FloatArray) -> tuple[Share, ...]:
    at_limit = limiting[peak >= AT_LIMIT].astype(np.intp)
    counts = np.bincount(at_limit, minlength=9)
    order = np.argsort(-counts, kind="stable")
    return tuple(
        Share(
            carriage=int(k) % 3 + 1, limit=Limit(int(k) // 3 + 1), share=counts[k] / len(limiting)
        )
        for k in order
        if counts[k] > 0
    )
