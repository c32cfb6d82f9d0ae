"""Choose the blends of a path so that the motion is quick.

A corner with a tolerance leaves two things open: how much longer the blend is on one side than on
the other, and its shape. Both are worth more than any refinement of the timing. They are searched
for with quick estimates of the time, in common for all corners of a path; the cut-backs then use
the whole tolerance, as far as the segments are long enough.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from math import exp, inf, isfinite
from typing import NamedTuple

import numpy as np

from duoglide.errors import SingularityError, UnreachableError
from duoglide.machine import Machine
from duoglide.motion.path.path import Path
from duoglide.motion.path.rounded import RoundedPath, round_again, round_corners
from duoglide.motion.path.segments import Line
from duoglide.motion.rounding.blend import Blend
from duoglide.motion.rounding.course import Course
from duoglide.motion.rounding.cut_backs import EXACT
from duoglide.motion.rounding.round_segments import sort_course
from duoglide.planning.compare import less
from duoglide.planning.rounding.deviation import measure_deviation
from duoglide.planning.timing.span import Rough, estimate
from duoglide.planning.timing.timed_curve import TimedCurve
from duoglide.planning.tolerances import ALIKE


class _Looking(NamedTuple):
    """Which styles are tried. A balance of -0.15 and a shape of 0.5 are usual.

    Attributes:
        usual: Balance and shape where no trials are made.
        balances: Of the first look, the plainest first.
        both_ways: Balances where neither side is the shorter one: alike seen from either
            end.
        shape: Of the first look.
        sharper: The same with the plainest three balances.
        rounder: The same with the plainest one alone: good where there is little room.
        steps: Of balance and shape, about the best of the first look.
        least: Balance and shape.
        most: Balance and shape; a rounder blend passes its corner on the outside.
        digits: Of a cut-back in mm, beyond which two are one.
        flat: Share of the time; a parabola that bends less has no peak worth going to.
        cells: Of an estimate.
        corners: For more of them no trials are made.
    """

    usual: tuple[float, float] = -0.15, 0.5
    balances: tuple[float, ...] = (-0.15, 0.15, -0.45, -0.75)
    both_ways: tuple[float, ...] = (0.0, -0.3, 0.3)
    shape: float = 0.5
    sharper: float = 0.6
    rounder: float = 0.4
    steps: tuple[float, float] = (0.15, 0.05)
    least: tuple[float, float] = (-1.6, 0.3)
    most: tuple[float, float] = (1.6, 0.6)
    digits: int = 7
    flat: float = 1e-5
    cells: int = 32
    corners: int = 40


_LOOK = _Looking()


@dataclass(frozen=True, slots=True)
class Style:
    """What all blends of a path have in common.

    Attributes:
        balance: Log of the cut-back on the shorter line over that on the longer one. Of two equal
            lines, the one nearer to an end of the path counts as shorter.
        shape: See ``Blend``.
    """

    balance: float
    shape: float


@dataclass(frozen=True, slots=True, eq=False)
class _Corner:
    """A corner of two lines that may be rounded within a tolerance.

    Attributes:
        index: In ``Course.corners``.
        cosine: Of the angle by which the path turns.
        tolerance: [mm].
        room: Longest cut-back before and after it [mm].
        side: What the balance of a style counts here, as log of before over after: 1, or -1; or 0
            where neither line is shorter, nor nearer to an end of the path.
    """

    index: int
    cosine: float
    tolerance: float
    room: tuple[float, float]
    side: int

    def blend(self, style: Style) -> Blend:
        """Return the blend of a style that uses the whole tolerance, or the room that there is."""
        balance = exp(self.side * style.balance)
        scale = (1.0 - EXACT) * self.tolerance / self._measure_deviation(balance, 1.0, style.shape)
        before, after = balance * scale, scale
        if before > self.room[0]:
            before = self.room[0]
            after = self._find_longest(
                lambda cut: self._measure_deviation(before, cut, style.shape)
            )
        if after > self.room[1]:
            after = self.room[1]
            before = self._find_longest(
                lambda cut: self._measure_deviation(cut, after, style.shape)
            )
            before = min(self.room[0], before)
        return Blend(before, after, style.shape)

    def _find_longest(self, deviation: Callable[[float], float]) -> float:
        """Return the longest cut-back beside a given one that keeps the tolerance."""
        goal = self.tolerance * (1.0 - EXACT)
        low, high = 0.0, max(self.room)
        under, over = -goal, deviation(high) - goal
        if over <= 0.0:
            return high
        while high - low > 1e-12 * high:  # regula falsi (Illinois)
            cut = (low * over - high * under) / (over - under)
            here = deviation(cut) - goal
            if abs(here) <= 0.1 * EXACT * goal:
                return cut
            if here < 0.0:
                low, under, over = cut, here, 0.5 * over
            else:
                high, over, under = cut, here, 0.5 * under
        return low

    def _measure_deviation(self, before: float, after: float, shape: float) -> float:
        """Return how far the corner is from the blend of two lines [mm]."""
        return float(measure_deviation(before, after, shape, self.cosine))


def choose_blends(machine: Machine, path: Path, *, trials: bool = True) -> RoundedPath:
    """Round the corners of a path between lines with blends that are chosen for a quick motion.

    Corners keep their tolerance. Corners with a blend of their own, sharp ones and those at rests
    are rounded as they say. Whether the machine can follow is for the check to say.

    Args:
        machine: Whose limits the time depends on.
        path: With its corner tolerances.
        trials: Whether to look for the best ones; else they are usual ones, at once.

    Raises:
        PathError: Explicit blends do not fit.
    """
    rounded = round_corners(path)
    if all(isinstance(corner, Blend) or corner == 0.0 for corner in path.corners):
        return rounded
    corners = _find_open_corners(rounded)
    if not corners:
        return rounded
    if not trials or len(corners) > _LOOK.corners:
        return round_again(path, _apply_style(rounded.course, corners, Style(*_LOOK.usual)))
    balances: tuple[float, ...] = _LOOK.balances
    if len(corners) == 1 and corners[0].side == 0:
        balances, corners = _LOOK.both_ways, [replace(corners[0], side=1)]
    return _Search(machine, rounded, corners).find_best(balances)


def _find_open_corners(rounded: RoundedPath) -> list[_Corner]:
    """Collect the corners whose blends may be chosen, and the room that each of them has."""
    course = rounded.course
    blended = [waypoint >= 0 and rounded.shape[waypoint] > 0.0 for waypoint in course.origin]
    found = []
    for i, (one, other) in enumerate(pairwise(course.segments)):
        tolerance = course.corners[i]
        if not (isinstance(one, Line) and isinstance(other, Line)):
            continue
        if isinstance(tolerance, Blend) or not blended[i + 1]:
            continue
        ways = [np.subtract(line.end, line.start) for line in (one, other)]
        lengths = [float(np.linalg.norm(way)) for way in ways]
        beside = blended[i], blended[i + 2]
        room = [way * (0.5 if two else 1.0) for way, two in zip(lengths, beside, strict=True)]
        cosine = float(ways[0] @ ways[1]) / (lengths[0] * lengths[1])
        found.append(_Corner(i, cosine, tolerance, (room[0], room[1]), _side(lengths)))
    middle = 0.5 * (len(course.corners) - 1)
    return [c if c.side else replace(c, side=_sign(middle - c.index)) for c in found]


def _side(lengths: list[float]) -> int:
    """Return 1 where the first of two lines is the shorter one, -1 where it is the longer one."""
    longer = lengths[1] / lengths[0] - 1.0
    return 0 if abs(longer) < ALIKE else _sign(longer)


def _sign(value: float) -> int:
    return (value > 0.0) - (value < 0.0)


def _apply_style(course: Course, corners: list[_Corner], style: Style) -> Course:
    """Return a course with the blends of a style."""
    chosen = list(course.corners)
    for corner in corners:
        chosen[corner.index] = corner.blend(style)
    return replace(course, corners=tuple(chosen))


class _Search:
    """A search over styles: a first look all over, then along parabolas about the best of it.

    The time is a rough landscape, in which going downhill from one place rarely ends at the best.

    Args:
        machine: Whose limits the time depends on.
        plain: The path with its corners rounded without a choice.
        corners: Where there is one.
    """

    def __init__(self, machine: Machine, plain: RoundedPath, corners: list[_Corner]) -> None:
        self._machine = machine
        self._plain = plain
        self._sorted = sort_course(plain.course)
        self._corners = corners
        self._tried: dict[tuple[float, ...], tuple[float, RoundedPath]] = {}
        self._keys: dict[tuple[float, float], tuple[float, ...]] = {}
        self._like: list[Rough] = []  # of the first style: where all others begin

    def find_best(self, balances: tuple[float, ...]) -> RoundedPath:
        """Return the path with the quickest blends found, or the plain one if that is quicker."""
        looks = [(balance, _LOOK.shape) for balance in balances]
        looks += [(balance, _LOOK.sharper) for balance in balances[:3]]
        point = self._choose_quickest([*looks, (balances[0], _LOOK.rounder)])
        for axis in (0, 1):
            point = self._search_along(point, axis, _LOOK.steps[axis])
        if not less(self._estimate_style(point), self._estimate_path(self._plain)):
            return self._plain
        return self._tried[self._keys[point]][1]

    def _search_along(
        self, point: tuple[float, float], axis: int, step: float
    ) -> tuple[float, float]:
        """Go to the better side along one axis, and on to the peak of a parabola."""
        here = self._estimate_style(point)
        sides = [self._move(point, axis, sign * step) for sign in (-1.0, 1.0)]
        low, high = (self._estimate_style(side) for side in sides)
        candidates = [point, *sides]
        bend = low - 2.0 * here + high
        if _LOOK.flat * here < bend < inf:
            steps = min(max(0.5 * (low - high) / bend, -1.0), 1.0)
            candidates.append(self._move(point, axis, steps * step))
        return self._choose_quickest(candidates)

    def _choose_quickest(self, candidates: list[tuple[float, float]]) -> tuple[float, float]:
        """Return the quickest of some styles; of those that are as quick, the first."""
        best, least = candidates[0], self._estimate_style(candidates[0])
        for other in candidates[1:]:
            if less(self._estimate_style(other), least):
                best, least = other, self._estimate_style(other)
        return best

    @staticmethod
    def _move(point: tuple[float, float], axis: int, step: float) -> tuple[float, float]:
        values = [point[0], point[1]]
        values[axis] = min(max(values[axis] + step, _LOOK.least[axis]), _LOOK.most[axis])
        return values[0], values[1]

    def _estimate_style(self, point: tuple[float, float]) -> float:
        """Estimate a style, once for all styles that come to the same blends for want of room."""
        if point not in self._keys:
            course = _apply_style(self._plain.course, self._corners, Style(*point))
            blends = [corner for corner in course.corners if isinstance(corner, Blend)]
            key = tuple(
                round(v, _LOOK.digits) for b in blends for v in (b.before, b.after, b.shape)
            )
            self._keys[point] = key
            if key not in self._tried:
                rounded = round_again(self._plain.path, course, self._sorted)
                self._tried[key] = self._estimate_path(rounded), rounded
        return self._tried[self._keys[point]][0]

    def _estimate_path(self, rounded: RoundedPath) -> float:
        """Estimate how long a path takes [s]; infinity where it cannot be followed."""
        try:
            curve = rounded.platform_curve(self._machine)
            cap = rounded.path.tool_acceleration
            timed = TimedCurve(self._machine, curve, rounded.speed_caps, cap)
            spans = list(pairwise([0.0, *curve.rests, curve.end]))
            like: list[Rough | None] = [*self._like]
            if len(like) != len(spans):  # the first style, or one with other rests
                found = [estimate(timed, *span, _LOOK.cells) for span in spans]
                if not all(isfinite(rough.duration) for rough in found):
                    return inf
                self._like = self._like or found
                like = [*found]
            pairs = zip(spans, like, strict=True)
            return sum(estimate(timed, *span, _LOOK.cells, one).duration for span, one in pairs)
        except (UnreachableError, SingularityError):
            return inf
