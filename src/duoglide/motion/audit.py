"""What a trajectory really asks of the carriages, measured on the positions that will be sent."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import cbrt, ulp
from typing import TypeAlias

import numpy as np

from duoglide.arrays import FloatArray, IndexArray, read_only
from duoglide.machine import CarriageLimits
from duoglide.motion.forces import motion_forces
from duoglide.motion.led_stops import PROMISED, LedStops
from duoglide.motion.motion import Motion
from duoglide.motion.path.carriage import CarriagePath
from duoglide.motion.path.path import Path
from duoglide.motion.picks import count_picks
from duoglide.motion.rounding.course import explain_sampling

RATE = 20_000.0  # samples per second of the finite differences
AT_LIMIT = 0.98  # use from which a limit counts as the one that holds the motion back
MOST_SAMPLES = 500_000  # beyond that, exact derivatives are taken instead of differences
_FEED_SAMPLES = 4001
_ROUNDING = 16.0  # A third difference of positions is wrong by so many units of their last place.


class Limit(IntEnum):
    """What of a carriage is limited: a derivative of its position, or its force."""

    VELOCITY = 1
    ACCELERATION = 2
    JERK = 3
    FORCE = 4


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


_WORTH_TELLING = 0.01  # A limit that holds for less than this share is not told.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Audit:
    """Worst use of each limit, by finite differences of the positions that will be sent.

    Attributes:
        velocity: Worst use of each carriage's velocity limit, 1.0 = at the limit, shape (3,).
        acceleration: The same for acceleration, shape (3,).
        jerk: The same for jerk, shape (3,).
        force: The same for force, in closed form, shape (3,); 0 where there is no limit.
        period: Step of the differences [s]; 0 where the motion is so long that exact derivatives
            at points of every piece of the profile were taken instead.
        duration: Of the trajectory [s].
        times: Where ``limiting`` and ``use`` were taken [s], shape (n,).
        use: Largest use of any limit at each time, shape (n,).
        limiting: Which limit that is: 3 (limit - 1) + (carriage - 1), shape (n,).
        shares: The limits that hold the motion back, the longest first.
        fallback: Why the timing is a slower, certified one instead of the near-optimal one; empty
            where it is not.
        least_clearance: Least distance to a singular surface or edge of reach on the path [mm].
        carriage_margin: Least error of all carriages on the path with which links may part, see
            ``dg.carriage_margin`` [mm].
        braking_clearance: The least clearance while every drive brakes by itself, out of any
            instant of the motion: a lower bound, certain between samples too; NaN where that was
            not looked at.
        braking_carriage_margin: The least carriage margin then, likewise [mm].
        braking_cost: By how much longer the motion takes for that [s].
        stays_on_path: For which share of the duration it is promised, of each drive, that the
            platform stays within 1 mm of its path should that drive fail and brake by itself, shape
            (3,), 0 to 1; NaN where that was not looked at.
        feed_share: For which share of the duration the caps that the program itself sets on the
            tool's speed and acceleration hold the motion back, 0 to 1.
        picks: How many moves up, across and down the motion is made of; 0 where it is another.
        sampling: Where many short lines that stand for a curve slow the motion down: what would
            help; empty where nothing does.
    """

    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    force: FloatArray
    period: float
    duration: float
    times: FloatArray
    use: FloatArray
    limiting: IndexArray
    shares: tuple[Share, ...]
    fallback: str
    least_clearance: float
    carriage_margin: float
    braking_clearance: float
    braking_carriage_margin: float
    braking_cost: float
    stays_on_path: FloatArray
    feed_share: float = 0.0
    picks: int = 0
    sampling: str = ""

    @property
    def worst(self) -> float:
        """The largest use of any limit; 1.0 = at the limit."""
        uses = self.velocity, self.acceleration, self.jerk, self.force
        return float(max(use.max() for use in uses))

    @property
    def picks_per_minute(self) -> float:
        """Picks per minute, each with its way back; NaN where the motion is not made of picks."""
        return 30.0 * self.picks / self.duration if self.picks else float("nan")

    def explain(self) -> str:
        """Say in words what limits the motion."""
        held = [(share.share, str(share)) for share in self.shares]
        if self.feed_share > 0.0:
            feed = f"the program's own feed, {100.0 * self.feed_share:.0f} % of the time"
            held = sorted([(self.feed_share, feed), *held], key=lambda row: -row[0])
        if not held:
            return "no carriage limit holds the motion back"
        told = [words for share, words in held if share >= _WORTH_TELLING]
        return "; ".join(told or [held[0][1]])

    def __repr__(self) -> str:
        return (
            f"Audit({self.duration:.4f} s, worst use {100.0 * self.worst:.1f} %,"
            f" least clearance {self.least_clearance:.2f} mm)"
        )

    def __str__(self) -> str:
        force = [("force", self.force)] if self.force.any() else []
        rate = f", {self.picks_per_minute:.1f} picks per minute" if self.picks else ""
        lines = [
            f"duration {self.duration:.4f} s{rate}",
            *(
                f"{name}: worst use {', '.join(f'{100.0 * u:.2f} %' for u in uses)}"
                for name, uses in (
                    ("velocity", self.velocity),
                    ("acceleration", self.acceleration),
                    ("jerk", self.jerk),
                    *force,
                )
            ),
            f"limited by: {self.explain()}",
            f"least clearance {self.least_clearance:.3f} mm,"
            f" least carriage margin {self.carriage_margin:.3f} mm",
        ]
        if self.braking_clearance == self.braking_clearance:
            cost = (
                f"{self.braking_cost:.4f} s slower for that" if self.braking_cost else "at no cost"
            )
            lines.append(
                f"brake-safe, {cost}: clearance while all drives brake by themselves at least"
                f" {self.braking_clearance:.3f} mm, carriage margin"
                f" {self.braking_carriage_margin:.3f} mm"
            )
        if not np.isnan(self.stays_on_path).any():
            shares = ", ".join(f"{100.0 * share:.0f} %" for share in self.stays_on_path)
            lines.append(
                f"within {PROMISED:g} mm of its path, should drive 1, 2 or 3 stop by itself: in"
                f" {shares} of the time"
            )
        if self.fallback:
            lines.append(f"slower certified timing: {self.fallback}")
        if self.sampling:
            lines.append(f"slow for its sampling: {self.sampling}")
        return "\n".join(lines)


def audit(motion: Motion, led: LedStops | None = None) -> Audit:
    """Measure ``motion``: see ``Trajectory.audit``.

    Args:
        motion: To be measured.
        led: Where drives may lead the others; None where that was not looked at.
    """
    step = _step(motion)
    if motion.duration / step <= MOST_SAMPLES:
        worst, times, use, limiting = _by_differences(motion, step)
    else:
        step = 0.0
        worst, times, use, limiting = _by_pieces(motion)
    report, path = motion.report, motion.path
    before = report.duration_before_braking
    return Audit(
        velocity=read_only(worst[0]),
        acceleration=read_only(worst[1]),
        jerk=read_only(worst[2]),
        force=read_only(worst[3]),
        period=step,
        duration=motion.duration,
        times=read_only(times),
        use=read_only(use),
        limiting=limiting,
        shares=_share_time(times, limiting, use),
        fallback=report.reason,
        least_clearance=motion.path.least_clearance,
        carriage_margin=motion.path.carriage_margin,
        braking_clearance=report.braking_clearance,
        braking_carriage_margin=report.braking_carriage_margin,
        braking_cost=max(motion.duration - before, 0.0) if before > 0.0 else 0.0,
        stays_on_path=read_only(np.full(3, np.nan) if led is None else np.array(led.shares)),
        feed_share=_feed_share(motion),
        picks=count_picks(path.checked.path) if isinstance(path, CarriagePath) else 0,
        sampling=_explain_sampling(path.checked.path) if isinstance(path, CarriagePath) else "",
    )


def _explain_sampling(path: Path) -> str:
    return explain_sampling(path.segments, path.corners, path.halts)


Findings: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, IndexArray]


def _by_differences(motion: Motion, step: float) -> Findings:
    """Difference the positions that are sent every ``step``."""
    limits = motion.machine.limits
    # At rest the motion goes on as it is, so that the differences reach over the ends.
    first, last = (-3 if motion.starts_at_rest else 0), 3 if motion.ends_at_rest else 0
    grid = np.arange(first, int(motion.duration / step) + last + 1) * step
    uses = _measure_uses(motion.at(grid).carriages, step, limits)
    size = len(uses[2])
    times = np.asarray(grid[:size] + 1.5 * step, dtype=np.float64)
    four = *uses, _force_uses(motion, times)
    worst = np.array([use.max(axis=0, initial=0.0) for use in four])
    every = np.concatenate([use[:size] for use in four], axis=-1)
    return worst, times, every.max(axis=-1), every.argmax(axis=-1)


def _by_pieces(motion: Motion) -> Findings:
    """Take the exact derivatives, which bound the differences, at points of every piece."""
    limits = motion.machine.limits
    knots = motion.profile.knots[:, 0]
    points = max(5, min(33, MOST_SAMPLES // len(knots)))
    shares = (np.arange(points) + 0.5) / points
    times = (knots[:-1, None] + shares * np.diff(knots)[:, None]).ravel()
    state = motion.at(times)
    every = np.concatenate(
        [
            np.abs(state.velocity) / limits.velocity,
            np.abs(state.acceleration) / limits.acceleration,
            np.abs(state.jerk) / limits.jerk,
            _force_uses(motion, times),
        ],
        axis=-1,
    )
    worst = every.max(axis=0).reshape(4, 3)
    return worst, times, every.max(axis=-1), every.argmax(axis=-1)


def _force_uses(motion: Motion, times: FloatArray) -> FloatArray:
    """Return the uses of the force limits, (n, 3); 0 where there is none."""
    limits = motion.machine.limits.force
    if np.isinf(limits).all():
        return np.zeros((times.size, 3))
    uses: FloatArray = np.abs(motion_forces(motion, times)) / limits
    return uses


def _step(motion: Motion) -> float:
    """Return the step of the differences: 20 kHz, or as small as rounding lets a jerk be seen."""
    times = np.linspace(0.0, motion.duration, 33)
    ways = motion.at(times).carriages, motion.position_at(times)
    size = max(float(np.abs(way).max()) for way in ways)
    jerk = float(motion.machine.limits.jerk.min())
    return max(1.0 / RATE, cbrt(_ROUNDING * ulp(size) / (1e-4 * jerk)))


def _measure_uses(
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


def _feed_share(motion: Motion) -> float:
    """Return for which share of the duration a cap of the program on its tool is reached."""
    path = motion.path
    if not isinstance(path, CarriagePath):
        return 0.0
    checked = path.checked
    if not checked.speed_caps and checked.tool_acceleration is None:
        return 0.0
    along = motion.profile.at(np.linspace(0.0, motion.duration, _FEED_SAMPLES))
    sigma, rate, change = along[:, 0], along[:, 1, None], along[:, 2, None]
    p = checked.curve.derivatives(sigma)
    use = np.zeros(sigma.shape)
    for cap in checked.speed_caps:
        inside = (cap.start <= sigma) & (sigma <= cap.end)
        speed = np.linalg.norm(p[inside, 1] * rate[inside], axis=-1)
        use[inside] = np.maximum(use[inside], speed / cap.speed)
    if checked.tool_acceleration is not None:
        bent = np.linalg.norm(p[:, 1] * change + p[:, 2] * rate**2, axis=-1)
        use = np.maximum(use, bent / checked.tool_acceleration)
    return float(np.mean(use >= AT_LIMIT))


def _share_time(times: FloatArray, limiting: IndexArray, use: FloatArray) -> tuple[Share, ...]:
    """Return how long each limit holds the motion back, the longest first."""
    spans = np.gradient(times) if times.size > 1 else np.ones(times.size)
    held = use >= AT_LIMIT
    weights = np.bincount(limiting[held], weights=spans[held], minlength=12) / spans.sum()
    return tuple(
        Share(carriage=int(k) % 3 + 1, limit=Limit(int(k) // 3 + 1), share=float(weights[k]))
        for k in np.argsort(-weights, kind="stable")
        if weights[k] > 0.0
    )
