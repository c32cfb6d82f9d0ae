"""The quickest motion from a state in motion to the first rest of a curve."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import LimitError
from duoglide.motion.profile import SIGMA, TIME, Profile
from duoglide.planning.timing.grid import divide_motion
from duoglide.planning.timing.lead import ALLOWED, Lead, continue_known, thin
from duoglide.planning.timing.retiming import Retiming, RetimingProblem
from duoglide.planning.timing.span import (
    COARSE,
    Effort,
    Search,
    Span,
    count_parts,
    divide_cells,
    find_marks,
    fit_bounds,
    make_span,
)
from duoglide.planning.timing.timed_curve import TimedCurve
from duoglide.planning.timing.use import find_largest_use, find_stretch

_SHARP = 1e-7  # of the duration: a start in motion leaves little room, in which rounding grows
_SAME = 1e-3  # of the duration; knots nearer than that to one that must be are left out


def time_moving(timed: TimedCurve, lead: Lead, end: float, effort: Effort) -> Span:
    """Time the part of a curve from its start, in motion, to its first rest.

    Args:
        timed: The curve, with its limits ``lowered``.
        lead: How it begins.
        end: Where it comes to rest [mm].
        effort: How finely to look.

    Raises:
        LimitError: None was found that begins like this.
    """
    effort = replace(effort, tolerance=min(effort.tolerance, _SHARP))
    sigma = find_marks(timed, 0.0, end)
    base = lead.find_first_motion(0.0, end, _bounds(timed, sigma))
    search = _Moving(Search.of(timed, base, sigma), lead)
    with np.errstate(invalid="ignore", divide="ignore"):  # what is no motion is given up
        found = search.find_quickest(effort) or search.find_quickest(effort.use_more_cells())
    if found is None:
        raise LimitError(f"no timing was found that begins at {lead.speed:g} mm/s")
    return found


def _bounds(timed: TimedCurve, sigma: FloatArray) -> tuple[float, float, float]:
    """Return what fits limits and caps: a base far too fast has no room in its first cells."""
    speed, acceleration, jerk = fit_bounds(timed, sigma)
    if timed.has_caps:
        unit = np.zeros((sigma.size, 1, 4))
        unit[:, 0, 0], unit[:, 0, 1] = sigma, 1.0
        caps = timed.caps(unit, timed.pieces_between(sigma)[:, None], sigma)
        speed = min(speed, float((1.0 / caps.speed).min()))
    return speed, acceleration, jerk


@dataclass(frozen=True, slots=True, eq=False)
class _Moving:
    """Search for the quickest motion that begins with a lead.

    Attributes:
        search: For the quickest retiming of a base that begins like that.
        lead: How it begins.
    """

    search: Search
    lead: Lead

    def state_problem(self, times: FloatArray) -> RetimingProblem:
        """State the problem on a grid."""
        return self.lead.grant(self.search.state_problem(times))

    def find_quickest(self, effort: Effort) -> Span | None:
        """Return the near-optimal motion, or None where none keeps the limits."""
        reason = ""
        times, start = self.begin(effort)
        problem = self.state_problem(times)
        found = problem.settle(start, effort.rounds - 1, effort.tolerance)
        if not _is_sound(problem, found):
            return None
        for _ in range(effort.refine):
            parts = count_parts(self.search.timed, problem.profile(found))
            before, times = times, divide_cells(times, parts)
            finer = self.state_problem(times)
            again = finer.improve(found.resample(before, times), 1, effort.tolerance)
            if not _is_sound(finer, again):
                reason = COARSE
                break
            problem, found = finer, again
        profile = self.correct_overshoots(problem, found, effort)
        return None if profile is None else make_span(profile, reason)

    def correct_overshoots(
        self, problem: RetimingProblem, found: Retiming, effort: Effort
    ) -> Profile | None:
        """Lower the limits where the motion exceeds them between knots, until it does not."""
        limits = replace(self.search.timed, sigma_cap=None)  # drive stops judge that cap
        for _ in range(effort.corrections + 1):
            profile = problem.profile(found)
            use = find_largest_use(limits, profile)
            if find_stretch(use) < 1.0 + ALLOWED:
                return profile
            problem = problem.tighten(use)
            found = problem.improve(found, 1, effort.tolerance)
            if not _is_sound(problem, found):
                break
        return None

    def begin(self, effort: Effort) -> tuple[FloatArray, Retiming]:
        """Return a grid with the knots of the known way to rest, and that way itself."""
        search = self.search
        rough = self.state_problem(search.divide_base(search.own_clock, effort.coarse, 2))
        known = self.lead.find_known_part(rough)
        slowness = continue_known(known, rough).alpha ** -0.5
        shown = np.cumsum(0.5 * rough.delta * (slowness[1:] + slowness[:-1]))
        clock = rough.base.knots[:, TIME], np.concatenate([[0.0], shown])
        knots = thin(known, search.sigma, effort.cells)[:, SIGMA]
        there = np.array([search.base.time_at(sigma) for sigma in knots.tolist()])
        gap = np.abs(there[:, None] - search.fixed).min(axis=1)
        beyond = search.fixed[search.fixed > there[-1]]
        parts = np.linspace(beyond[:-1], beyond[1:], effort.per_piece + 1)[1:-1]
        wanted = [*there[gap > _SAME * search.base.duration], *parts.ravel()]
        fixed = np.union1d(search.fixed, wanted)
        times = divide_motion(fixed, np.zeros(0), clock, effort.cells, 1)
        return times, continue_known(known, self.state_problem(times))


def _is_sound(problem: RetimingProblem, found: Retiming) -> bool:
    """Whether the solver converged, to a motion that goes on between the nodes too."""
    return found.converged and bool(np.isfinite(found.durations(problem.delta)).all())
