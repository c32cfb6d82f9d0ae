"""The quickest motion between two rests of a curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray
from duoglide.motion.carriage_path import CarriagePath
from duoglide.motion.profile import SIGMA, TIME, Profile
from duoglide.planning.path_terms import limit_table, motion_within, peaks, pieces_of, stretch
from duoglide.planning.retiming import Retiming, RetimingProblem, on_grid
from duoglide.planning.timing_base import seven_phases
from duoglide.planning.timing_grid import grid

POINTS = 9  # at which each piece of a profile is looked at
_ROUNDING = 1e-6
_RESOLVED = 0.005  # of overshoot between points; a cell with more is divided
_USED = 0.93  # mean use of the limit that holds a motion back; a cell with less is divided
_SAME = 1e-7  # of the duration; knots nearer than that are one


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How finely and how long to look for the quickest timing.

    Attributes:
        coarse: Cells of the first problem, which only shows where time is spent.
        cells: Cells of the second problem.
        per_piece: Cells of each piece of the curve, at least.
        rounds: Tangents of the jerk limit in the second problem.
        refine: How often to divide cells in which the motion exceeds a limit between points.
        polish: How often to lower the limits where the motion between the knots exceeds them.
        tolerance: Of the duration, relative.
    """

    coarse: int = 40
    cells: int = 120
    per_piece: int = 6
    rounds: int = 3
    refine: int = 2
    polish: int = 2
    tolerance: float = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Span:
    """A profile between two rests.

    Attributes:
        profile: Certified: every limit holds.
        reason: Why it is not the near-optimal one; empty where it is.
    """

    profile: Profile
    reason: str = ""


def time_span(path: CarriagePath, start: float, end: float, effort: Effort) -> Span:
    """Time the part of a curve between two rests, ``start`` and ``end`` [mm]."""
    breaks = path.curve.breaks
    inner = breaks[(breaks > start) & (breaks < end)]
    base = _first_motion(path, start, end, inner)
    fixed = np.array([0.0, *(base.time_at(b) for b in inner), base.duration])
    slow = _certified(path, on_grid(base, _fine_grid(base, fixed), inner))
    found = _quickest(path, base, fixed, effort)
    if found is None:
        return Span(slow, "the interior-point method did not converge")
    return Span(found if found.duration < slow.duration else slow)


def _fine_grid(base: Profile, fixed: FloatArray) -> FloatArray:
    """Return a grid with all the base's own knots, so that it stays what it is."""
    every = np.concatenate([fixed, base.knots[:, TIME], np.linspace(0.0, base.duration, 65)])
    every.sort()
    apart = np.diff(every, prepend=-1.0) > _SAME * base.duration
    return np.union1d(every[apart], fixed)


def _own_clock(base: Profile) -> tuple[FloatArray, FloatArray]:
    ends = np.array([0.0, base.duration])
    return ends, ends


def _first_motion(path: CarriagePath, start: float, end: float, inner: FloatArray) -> Profile:
    """Return a motion with constant bounds that about fit the first derivatives everywhere."""
    sigma = np.unique(np.concatenate([np.linspace(start, end, 65), inner]))
    slopes = np.abs(path.derivatives(sigma, pieces_of(path, sigma))[:, 1, :])
    limits = limit_table(path.machine.limits)
    bounds = (limits[:, None, :] / np.maximum(slopes, 1e-12 * slopes.max())).min(axis=(1, 2))
    return seven_phases(start, end, (bounds[0], bounds[1], bounds[2]))


def _use(path: CarriagePath, profile: Profile) -> FloatArray:
    """Return the largest use of each limit in each piece of a profile, (n, 3, 3)."""
    limits = limit_table(path.machine.limits)
    return peaks(motion_within(path, profile, POINTS) / limits)


def _certified(path: CarriagePath, profile: Profile) -> Profile:
    """Return ``profile``, slowed by one factor so that no limit is exceeded anywhere."""
    return profile.stretched(stretch(_use(path, profile)) * (1.0 + _ROUNDING))


def _quickest(
    path: CarriagePath, base: Profile, fixed: FloatArray, effort: Effort
) -> Profile | None:
    """Return the near-optimal motion, or None where the solver does not converge."""
    sigma = base.at(fixed)[:, SIGMA]
    wished = base.knots[1:-1, TIME]
    times = grid(fixed, wished, _own_clock(base), effort.coarse, 2)
    rough = RetimingProblem.on(path, on_grid(base, times, sigma))
    first = rough.improved(rough.uniform(), 2, 1e-3)
    if not first.converged:
        return None
    clock = rough.base.knots[:, TIME], rough.profile(first).knots[:, TIME]
    times = grid(fixed, wished, clock, effort.cells, effort.per_piece)
    problem = RetimingProblem.on(path, on_grid(base, times, sigma))
    found = problem.improved(problem.uniform(), effort.rounds, effort.tolerance)
    for _ in range(effort.refine):
        if not found.converged:
            return None
        parts = _parts(path, problem.profile(found))
        times = np.append(
            np.repeat(times[:-1], parts)
            + np.concatenate([np.arange(n) * d / n for n, d in zip(parts, problem.delta)]),
            base.duration,
        )
        found = found.split(problem.delta, parts)
        problem = RetimingProblem.on(path, on_grid(base, times, sigma))
        found = problem.improved(found, 1, effort.tolerance)
    return _polished(path, problem, found, effort) if found.converged else None


def _parts(path: CarriagePath, profile: Profile) -> NDArray[np.intp]:
    """Return into how many parts each cell is to be divided.

    A limit is exceeded between points, or none is used all along, as one is at the optimum.
    """
    samples = np.abs(motion_within(path, profile, POINTS) / limit_table(path.machine.limits))
    over = np.sqrt((samples.max(axis=(1, 2, 3)) - 1.0).clip(0.0) / _RESOLVED)
    slack = samples.mean(axis=1).max(axis=(1, 2)) < _USED
    return np.where(slack, 2, np.clip(np.ceil(over), 1, 4)).astype(np.intp)


def _polished(
    path: CarriagePath, problem: RetimingProblem, found: Retiming, effort: Effort
) -> Profile:
    """Lower the limits where the motion exceeds them between knots; slow down by what remains."""
    profile = problem.profile(found)
    for _ in range(effort.polish):
        problem = problem.tightened(_use(path, profile))
        again = problem.improved(found, 1, effort.tolerance)
        if not again.converged:
            break
        found, profile = again, problem.profile(again)
    return _certified(path, profile)
