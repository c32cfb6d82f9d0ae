"""A curve of continuous curvature through dense points: the fairest one within their tolerance.

A cubic spline over few knots is fitted to the points; knots are put in where it misses them. What
the tolerance leaves is then spent on fairness: of all splines over these knots within it, the one
whose third derivative is least. The parameter is carried to arc length in between. What comes out
is certified on every span, against the points and against the polyline, and not by samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array, diags

from duoglide.arrays import BoolArray, FloatArray

_DEGREE = 3
_AIMED = 0.3  # of the tolerance, to which knots are chosen; the rest is spent on fairness,
_BESIDE = 0.8  # and the same for places on a line, which a curve through its ends may leave
_ASIDE = 0.02  # weight of such a place beside a point
_SPENT = 0.7  # of the tolerance, that fairness may use; the rest is for what lies between points
_LEAST_SPENT = 0.1  # where it had to be less than this, there is no fit
_TRIES = 5
_LEAST_KNOTS = 6  # spans at least: three control points at each end may be fixed
_FINEST = 0.01  # [mm]; no shorter span is divided
_UNEVEN = 4.0  # neighbouring spans differ by no more
_ROUNDS = 14  # of putting in knots
_CARRIED = 2  # times the parameter is carried to arc length
_CURE = 1e-3  # of fairness in the least squares, where a span has no points
_LOST = 1e-12  # what stands for nothing in a quotient
# Alternating directions (ADMM) for the fairest curve in tubes:
_SWEEPS = 800
_LOOK = 25  # sweeps from one look at what still moves to the next
_STILL = 3e-3  # of the tolerance; control points that move less are found
_RELAXED = 1.6
_STIFF = 30.0  # of the penalty, over what balances both sides at the length of a span
_HURRY = 4.5  # power of the pace by which fairness counts: where it is quick, bends cost more
_SLOWEST = 0.05  # of the quickest pace
_DENSE = 100  # control points up to which full matrices are quicker than banded ones
_PARTS = 4  # of each line, where its distance from the curve is bounded
_PACES = 8  # places in a span where the pace is taken


@dataclass(frozen=True, eq=False)
class Fit:
    """Pieces of a curve through dense points.

    Attributes:
        spans: Their lengths in sigma [mm], shape (k,).
        coefficients: Powers of u = s / span, shape (k, 4, 3) [mm].
        at: Sigma nearest to each point [mm], ascending, shape (n,).
        deviation: Distance of each point from the curve [mm], shape (n,).
    """

    spans: FloatArray
    coefficients: FloatArray
    at: FloatArray
    deviation: FloatArray


def fit_points(
    points: FloatArray,
    tolerance: FloatArray,
    leave: FloatArray | None,
    arrive: FloatArray | None,
) -> Fit | None:
    """Fit a curve to dense points.

    Args:
        points: Shape (n, 3), n at least 3 [mm]; the ends are kept exactly.
        tolerance: By how much the curve may miss each point, shape (n,) [mm], above 0. Between two
            points it stays within the smaller of theirs from the line between them.
        leave: Unit vector in which the curve leaves, without curvature; None: free.
        arrive: The same where it arrives.

    Returns:
        The fit; None where none was found that keeps the tolerance.
    """
    origin = points[0]
    work = _Work(points - origin, tolerance, leave, arrive)
    allowed = _SPENT
    for _ in range(_TRIES):
        spline = work.fit(allowed)
        found, worst = _certify(spline, work.at, points - origin, tolerance)
        if worst <= 1.0:
            found.coefficients[:, 0] += origin
            return found
        allowed *= min(0.9, 0.98 / worst)
        if allowed < _LEAST_SPENT:
            return None
    return None


class _Samples(NamedTuple):
    """Where a curve is to pass: points, and places on lines that are long beside others.

    Attributes:
        at: Parameter, ascending, shape (n,) [mm].
        points: Shape (n, 3) [mm].
        tolerance: Shape (n,) [mm].
        given: Whether it is a point, and not a place on a line, shape (n,).
    """

    at: FloatArray
    points: FloatArray
    tolerance: FloatArray
    given: BoolArray


class _Work:
    """Points, the parameter of each, and the knots so far."""

    def __init__(
        self,
        points: FloatArray,
        tolerance: FloatArray,
        leave: FloatArray | None,
        arrive: FloatArray | None,
    ) -> None:
        self.points, self.tolerance = points, tolerance
        self.leave, self.arrive = leave, arrive
        self.at = _first_parameter(points, tolerance)
        end = self.at[-1]
        self.knots = np.linspace(0.0, end, _LEAST_KNOTS + 1)
        for turn in range(_CARRIED + 1):
            spline = self._choose_knots()
            if turn < _CARRIED:
                self._carry(spline)
        # The third derivative steps from span to span, and the jerk of a motion with it. Knots that
        # just meet the tolerance leave steps which a motion has to slow down for.
        self.knots = np.sort(np.concatenate([self.knots, 0.5 * (self.knots[1:] + self.knots[:-1])]))

    def _choose_knots(self) -> BSpline:
        """Fit by least squares, and put in knots where that misses."""
        samples = _fill(self.at, self.points, self.tolerance)
        t, p, tolerance, given = samples
        allowed = np.where(given, _AIMED, _BESIDE) * tolerance
        for _ in range(_ROUNDS):
            spline = _Basis(self.knots, samples, self.leave, self.arrive).least_squares()
            missed = np.linalg.norm(spline(t) - p, axis=1) > allowed
            span = np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, len(self.knots) - 2)
            split = np.unique(span[missed])
            lengths = np.diff(self.knots)
            split = split[lengths[split] > 2.0 * _FINEST]
            if split.size == 0:
                break
            middle = 0.5 * (self.knots[split] + self.knots[split + 1])
            self.knots = _even(np.sort(np.concatenate([self.knots, middle])))
        return spline

    def _carry(self, spline: BSpline) -> None:
        """Carry parameter and knots to arc length along a spline, points to where it is nearest."""
        t = _project(spline, self.at, self.points)
        grid = np.unique(
            np.concatenate([self.knots, t, np.linspace(0.0, t[-1], 4 * len(self.knots))])
        )
        length = np.concatenate([[0.0], np.cumsum(_arc_lengths(spline, grid))])
        self.at = np.interp(t, grid, length)
        self.knots = np.interp(self.knots, grid, length)

    def fit(self, allowed: float) -> BSpline:
        """Return the fairest spline within a share of the tolerance of all points."""
        samples = _fill(self.at, self.points, self.tolerance)
        return _Basis(self.knots, samples, self.leave, self.arrive).fairest(allowed)


class _Basis:
    """B-splines over knots, at given parameters; control points at the ends may be fixed."""

    def __init__(
        self,
        breaks: FloatArray,
        samples: _Samples,
        leave: FloatArray | None,
        arrive: FloatArray | None,
    ) -> None:
        t, given, first, last = samples.at, samples.given, samples.points[0], samples.points[-1]
        self.samples = samples
        self.knots = np.concatenate([[breaks[0]] * 3, breaks, [breaks[-1]] * 3])
        count = len(breaks) + 2
        self.control = np.zeros((count, 3))
        head = _end_points(first, leave, breaks[1] - breaks[0], breaks[2] - breaks[1])
        tail = _end_points(
            last,
            None if arrive is None else -arrive,
            breaks[-1] - breaks[-2],
            breaks[-2] - breaks[-3],
        )
        self.control[: len(head)] = head
        self.control[count - len(tail) :] = tail[::-1]
        self.free = slice(len(head), count - len(tail))
        self.matrix = csr_array(BSpline.design_matrix(t, self.knots, _DEGREE))
        self.breaks = breaks
        self.third = _third_derivatives(self.knots, np.diff(breaks))
        spans = np.diff(breaks)
        index = np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, spans.size - 1)
        share = np.bincount(index, minlength=spans.size)
        counts = np.where(given, 1.0, _ASIDE)
        self.index = index
        self.weight = spans[index] ** -5.0 * counts / np.maximum(share[index], 1)

    def _prepare(self, weight: FloatArray, fairness: float) -> Callable[[FloatArray], FloatArray]:
        """Return what finds the control points that are best for targets, shape (n, 3) each."""
        back = csr_array(self.matrix.T * weight)
        normal = csr_array(back @ self.matrix + fairness * (self.third.T @ self.third))
        fixed = self.control.copy()
        fixed[self.free] = 0.0
        known = (normal @ fixed)[self.free]
        inner = normal[self.free, self.free]
        to_right = csr_array(back[self.free])
        if inner.shape[0] <= _DENSE:
            inverse = np.linalg.inv(inner.toarray())
            whole, offset = inverse @ to_right.toarray(), inverse @ known

            def find(targets: FloatArray) -> FloatArray:
                control = fixed.copy()
                control[self.free] = whole @ targets - offset
                return control

            return find
        bands = np.zeros((4, inner.shape[0]))
        for k in range(4):
            bands[k, : inner.shape[0] - k] = inner.diagonal(k)
        factor = cholesky_banded(bands, lower=True, check_finite=False)

        def find_banded(targets: FloatArray) -> FloatArray:
            control = fixed.copy()
            right = to_right @ targets - known
            control[self.free] = cho_solve_banded((factor, True), right, check_finite=False)
            return control

        return find_banded

    def least_squares(self) -> BSpline:
        """Fit to points."""
        control = self._prepare(self.weight, _CURE)(self.samples.points)
        return BSpline(self.knots, control, _DEGREE)

    def fairest(self, share: float) -> BSpline:
        """Find the least third derivative in balls about points, by alternating directions.

        Args:
            share: Of the tolerance, that is the radius of the balls.
        """
        p, allowed = self.samples.points, share * self.samples.tolerance
        safe = self.least_squares().c
        pace = _pace(BSpline(self.knots, safe, _DEGREE), self.breaks) ** _HURRY
        self.third = csr_array(csr_array(diags(np.sqrt(pace))) @ self.third)
        find = self._prepare(_STIFF * self.weight * pace[self.index], 1.0)
        matrix = self.matrix.toarray() if self.matrix.shape[1] <= _DENSE else self.matrix
        control = find(p)
        dual, held, before = np.zeros_like(p), p, control
        still = _STILL * float(allowed.min())
        for sweep in range(_SWEEPS):
            here = _RELAXED * (matrix @ control) + (1.0 - _RELAXED) * held + dual
            off = here - p
            size = np.sqrt(np.einsum("ij,ij->i", off, off))
            held = p + off * np.minimum(1.0, allowed / np.maximum(size, _LOST))[:, None]
            dual = here - held
            control = find(held - dual)
            if sweep % _LOOK == 0:
                if np.abs(control - before).max() < still:
                    break
                before = control
        over = np.linalg.norm(self.matrix @ control - p, axis=1)
        under = np.linalg.norm(self.matrix @ safe - p, axis=1)
        # distances are convex: a mixture with the safe one keeps what is allowed
        with np.errstate(divide="ignore", invalid="ignore"):
            most = np.where(over > allowed, (allowed - under) / (over - under), 1.0)
        mix = float(np.clip(most.min(initial=1.0), 0.0, 1.0))
        return BSpline(self.knots, safe + mix * (control - safe), _DEGREE)


def _end_points(end: FloatArray, way: FloatArray | None, h: float, following: float) -> FloatArray:
    """Return the control points at an end that are fixed."""
    if way is None:
        return end[None]
    return np.array([end, end + way * (h / 3.0), end + way * ((2.0 * h + following) / 3.0)])


def _third_derivatives(knots: FloatArray, spans: FloatArray) -> csr_array:
    """Return the matrix from control points to the third derivative times sqrt(h) of each span."""
    matrix = None
    inner = knots
    for degree in (3, 2, 1):
        inner = inner[1:-1]
        gap = inner[degree:] - inner[:-degree]
        count = gap.size
        sides = diags([-degree / gap, degree / gap], offsets=[0, 1], shape=(count, count + 1))
        step = csr_array(sides)
        matrix = step if matrix is None else step @ matrix
    return csr_array(csr_array(diags(np.sqrt(spans))) @ matrix)


def _pace(spline: BSpline, breaks: FloatArray) -> FloatArray:
    """Return how fast a point that may accelerate by 1 passes each span, in shares of the most."""
    parts = np.arange(_PACES) / _PACES
    spans = np.diff(breaks)
    t = np.append((breaks[:-1, None] + spans[:, None] * parts).ravel(), breaks[-1])
    slope, bend = spline.derivative(1)(t), spline.derivative(2)(t)
    size = np.maximum(np.linalg.norm(slope, axis=1), _LOST)
    curvature = np.linalg.norm(np.cross(slope, bend), axis=1) / size**3
    steps = np.diff(t) * 0.5 * (size[:-1] + size[1:])
    squares = _squares_of_pace(curvature.tolist(), steps.tolist())
    pace: FloatArray = np.sqrt(np.interp(breaks[:-1] + 0.5 * spans, t, squares))
    shares: FloatArray = np.maximum(pace / pace.max(), _SLOWEST)
    return shares


def _squares_of_pace(curvature: list[float], steps: list[float]) -> list[float]:
    """Return the greatest squares of a pace from rest to rest with an acceleration of 1."""
    squares = [1.0 / max(bend, _LOST) for bend in curvature]
    squares[0] = squares[-1] = 0.0
    for i in range(1, len(squares)):
        aside = squares[i - 1] * curvature[i - 1]
        gain = 2.0 * steps[i - 1] * max(1.0 - aside * aside, 0.0) ** 0.5
        squares[i] = min(squares[i], squares[i - 1] + gain)
    for i in range(len(squares) - 2, -1, -1):
        aside = squares[i + 1] * curvature[i + 1]
        gain = 2.0 * steps[i] * max(1.0 - aside * aside, 0.0) ** 0.5
        squares[i] = min(squares[i], squares[i + 1] + gain)
    return squares


def _even(breaks: FloatArray) -> FloatArray:
    """Put in knots until neighbouring spans differ by no more than four."""
    while True:
        spans = np.diff(breaks)
        beside = np.minimum(np.concatenate([spans[1:], [inf]]), np.concatenate([[inf], spans[:-1]]))
        wide = np.flatnonzero(spans > (1.0 + 1e-9) * _UNEVEN * beside)
        if wide.size == 0:
            return breaks
        breaks = np.sort(np.concatenate([breaks, 0.5 * (breaks[wide] + breaks[wide + 1])]))


def _first_parameter(points: FloatArray, tolerance: FloatArray) -> FloatArray:
    """Return a parameter near arc length that scatter of the points does not lengthen."""
    kept = [0]
    last = points[0]
    reach = 0.5 * tolerance
    steps = points.tolist()
    x, y, z = last.tolist()
    for i in range(1, len(steps) - 1):
        a, b, c = steps[i]
        if (a - x) ** 2 + (b - y) ** 2 + (c - z) ** 2 > reach[i] ** 2:
            kept.append(i)
            x, y, z = a, b, c
    kept.append(len(steps) - 1)
    index = np.array(kept)
    chain = points[index]
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=1))])
    part = np.clip(
        np.searchsorted(index, np.arange(len(points)), side="right") - 1, 0, index.size - 2
    )
    way = chain[part + 1] - chain[part]
    share = np.sum((points - chain[part]) * way, axis=1) / np.maximum(
        np.sum(way * way, axis=1), _LOST**2
    )
    at = length[part] + np.clip(share, 0.0, 1.0) * (length[part + 1] - length[part])
    return np.maximum.accumulate(at)


def _fill(at: FloatArray, points: FloatArray, tolerance: FloatArray) -> _Samples:
    """Add places on lines that are long beside their neighbours, closer towards their ends."""
    gaps = np.diff(at)
    before, after = np.concatenate([[inf], gaps[:-1]]), np.concatenate([gaps[1:], [inf]])
    rows = [(at, points, tolerance, np.ones(at.size, dtype=bool))]
    for i in np.flatnonzero(gaps > 3.0 * np.minimum(before, after)).tolist():
        shares = []
        for near, flip in ((before[i], False), (after[i], True)):
            step = max(near, gaps[i] * 1e-3)
            place = step
            while place < 0.6 * gaps[i] and step < gaps[i]:
                shares.append(1.0 - place / gaps[i] if flip else place / gaps[i])
                step *= 1.5
                place += step
        share = np.unique(shares)[:, None]
        if share.size:
            rows.append(
                (
                    at[i] + share[:, 0] * gaps[i],
                    points[i] + share * (points[i + 1] - points[i]),
                    np.full(share.size, min(tolerance[i], tolerance[i + 1])),
                    np.zeros(share.size, dtype=bool),
                )
            )
    t, p, limits, given = (np.concatenate(column) for column in zip(*rows, strict=True))
    order = np.argsort(t, kind="stable")
    return _Samples(t[order], p[order], limits[order], given[order])


def _project(spline: BSpline, t: FloatArray, points: FloatArray) -> FloatArray:
    """Go from parameters towards the points of the spline that are nearest by; ends stay."""
    rate = spline.derivative()
    end = t[-1]
    for _ in range(3):
        slope = rate(t)
        step = np.sum((points - spline(t)) * slope, axis=1) / np.maximum(
            np.sum(slope * slope, axis=1), _LOST
        )
        t = np.clip(t + step, 0.0, end)
        t[0], t[-1] = 0.0, end
        t = np.maximum.accumulate(t)
    return t


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def _arc_lengths(spline: BSpline, grid: FloatArray) -> FloatArray:
    """Return the arc length of each part of a grid."""
    half = 0.5 * np.diff(grid)
    places = grid[:-1, None] + half[:, None] * (1.0 + _NODES)
    speed = np.linalg.norm(spline.derivative()(places), axis=-1)
    lengths: FloatArray = np.maximum((speed @ _WEIGHTS) * half, _LOST)
    return lengths


def _certify(
    spline: BSpline, at: FloatArray, points: FloatArray, tolerance: FloatArray
) -> tuple[Fit, float]:
    """Return the pieces, and the most that they miss by, in shares of the tolerance.

    A point is as near as the place on the curve that is found. Between the places of two points the
    distance from their line is convex along a chord, and the curve leaves its chord by no more than
    an eighth of the square of its length times the greatest second derivative.
    """
    t = _project(spline, at, points)
    off = np.linalg.norm(spline(t) - points, axis=1)
    worst = float((off / tolerance).max())
    grid = np.unique(
        np.concatenate(
            [
                spline.t,
                (t[:-1, None] + np.diff(t)[:, None] * (np.arange(_PARTS) / _PARTS)).ravel(),
                t,
            ]
        )
    )
    bend = np.linalg.norm(spline.derivative(2)(grid), axis=1)
    bulge = 0.125 * np.diff(grid) ** 2 * np.maximum(bend[:-1], bend[1:])
    middle = 0.5 * (grid[:-1] + grid[1:])
    line = np.clip(np.searchsorted(t, middle, side="right") - 1, 0, len(t) - 2)
    place = spline(grid)
    ends = np.maximum(
        _from_line(place[:-1], points[line], points[line + 1]),
        _from_line(place[1:], points[line], points[line + 1]),
    )
    limit = np.minimum(tolerance[line], tolerance[line + 1])
    worst = max(worst, float(((ends + bulge) / limit).max()))
    breaks = np.unique(spline.t)
    spans = np.diff(breaks)
    powers = [spline(breaks[:-1])]
    for order, factor in ((1, 1.0), (2, 0.5)):
        powers.append(spline.derivative(order)(breaks[:-1]) * factor * spans[:, None] ** order)
    third = spline.derivative(3)(0.5 * (breaks[:-1] + breaks[1:]))
    coefficients = np.stack([*powers, third * spans[:, None] ** 3 / 6.0], axis=1)
    return Fit(spans, coefficients, t, off), worst


def _from_line(place: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distance of places from the lines between a and b [mm]."""
    way = b - a
    share = np.sum((place - a) * way, axis=1) / np.maximum(np.sum(way * way, axis=1), _LOST**2)
    found: FloatArray = np.linalg.norm(place - a - np.clip(share, 0.0, 1.0)[:, None] * way, axis=1)
    return found
