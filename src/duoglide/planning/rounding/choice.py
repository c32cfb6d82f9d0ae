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
from math import exp, inf, isfinite, sqrt

import numpy as np

from duoglide.errors import PathError, SingularityError, UnreachableError
from duoglide.machine import Machine
from duoglide.motion.path.path import Path
from duoglide.motion.path.rounded import RoundedPath, round_corners
from duoglide.motion.path.segments import Line
from duoglide.motion.rounding.blend import Blend
from duoglide.planning.compare import less
from duoglide.planning.timing.span import Rough, estimate
from duoglide.planning.timing.timed_curve import TimedCurve

_START = (-0.1, 0.5)  # of the search: balance and shape
_STEPS = (0.25, 0.05)  # first steps of both
_SHAPES = (0.3, 0.6)  # beyond, a blend passes its corner on the outside
_BALANCES = (-1.6, 1.6)  # one cut-back is five times the other at most
_HALVINGS = 1
_FLAT = 1e-5  # of the time; a parabola that bends less has no peak worth going to
_EQUAL = 1e-6  # relative; two lines whose lengths differ by less are equally long
_CELLS = 32
_MOST_CORNERS = 40  # for more of them no trials are made
_EXACT = 1e-9  # relative, to which a tolerance is used, from below
_ALIKE = 1e-12  # relative, of two cut-backs that are one
_COARSE = 16  # parts of a blend in which its nearest point is looked for
_GOLDEN = 0.5 * (sqrt(5.0) - 1.0)
_GOLDEN_STEPS = 18


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
        index: In ``Path.corners``.
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
        scale = (1.0 - _EXACT) * self.tolerance / self._deviation(balance, 1.0, style.shape)
        before, after = balance * scale, scale
        if before > self.room[0]:
            before = self.room[0]
            after = self._longest(lambda cut: self._deviation(before, cut, style.shape))
        if after > self.room[1]:
            after = self.room[1]
            before = self._longest(lambda cut: self._deviation(cut, after, style.shape))
            before = min(self.room[0], before)
        return Blend(before, after, style.shape)

    def _longest(self, deviation: Callable[[float], float]) -> float:
        """Return the longest cut-back beside a given one that keeps the tolerance."""
        goal = self.tolerance * (1.0 - _EXACT)
        low, high = 0.0, max(self.room)
        under, over = -goal, deviation(high) - goal
        if over <= 0.0:
            return high
        while high - low > _ALIKE * high:  # regula falsi (Illinois)
            cut = (low * over - high * under) / (over - under)
            here = deviation(cut) - goal
            if abs(here) <= 0.1 * _EXACT * goal:
                return cut
            if here < 0.0:
                low, under, over = cut, here, 0.5 * over
            else:
                high, over, under = cut, here, 0.5 * under
        return low

    def _deviation(self, before: float, after: float, shape: float) -> float:
        """Return how far the corner is from the blend of two lines [mm]."""
        way = 5.0 * shape * min(before, after)

        def at(u: float) -> float:
            """Square of the distance at ``u``, by the blend's parts along both lines."""
            v = 1.0 - u
            fade, rise = v * v * v, u * u * u
            x = fade * (before * (1.0 + u * (3.0 + 6.0 * u)) - way * u * (1.0 + 3.0 * u))
            y = rise * (after * (1.0 + v * (3.0 + 6.0 * v)) - way * v * (1.0 + 3.0 * v))
            return x * x + y * y - 2.0 * self.cosine * x * y

        best = min(range(1, _COARSE), key=lambda k: at(k / _COARSE))
        low, high = (best - 1) / _COARSE, (best + 1) / _COARSE
        for _ in range(_GOLDEN_STEPS):
            a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
            low, high = (low, b) if at(a) < at(b) else (a, high)
        return sqrt(at(0.5 * (low + high)))


def choose_blends(machine: Machine, path: Path) -> Path:
    """Return ``path`` with explicit blends at its corners between lines, chosen for a quick motion.

    Corners keep their tolerance. Corners with a blend of their own, sharp ones and those at rests
    stay as they are. A path that cannot be followed comes back as it is: the check says why.
    """
    if all(isinstance(corner, Blend) or corner == 0.0 for corner in path.corners):
        return path
    try:
        rounded = round_corners(path)
    except PathError:
        return path
    corners = _open_corners(path, rounded)
    if not corners:
        return path
    if len(corners) > _MOST_CORNERS:
        return _styled(path, corners, Style(*_START))
    start = _START
    if len(corners) == 1 and corners[0].side == 0:  # both ways are searched, from the middle
        start, corners = (0.0, _START[1]), [replace(corners[0], side=1)]
    return _Search(machine, path, corners).best(start)


