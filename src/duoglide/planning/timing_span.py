"""The quickest motion between two rests of a curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.motion.carriage_path import CarriagePath
from duoglide.motion.profile import TIME, Profile
from duoglide.planning.path_terms import limit_table, motion_within, pieces_of, stretch
from duoglide.planning.retiming import Retiming, RetimingProblem, on_grid
from duoglide.planning.timing_base import seven_phases
from duoglide.planning.timing_grid import grid


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How finely and how long to look for the quickest timing.

    Attributes:
        coarse: Cells of the first problem, which only shows where time is spent.
        cells: Cells of the second problem.
        per_piece: Cells of each piece of the curve, at least.
        rounds: Tangents of the jerk limit in the second problem.
        polish: How often to lower the limits where the motion between the knots exceeds them.
        tolerance: Of the duration, relative.
    """

    coarse: int = 60
    cells: int = 240
    per_piece: int = 8
    rounds: int = 3
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
    fixed = np.unique(np.concatenate([base.knots[:, TIME], [base.time_at(b) for b in inner]]))
    slow = _certified(path, on_grid(base, grid(fixed, _own_clock(base), 64, 2), inner), 9)
    found = _quickest(path, base, fixed, inner, effort)
    if found is None:
        return Span(slow, "the interior-point method did not converge")
    if found.duration >= slow.duration:
        return Span(slow, "the near-optimal motion came out slower than the simple one")
    return Span(found)


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


def _certified(path: CarriagePath, profile: Profile, points: int) -> Profile:
    """Return ``profile``, slowed until no limit is exceeded at ``points`` of each piece."""
    limits = limit_table(path.machine.limits)
    return profile.stretched(stretch(np.abs(motion_within(path, profile, points)) / limits))


def _quickest(
    path: CarriagePath, base: Profile, fixed: FloatArray, inner: FloatArray, effort: Effort
) -> Profile | None:
    rough = RetimingProblem.on(
        path, on_grid(base, grid(fixed, _own_clock(base), effort.coarse, 2), inner)
    )
    first = rough.improved(rough.uniform(), 2, 1e-3)
    if not first.converged:
        return None
    clock = rough.base.knots[:, TIME], rough.profile(first).knots[:, TIME]
    times = grid(fixed, clock, effort.cells, effort.per_piece)
    problem = RetimingProblem.on(path, on_grid(base, times, inner))
    found = problem.improved(problem.uniform(), effort.rounds, effort.tolerance)
    if not found.converged:
        return None
    return _polished(path, problem, found, effort)


def _polished(
    path: CarriagePath, problem: RetimingProblem, found: Retiming, effort: Effort
) -> Profile:
    """Lower the limits where the motion exceeds them between knots; slow down by what remains."""
    limits = limit_table(path.machine.limits)
    profile = problem.profile(found)
    for _ in range(effort.polish):
        use = np.abs(motion_within(path, profile, 5)) / limits
        problem = problem.tightened(use.max(axis=1))
        again = problem.improved(found, 1, effort.tolerance)
        if not again.converged:
            break
        found, profile = again, problem.profile(again)
    return _certified(path, profile, 9)
