"""Time a span with ruckig: limits along the path that are constant in each stretch of it.

A stretch is a piece of the curve. Its limits of the derivatives of sigma follow from the worst case
of each carriage anywhere on it, so that any motion within them keeps the carriages' limits. From
one stretch to the next the motion goes with a speed that both allow, and without acceleration; the
speeds are as large as the stretches are long enough for. Ruckig then moves along each stretch.

That takes a few milliseconds, and about twice as long as the optimum: for a preview, and to plan
again while the machine moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import LimitError
from duoglide.motion.profile import Profile
from duoglide.motion.timing_report import TimingMethod
from duoglide.planning.timing.ask_ruckig import End, Start, ask_ruckig
from duoglide.planning.timing.lead import ALLOWED, Lead
from duoglide.planning.timing.span import Span, find_marks
from duoglide.planning.timing.timed_curve import TimedCurve
from duoglide.planning.timing.use import find_largest_use, find_stretch
from duoglide.planning.tolerances import NO_CAP

_LOOKS = 17  # at which each stretch is looked at
_SHARES = (
    0.3,
    0.6,
    0.85,
)  # of acceleration and jerk, that going round a bend may take: one is best
_RATE = 1000.0  # No limit is reached in less than this part of the time that the span takes.
_TURNS = 4  # in which limits are lowered where the start of a motion is given
_HALVINGS = 30
_APART = 1e-3  # of the span; a stretch that a cap alone begins or ends is not shorter
_SAFE = 1.0 + 1e-6
_SHORTER = 1.0 - 1e-6  # of a way, so that rounding leaves ruckig enough of it


class Limits(NamedTuple):
    """Limits of the derivatives of sigma on a stretch [mm/s, mm/s^2, mm/s^3]."""

    speed: float
    rate: float
    third: float


def time_span_ruckig(timed: TimedCurve, start: float, end: float, lead: Lead | None = None) -> Span:
    """Time a part of a curve from rest, or from the state of a lead, to rest.

    Args:
        timed: The curve.
        start: Where the part begins [mm].
        end: Where it comes to rest [mm].
        lead: How it begins, if in motion; ``timed`` has its limits lowered then.

    Raises:
        LimitError: None begins like this.
    """
    worst = WorstCase.of(timed, cut_at_caps(timed, find_marks(timed, start, end)))
    if lead is None or lead.way is None:
        profile = min((worst.move(share) for share in _SHARES), key=lambda one: one.duration)
        factor = find_stretch(find_largest_use(worst.timed, profile))
        if timed.ahead < inf:  # what takes over there counts on these limits, so it is no faster
            factor = max(factor, 1.0)
        return Span(profile.stretch(factor * _SAFE), TimingMethod.RUCKIG)
    first = Start(start, lead.speed, lead.acceleration)
    found = [worst.find_moving(share, first) for share in _SHARES]
    kept = [profile for profile in found if profile is not None]
    if not kept:
        raise LimitError(f"ruckig finds no timing that begins at {lead.speed:g} mm/s")
    return Span(min(kept, key=lambda one: one.duration), TimingMethod.RUCKIG)


def cut_at_caps(timed: TimedCurve, marks: FloatArray) -> FloatArray:
    """Return the ends of stretches, and beside them where a cap on d sigma/dt begins or ends."""
    cap = timed.sigma_cap
    if cap is None:
        return marks
    held = cap.speed < NO_CAP
    edges = cap.sigma[1:][held[1:] != held[:-1]]
    edges = np.concatenate([edges, cap.sigma[:-1][held[1:] != held[:-1]]])
    least = _APART * (marks[-1] - marks[0])
    near = np.abs(edges[:, None] - marks).min(axis=1, initial=np.inf)
    inner = np.sort(edges[(near > least) & (edges > marks[0]) & (edges < marks[-1])])
    return np.union1d(marks, inner[np.diff(inner, prepend=-inf) > least])


@dataclass(frozen=True, slots=True, eq=False)
class WorstCase:
    """Stretches, and the worst case on each of them.

    Attributes:
        timed: The curve.
        marks: The ends of the stretches, ascending [mm], (n + 1,).
        terms: The largest amount on each stretch of the three derivatives by sigma of each
            carriage, and of the tool where its acceleration has a cap; each over the limit of the
            derivative by time of the same order, (n, 3, rows).
        first: The first of these derivatives over the limits of all three orders, (n, 3, rows).
        second: The second one over the jerk limit, (n, rows).
        caps: The largest d sigma/dt that caps allow on each stretch [mm/s], (n,).
    """

    timed: TimedCurve
    marks: FloatArray
    terms: FloatArray
    first: FloatArray
    second: FloatArray
    caps: FloatArray

    @classmethod
    def of(cls, timed: TimedCurve, marks: FloatArray) -> WorstCase:
        """Look at each stretch."""
        middle = 0.5 * (marks[1:] + marks[:-1])
        unit = np.zeros((middle.size, _LOOKS, 4))
        unit[..., 0] = marks[:-1, None] + np.diff(marks)[:, None] * np.linspace(0.0, 1.0, _LOOKS)
        unit[..., 1] = 1.0
        pieces = np.repeat(timed.pieces_of(middle)[:, None], _LOOKS, axis=1)
        length = float(marks[-1] - marks[0])
        terms = np.abs(timed.motion(unit, pieces)).max(axis=1)
        slopes = terms[:, 0] * timed.limits[0]
        quickest = max(length * terms[:, 0].max(), sqrt(length * (slopes / timed.limits[1]).max()))
        softer = timed.soften_limits(_RATE / quickest)
        terms *= timed.limits / softer.limits
        first = slopes[:, None] / softer.limits
        second = terms[:, 1] * softer.limits[1] / softer.limits[2]
        caps = np.full(middle.size, inf)
        if timed.has_caps:
            caps = 1.0 / timed.caps(unit, pieces, middle).speed.max(axis=1)
        if timed.tool_acceleration is not None:
            p = np.linalg.norm(timed.curve.derivatives(unit[..., 0], pieces), axis=-1).max(axis=1)
            none = np.zeros(middle.size)
            terms = _append(terms, none, p[:, 2] / timed.tool_acceleration, none)
            first = _append(first, none, p[:, 1] / timed.tool_acceleration, none)
            second = np.column_stack([second, none])
        return cls(softer, marks, terms, first, second, caps)

    def limits(self, share: float) -> list[Limits]:
        """Return limits of each stretch that keep those of the carriages.

        Args:
            share: Of acceleration and jerk, what going round bends may take.
        """
        with np.errstate(divide="ignore"):
            speed = (share / self.terms[:, 1].max(axis=-1)) ** 0.5
            speed = np.minimum(speed, (0.5 * share / self.terms[:, 2].max(axis=-1)) ** (1.0 / 3.0))
            speed = np.minimum(speed, np.minimum(1.0 / self.terms[:, 0].max(axis=-1), self.caps))
            v = speed[:, None]
            rate = ((1.0 - self.terms[:, 1] * v * v) / self.first[:, 1]).min(axis=-1)
            rate = np.minimum(rate, (0.5 * share / (3.0 * self.second * v)).min(axis=-1))
            bent = self.terms[:, 2] * v**3 + 3.0 * self.second * v * rate[:, None]
            third = ((1.0 - bent) / self.first[:, 2]).min(axis=-1)
        return [Limits(*row) for row in np.column_stack([speed, rate, third]).tolist()]

    def move(self, share: float, first: Start | None = None, lower: float = 1.0) -> Profile:
        """Return a motion to rest at the end.

        Args:
            share: See ``limits``.
            first: How it begins; None: at rest.
            lower: All limits are lowered as if time went slower by this factor.

        Raises:
            LimitError: Ruckig finds none.
        """
        limits = [
            Limits(one.speed / lower, one.rate / lower**2, one.third / lower**3)
            for one in self.limits(share)
        ]
        ways = np.diff(self.marks).tolist()
        first = first or Start(float(self.marks[0]))
        speeds = [min(one.speed, other.speed) for one, other in pairwise(limits)]
        speeds = [first.speed, *speeds, 0.0]
        for k in range(len(limits) - 1, 0, -1):
            speeds[k] = min(speeds[k], _reach(speeds[k + 1], ways[k], limits[k]))
        parts, begin = [], first
        for k, limit in enumerate(limits):
            there = float(self.marks[k + 1])
            if begin.rate == 0.0 and begin.speed <= limit.speed:
                speeds[k + 1] = min(speeds[k + 1], _reach(begin.speed, ways[k], limit))
            part = _go(begin, End(there, speeds[k + 1]), limit)
            parts.append(part)
            begin = Start(there, speeds[k + 1])
        return Profile.join(parts)

    def find_moving(self, share: float, first: Start) -> Profile | None:
        """Return a motion that begins in a given state and keeps the limits; None: there is none.

        It cannot be slowed as a whole; so limits are lowered until what it measures fits.
        """
        limits = replace(self.timed, sigma_cap=None)  # drive stops judge that cap
        lower = 1.0
        for _ in range(_TURNS):
            try:
                profile = self.move(share, first, lower)
            except LimitError:
                return None
            factor = find_stretch(find_largest_use(limits, profile))
            if factor < 1.0 + ALLOWED:
                return profile
            lower *= factor
        return None


def _append(table: FloatArray, *column: FloatArray) -> FloatArray:
    """Append what belongs to the tool to the rows of the carriages."""
    return np.concatenate([table, np.stack(column, axis=1)[..., None]], axis=-1)


def _go(begin: Start, end: End, limit: Limits) -> Profile:
    """Move along one stretch; from a state beyond its limits as well.

    Raises:
        LimitError: Ruckig finds no way.
    """
    top = max(limit.speed, begin.speed + max(begin.rate, 0.0) ** 2 / (2.0 * limit.third), end.speed)
    bounds = top * _SAFE, max(limit.rate, abs(begin.rate)) * _SAFE, limit.third
    found = ask_ruckig(begin, end, bounds)
    if found is None:
        raise LimitError(
            f"ruckig finds no motion from {begin.speed:g} to {end.speed:g} mm/s within"
            f" {end.sigma - begin.sigma:g} mm"
        )
    return found


def _reach(speed: float, way: float, limit: Limits) -> float:
    """Return the largest speed that can be reached from another one on a way, both steady."""
    low, high = speed, max(limit.speed, speed)
    if _way_to(speed, high, limit) <= way:
        return high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _way_to(speed, middle, limit) <= way * _SHORTER:
            low = middle
        else:
            high = middle
    return low


def _way_to(one: float, other: float, limit: Limits) -> float:
    """Return on which way a steady speed becomes a larger one [mm]."""
    more = other - one
    if more * limit.third >= limit.rate**2:
        return 0.5 * (one + other) * (more / limit.rate + limit.rate / limit.third)
    return (one + other) * sqrt(more / limit.third)