def _open_corners(path: Path, rounded: RoundedPath) -> list[_Corner]:
    """Collect the corners whose blends may be chosen, and the room that each of them has."""
    blends = [rounded.blend(i) for i in range(len(path.corners))]
    found = []
    for i, (one, other) in enumerate(pairwise(path.segments)):
        tolerance = path.corners[i]
        if not (isinstance(one, Line) and isinstance(other, Line)):
            continue
        if isinstance(tolerance, Blend) or blends[i] is None:
            continue
        ways = [np.subtract(line.end, line.start) for line in (one, other)]
        lengths = [float(np.linalg.norm(way)) for way in ways]
        beside = [0 <= k < len(blends) and blends[k] is not None for k in (i - 1, i + 1)]
        room = [way * (0.5 if two else 1.0) for way, two in zip(lengths, beside, strict=True)]
        cosine = float(ways[0] @ ways[1]) / (lengths[0] * lengths[1])
        found.append(_Corner(i, cosine, tolerance, (room[0], room[1]), _side(lengths)))
    middle = 0.5 * (len(path.corners) - 1)
    return [c if c.side else replace(c, side=_sign(middle - c.index)) for c in found]


def _side(lengths: list[float]) -> int:
    """Return 1 where the first of two lines is the shorter one, -1 where it is the longer one."""
    longer = lengths[1] / lengths[0] - 1.0
    return 0 if abs(longer) < _EQUAL else _sign(longer)


def _sign(value: float) -> int:
    return (value > 0.0) - (value < 0.0)


def _styled(path: Path, corners: list[_Corner], style: Style) -> Path:
    """Return ``path`` with the blends of a style."""
    chosen = list(path.corners)
    for corner in corners:
        chosen[corner.index] = corner.blend(style)
    return replace(path, corners=tuple(chosen))


class _Search:
    """A pattern search over styles.

    Args:
        machine: Whose limits the time depends on.
        path: What is to be rounded.
        corners: Where.
    """

    def __init__(self, machine: Machine, path: Path, corners: list[_Corner]) -> None:
        self._machine = machine
        self._path = path
        self._corners = corners
        self._offset = np.subtract(machine.work_frame, machine.tool_offset)
        self._times: dict[tuple[float, float], float] = {}
        self._like: list[Rough] = []  # where every estimate begins

    def best(self, point: tuple[float, float]) -> Path:
        """Return the path with the quickest blends found from a balance and a shape on.

        That is the path itself where nothing found is quicker.
        """
        scale = 1.0
        for _ in range(_HALVINGS + 1):
            for axis in (1, 0):
                point = self._along(point, axis, _STEPS[axis] * scale)
            scale *= 0.5
        if not less(self._time(point), self._time_of(self._path)):
            return self._path
        return _styled(self._path, self._corners, Style(*point))

    def _along(self, point: tuple[float, float], axis: int, step: float) -> tuple[float, float]:
        """Go to the better side along one axis, and on to the peak of a parabola."""
        here = self._time(point)
        sides = [self._moved(point, axis, sign * step) for sign in (-1.0, 1.0)]
        low, high = (self._time(side) for side in sides)
        candidates = [point, *sides]
        bend = low - 2.0 * here + high
        if _FLAT * here < bend < inf:
            steps = min(max(0.5 * (low - high) / bend, -2.0), 2.0)
            candidates.append(self._moved(point, axis, steps * step))
        best = candidates[0]
        for other in candidates[1:]:
            if less(self._time(other), self._time(best)):
                best = other
        return best

    @staticmethod
    def _moved(point: tuple[float, float], axis: int, step: float) -> tuple[float, float]:
        values = [point[0], point[1]]
        values[axis] += step
        return (
            min(max(values[0], _BALANCES[0]), _BALANCES[1]),
            min(max(values[1], _SHAPES[0]), _SHAPES[1]),
        )

    def _time(self, point: tuple[float, float]) -> float:
        if point not in self._times:
            path = _styled(self._path, self._corners, Style(*point))
            self._times[point] = self._time_of(path)
        return self._times[point]

    def _time_of(self, path: Path) -> float:
        """Estimate how long a path takes [s]; infinity where it cannot be followed."""
        try:
            rounded = round_corners(path)
            curve = rounded.curve.moved(self._offset)
            caps = rounded.speed_caps
            timed = TimedCurve(self._machine, curve, caps, path.tool_acceleration)
            spans = list(pairwise([0.0, *curve.rests, curve.end]))
            if not self._like:
                found = [estimate(timed, *span, _CELLS) for span in spans]
                if not all(isfinite(rough.duration) for rough in found):
                    return inf
                self._like = found
            pairs = zip(spans, self._like, strict=True)
            return sum(estimate(timed, *span, _CELLS, like).duration for span, like in pairs)
        except (PathError, UnreachableError, SingularityError):
            return inf
