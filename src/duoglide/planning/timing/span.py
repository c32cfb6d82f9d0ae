"""The quickest motion between two rests of a curve."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray
from duoglide.machine import Timing
from duoglide.motion.profile import SIGMA, TIME, Profile
from duoglide.motion.timing_report import TimingMethod
from duoglide.planning.compare import less
from duoglide.planning.timing.base import plan_seven_phases
from duoglide.planning.timing.grid import divide_motion
from duoglide.planning.timing.retiming import Retiming, RetimingProblem, on_grid
from duoglide.planning.timing.timed_curve import CellMotion, TimedCurve
from duoglide.planning.timing.use import POINTS, find_largest_use, find_stretch
from duoglide.planning.tolerances import ALIKE


class _Refining(NamedTuple):
    """How closely a motion is brought to its limits, and when that is enough.

    Attributes:
        fine: Share of the duration; a motion that exceeds its limits by less needs no other
            round.
        nearly: The same after ``long`` corrections.
        long: Corrections, after which ``nearly`` is enough.
        resolved: Overshoot between points; a cell with more is divided.
        used: Mean use of the limit that holds a motion back; a cell with less is divided.
        closely: Points of a cell, where windows did not converge.
        sliver: Length of pieces that are taken as part of the one beside them [mm].
        same: Share of the duration; knots nearer than that are one.
        about: Share of the duration, to which an estimate is found.
        again: Tangents of an estimate that begins from another one.
        saved: Tangents in the second problem, because it begins from the first one's
            solution.
        ramp: To reach a limit in less than the share 1 / ``ramp`` of a cell gains nothing.
    """

    fine: float = 3e-4
    nearly: float = 1e-3
    long: int = 6
    resolved: float = 0.005
    used: float = 0.93
    closely: int = 33
    sliver: float = 1e-5
    same: float = 1e-7
    about: float = 3e-3
    again: int = 2
    saved: int = 2
    ramp: float = 30.0


_FIT = _Refining()
COARSE = "a refinement did not converge: the motion before it is kept"
NO_START = "no retiming that begins from toppra's motion converged: it begins from another one"


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How to look for a timing: by which method, how finely and how long.

    Attributes:
        timing: By which method; None: see ``time_path.choose_timing``.
        coarse: Cells of the first problem, which only shows where time is spent.
        cells: Cells of the second problem.
        per_piece: Cells of each piece of the curve, at least.
        rounds: Tangents of the jerk limit, at least.
        refine: How often to divide cells in which the motion exceeds a limit between points.
        corrections: How often at most to lower limits where the motion between knots exceeds them.
        tolerance: Of the duration, relative.
    """

    timing: Timing | None = None
    coarse: int = 32
    cells: int = 70
    per_piece: int = 4
    rounds: int = 3
    refine: int = 2
    corrections: int = 12
    tolerance: float = 1e-5

    def use_more_cells(self) -> Effort:
        """Return what to try where this did not converge: other knots, and more of them."""
        return replace(self, coarse=2 * self.coarse, cells=self.cells + self.cells // 2)


@dataclass(frozen=True, slots=True, eq=False)
class Span:
    """A profile between two rests.

    Attributes:
        profile: Certified: every limit holds.
        method: Which stage made it.
        reason: Why it is not the near-optimal one; empty where it is.
    """

    profile: Profile
    method: TimingMethod = TimingMethod.NEAR_OPTIMAL
    reason: str = ""


def time_span(
    timed: TimedCurve, start: float, end: float, effort: Effort, like: Profile | None = None
) -> Span:
    """Time the part of a curve between two rests, ``start`` and ``end`` [mm].

    Args:
        timed: The curve.
        start: Where the motion begins [mm].
        end: Where it ends [mm].
        effort: How finely to look.
        like: A motion that may exceed the jerk limit, to begin the search from; where that does not
            converge, it begins from a motion of its own, and the span's reason says so.
    """
    search = Search.between(timed, start, end)
    found = search.soften_limits(effort).find_quickest(effort, like)
    if found is None and like is not None:
        again = time_span(timed, start, end, effort)
        return make_span(again.profile, NO_START, again.reason)
    if found is None:
        effort = effort.use_more_cells()
        found = search.soften_limits(effort).find_quickest(effort)
    if found is None:
        reason = "the interior-point method did not converge"
        return Span(search.slow_base(), TimingMethod.CERTIFIED_SLOW, reason)
    if search.fixed.size > 2:
        return found
    simple = search.slow_base()  # which is the optimum where all carriages move alike
    return found if less(found.profile.duration, simple.duration) else Span(simple)


@dataclass(frozen=True, slots=True, eq=False)
class Rough:
    """About how long the quickest motion takes, and that motion on few cells.

    Attributes:
        duration: [s]; infinity where no motion was found.
        fixed: Times of the base at the ends of pieces [s].
        times: Times of the base at the nodes [s].
        shown: Times of the motion at the nodes [s].
        retiming: From one to the other.
    """

    duration: float
    fixed: FloatArray
    times: FloatArray
    shown: FloatArray
    retiming: Retiming

    def adapt_retiming(self, fixed: FloatArray, times: FloatArray) -> Retiming:
        """Return this retiming for a curve like this one, at ``times`` of that one's base."""
        mine, its = self._pairs(fixed)
        at = np.interp(times, its, mine)
        found = self.retiming.resample(self.times, at)
        return replace(found, beta=found.beta * np.gradient(at, times))

    def adapt_clock(self, fixed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the clock of a grid for a curve like this one."""
        mine, its = self._pairs(fixed)
        return np.interp(self.times, mine, its), self.shown

    def _pairs(self, fixed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return times of this base and of another one that belong together."""
        if fixed.size == self.fixed.size:
            return self.fixed, fixed
        return self.fixed[[0, -1]], fixed[[0, -1]]


def estimate(
    timed: TimedCurve, start: float, end: float, cells: int, like: Rough | None = None
) -> Rough:
    """Estimate how long the quickest motion takes.

    Args:
        timed: The curve.
        start: Where the motion begins [mm].
        end: Where it ends [mm].
        cells: Of the problem, about.
        like: The estimate for a curve like this one: where to begin. Estimates that begin alike
            can be compared with each other, better than each with the truth.
    """
    search = Search.between(timed, start, end).soften_limits(Effort(cells=cells))
    clock = search.own_clock if like is None else like.adapt_clock(search.fixed)
    times = search.divide_base(clock, cells, 4)
    problem = search.state_problem(times)
    if like is None:
        found = problem.settle(problem.uniform(), 1, _FIT.about)
    else:
        found = problem.improve(like.adapt_retiming(search.fixed, times), _FIT.again, _FIT.about)
    if not found.converged:
        return Rough(inf, search.fixed, times, times, found)
    shown = np.append(0.0, np.cumsum(found.durations(problem.delta)))
    return Rough(float(shown[-1]), search.fixed, times, shown, found)


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """Search for the quickest retiming of a simple motion.

    Attributes:
        timed: The curve.
        base: A simple motion, which is retimed.
        fixed: Times of it at which a knot must be: the ends, and the curve's breaks [s].
        sigma: The breaks themselves, ends included [mm].
    """

    timed: TimedCurve
    base: Profile
    fixed: FloatArray
    sigma: FloatArray

    @classmethod
    def between(cls, timed: TimedCurve, start: float, end: float) -> Search:
        """Return a search between two rests."""
        sigma = find_marks(timed, start, end)
        return cls.of(timed, plan_seven_phases(start, end, fit_bounds(timed, sigma)), sigma)

    @classmethod
    def of(cls, timed: TimedCurve, base: Profile, sigma: FloatArray) -> Search:
        """Return a search that retimes ``base``; ``sigma`` are what ``find_marks`` finds."""
        fixed = np.array([0.0, *(base.time_at(b) for b in sigma[1:-1]), base.duration])
        return cls(timed, base, fixed, sigma)

    @property
    def own_clock(self) -> tuple[FloatArray, FloatArray]:
        """The base's own time."""
        ends = np.array([0.0, self.base.duration])
        return ends, ends

    def divide_base(
        self, clock: tuple[FloatArray, FloatArray], cells: int, least: int
    ) -> FloatArray:
        """Divide the base into cells that are even on a clock."""
        return divide_motion(self.fixed, self.base.knots[1:-1, TIME], clock, cells, least)

    def state_problem(self, times: FloatArray) -> RetimingProblem:
        """State the problem on a grid."""
        return RetimingProblem.on(self.timed, on_grid(self.base, times, self.sigma))

    def soften_limits(self, effort: Effort) -> Search:
        """Return this search with limits of acceleration and jerk that it can make use of.

        A limit that could be reached in a small share of a cell is lowered: at any higher one the
        motion is as quick, but bends more sharply than cells can show.
        """
        cells = max(effort.cells, effort.per_piece * (self.fixed.size - 1))
        timed = self.timed.soften_limits(_FIT.ramp * cells / self.base.duration)
        if np.array_equal(timed.limits, self.timed.limits):
            return self
        return Search.between(timed, self.sigma[0], self.sigma[-1])

    def slow_base(self) -> Profile:
        """Return the base itself, slowed until it keeps every limit."""
        even = np.linspace(0.0, self.base.duration, 65)
        every = np.union1d(even, self.base.knots[:, TIME])
        near = np.searchsorted(self.fixed, every).clip(1, self.fixed.size - 1)
        gap = np.minimum(every - self.fixed[near - 1], self.fixed[near] - every)
        every = every[np.abs(gap) > _FIT.same * self.base.duration]
        apart = np.diff(every, prepend=-1.0) > _FIT.same * self.base.duration
        times = np.union1d(every[apart], self.fixed)
        return _slow_to_limits(self.timed, on_grid(self.base, times, self.sigma))

    def find_quickest(self, effort: Effort, like: Profile | None = None) -> Span | None:
        """Return the near-optimal motion, or None where the solver does not converge.

        Args:
            effort: How finely to look.
            like: Shows where time is spent and begins the search; without it, a problem of few
                cells does.
        """
        if like is None:
            coarse = self.divide_base(self.own_clock, effort.coarse, 2)
            rough = self.state_problem(coarse)
            first = rough.settle(rough.uniform(), 1, 1e-3)
            if not first.converged:
                return None
            clock = rough.base.knots[:, TIME], rough.profile(first).knots[:, TIME]
        else:
            there = [self.base.time_at(sigma) for sigma in like.knots[:, SIGMA].tolist()]
            clock = np.array(there), like.knots[:, TIME]
        times = self.divide_base(clock, effort.cells, effort.per_piece)
        timed = self.timed.soften_limits(
            _FIT.ramp * times.size / clock[1][-1]
        )  # the base is slower than that
        search = replace(self, timed=timed)
        problem = search.state_problem(times)
        begin = first.resample(coarse, times) if like is None else problem.follow(like)
        found = problem.settle(begin, max(1, effort.rounds - _FIT.saved), effort.tolerance)
        if not found.converged:
            return None
        for _ in range(effort.refine):
            parts = count_parts(timed, problem.profile(found))
            before, times = times, divide_cells(times, parts)
            finer = search.state_problem(times)
            again = finer.improve(found.resample(before, times), 1, effort.tolerance)
            if not again.converged:
                span = _correct_overshoots(timed, problem, found, effort)
                return make_span(span.profile, COARSE, span.reason)
            problem, found = finer, again
        return _correct_overshoots(timed, problem, found, effort)


def find_marks(timed: TimedCurve, start: float, end: float) -> FloatArray:
    """Return sigma of both ends, and of every break between them that needs a knot [mm]."""
    breaks = timed.breaks
    sliver = min(_FIT.sliver, 1e-3 * (end - start))
    inner = breaks[(breaks > start + sliver) & (breaks < end - sliver)]
    inner = inner[np.diff(inner, prepend=start) > sliver]
    return np.array([start, *inner, end])


def fit_bounds(timed: TimedCurve, marked: FloatArray) -> tuple[float, float, float]:
    """Return bounds of the derivatives of sigma that about fit the limits everywhere."""
    sigma = np.unique(np.concatenate([np.linspace(marked[0], marked[-1], 65), marked]))
    unit = np.zeros((sigma.size, 4))
    unit[:, 0], unit[:, 1] = sigma, 1.0
    use = np.abs(timed.motion(unit, timed.pieces_between(sigma))[:, 0])  # of velocity, at 1 mm/s
    slopes = use * timed.limits[0]
    largest = np.maximum(slopes, 1e-12 * slopes.max()).max(axis=0)
    speed, acceleration, jerk = (timed.limits / largest).min(axis=1).tolist()
    return speed, acceleration, jerk


def _slow_to_limits(timed: TimedCurve, profile: Profile) -> Profile:
    """Return ``profile``, slowed by one factor so that no limit is exceeded anywhere."""
    return profile.stretch(find_stretch(find_largest_use(timed, profile)) * (1.0 + ALIKE))


def count_parts(timed: TimedCurve, profile: Profile) -> NDArray[np.intp]:
    """Return into how many parts each cell is to be divided.

    A limit is exceeded between points, or none is used all along, as one is at the optimum.
    """
    uses = CellMotion.of(timed, profile, POINTS).uses()
    over = np.sqrt((uses.max(axis=(1, 2, 3)) - 1.0).clip(0.0) / _FIT.resolved)
    slack = uses.mean(axis=1).max(axis=(1, 2)) < _FIT.used
    return np.where(slack, 2, np.clip(np.ceil(over), 1, 4)).astype(np.intp)


def divide_cells(times: FloatArray, parts: NDArray[np.intp]) -> FloatArray:
    """Divide each cell of a grid into even parts."""
    cell = np.repeat(np.arange(parts.size), parts)
    share = (np.arange(cell.size) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[cell]
    return np.append(times[cell] + share * np.diff(times)[cell], times[-1])


def _correct_overshoots(
    timed: TimedCurve, problem: RetimingProblem, found: Retiming, effort: Effort
) -> Span:
    """Lower the limits where the motion exceeds them between knots; slow down by what remains."""
    best = problem.profile(found), found.kept
    least, remedy = inf, ""
    for turn in range(effort.corrections + 1):
        profile = problem.profile(found)
        use = find_largest_use(timed, profile)
        factor = find_stretch(use)
        if profile.duration * factor < least:
            best, least = (profile, found.kept), profile.duration * factor
        enough = _FIT.nearly if turn >= _FIT.long else _FIT.fine
        if least < (1.0 + enough) * profile.duration or turn == effort.corrections:
            break
        problem = problem.tighten(use)
        again = problem.improve(found, 1, effort.tolerance)
        if not again.converged:
            remedy = "a correction of overshoots did not converge: the whole is slowed instead"
            break
        found = again
    profile, kept = best
    if kept:  # such a motion may bend within a cell as no solution does
        close = find_stretch(find_largest_use(timed, profile, _FIT.closely))
        least = max(least, profile.duration * close)
    profile = profile.stretch(least / profile.duration * (1.0 + ALIKE))
    return make_span(profile, f"{kept} windows of it did not converge" if kept else "", remedy)


def make_span(profile: Profile, *reasons: str) -> Span:
    """Return a span that is near the optimum but for some reasons, which may be empty."""
    told = "; ".join(filter(None, reasons))
    return Span(profile, TimingMethod.IN_PART if told else TimingMethod.NEAR_OPTIMAL, told)
