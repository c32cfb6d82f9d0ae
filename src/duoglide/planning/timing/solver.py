"""Solve the retiming problem, a long one window by window.

A retiming that keeps the limits all along is at hand before each solve: the last one, or one by a
single factor. A window is a run of cells whose ends stay in the states of that retiming, while all
between them is free. So every window is feasible, what it finds joins its neighbours with position,
speed and acceleration continuous, and a window that does not converge keeps what it had. What one
sweep of windows holds at their ends, a second sweep, half a window on, sets free. The work grows
with the number of cells, and each solve stays as small, and converges as well, as a short path's.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray
from duoglide.planning.timing import interior_point
from duoglide.planning.timing.interior_point import Goal, Rows
from duoglide.planning.timing.rows import make_duration_points, make_limit_rows, replace_unknowns

WINDOW = 320  # cells
LONG = 480  # cells, from which on a problem is cut into windows


class _Windows(NamedTuple):
    """How windows are begun, and how many of them must converge.

    Attributes:
        shrinks: Times the last solution, to begin the next one strictly inside; where the
            solver fails from near the bounds, it begins again farther from them.
        shrink_ends: The same where the ends of windows stay as they are.
        far: A solution that exceeds a limit by more than this is not slowed to keep it: one
            place would slow all of it, and the solver would begin far from where it ends.
        far_slack: Slack with which rows that are exceeded then begin.
        enough: Share of the windows that must converge, or the sweep has failed.
        close: A row with less than this left, of about 1, holds the motion back.
        held: So many such rows for each node show that the start is near the solution.
        idle: There a row with more than this left is left out: most limits hold nowhere near, and
            each row costs its time in every step.
        broken: If a solution exceeds any row by more than this, it is found again with all rows.
    """

    shrinks: tuple[float, ...] = (0.95, 0.7, 0.45)
    shrink_ends: float = 0.99
    far: float = 2.0
    far_slack: float = 0.1
    enough: float = 0.5
    close: float = 0.1
    held: float = 1.2
    idle: float = 0.7
    broken: float = 3e-3


_WINDOWS = _Windows()


class Nodes(NamedTuple):
    """Alpha and beta at each node, (n + 1,) each."""

    alpha: FloatArray
    beta: FloatArray

    def between(self, low: int, high: int) -> Nodes:
        """Return the nodes of the cells from ``low`` to before ``high``."""
        return Nodes(self.alpha[low : high + 1], self.beta[low : high + 1])

    def scaled(self, factor: float) -> Nodes:
        """Return all of it times a factor."""
        return Nodes(self.alpha * factor, self.beta * factor)


class Limits(NamedTuple):
    """Length of each cell, and the limits of ``make_limit_rows``."""

    delta: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    force: FloatArray

    def window(self, low: int, high: int) -> Limits:
        """Return the cells from ``low`` to before ``high``."""
        return Limits(*(part[low:high] for part in self))


class Solution(NamedTuple):
    """What was found.

    Attributes:
        nodes: alpha and beta at each node.
        converged: Whether the solver did, in most windows.
        kept: In how many it did not, so that they keep what they had.
    """

    nodes: Nodes
    converged: bool
    kept: int = 0


def solve(limits: Limits, start: Nodes, tolerance: float, from_rest: bool = True) -> Solution:
    """Return the quickest retiming with the tangents of the jerk limit at ``start``.

    Args:
        limits: Of a motion that ends at rest.
        start: Where to begin, and where the tangents are.
        tolerance: Of the duration, relative.
        from_rest: Whether the motion begins at rest; else its first node stays as it is, and all
            of it is one window.
    """
    cells = limits.delta.size
    if cells < LONG or not from_rest:
        rows = _make_rows(limits, start)
        return Solution(*_solve_window(limits, rows, start, (from_rest, True), tolerance))
    edges, between = _choose_cuts(cells)
    first = _sweep(limits, start, edges, tolerance)
    if not first.converged:
        return first
    return _sweep(limits, first.nodes, between, tolerance)


def _choose_cuts(cells: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where the windows of both sweeps begin and end."""
    edges = np.linspace(0.0, cells, round(cells / WINDOW) + 1)
    between = 0.5 * (edges[1:] + edges[:-1])
    return _round_cuts(edges, cells), _round_cuts(np.append(0.0, between), cells)


def _round_cuts(cuts: FloatArray, cells: int) -> NDArray[np.intp]:
    """Round cuts to whole cells so that they are the same seen from either end.

    A cut in the middle of the middle cell becomes the two about that cell.
    """
    low = np.floor(cuts[cuts <= 0.5 * cells]).astype(np.intp)
    return np.union1d(low, cells - low)


def _sweep(limits: Limits, start: Nodes, cuts: NDArray[np.intp], tolerance: float) -> Solution:
    """Solve each window between two cuts."""
    worst = interior_point.measure_excess(
        _make_rows(limits, start), _stack_unknowns(start, _unit(limits))
    )
    scale = _WINDOWS.shrink_ends / max(1.0, worst)
    now = start.scaled(scale)
    kept = 0
    for low, high in pairwise(cuts.tolist()):
        if high - low == 1:
            continue  # both of its nodes stay as they are
        part = limits.window(low, high)
        rows = _make_rows(part, start.between(low, high))
        at_rest = low == 0, high == limits.delta.size
        here = now.between(low, high)
        found, converged = _solve_window(part, rows, here, at_rest, tolerance)
        if converged:
            here.alpha[:], here.beta[:] = found
        else:
            kept += 1
    return Solution(now, kept <= (1.0 - _WINDOWS.enough) * (cuts.size - 1), kept)


def _solve_window(
    limits: Limits,
    rows: Rows,
    begin: Nodes,
    at_rest: tuple[bool, bool],
    tolerance: float,
) -> tuple[Nodes, bool]:
    """Solve for the nodes between two ends, each of which is at rest or stays as it is.

    Args:
        limits: Of the cells.
        rows: Of these limits; changed in place.
        begin: Where to begin, and where to stay in the ends that are not at rest.
        at_rest: Whether the first node and the last one are.
        tolerance: Of the duration, relative.
    """
    unit = _unit(limits)
    goal = make_duration_points(limits.delta, unit)
    x = _stack_unknowns(begin, unit)
    ties = _find_ties(x, at_rest)
    goal = goal._replace(offsets=replace_unknowns(goal.first, goal.points, ties))
    np.subtract(rows.bounds, replace_unknowns(rows.first, rows.factors, ties), out=rows.bounds)
    shrinks, slack, known = [1.0], interior_point.LEAST_SLACK, False
    if all(at_rest):
        over = interior_point.measure_excess(rows, x)
        x /= min(max(1.0, over), _WINDOWS.far)
        slack = _WINDOWS.far_slack if over > _WINDOWS.far else slack
        known = over <= 1.0 + _WINDOWS.broken
        shrinks = list(_WINDOWS.shrinks)
    else:
        rows.bounds[~rows.factors.any(axis=1)] = 1.0  # nothing is left to decide there
    inside, converged = x, False
    while shrinks and not converged:
        shrink = shrinks.pop(0)
        x = inside * shrink
        converged = known and _solve_near_rows(rows, goal, x, tolerance)
        if not converged:
            x[:] = inside * shrink
            _steps, converged = interior_point.solve(rows, goal, x, tolerance, slack)
    for unknown, by, value in ties:
        x[unknown] = x[by] if by >= 0 else value
    return Nodes(x[0::2].copy(), x[1::2] / unit), bool(converged)


def _solve_near_rows(rows: Rows, goal: Goal, x: FloatArray, tolerance: float) -> bool:
    """Solve in place with the rows that are near their bounds, and tell whether that is enough.

    It is only tried from near a solution, which has about two rows at their bounds for each node.
    """
    if interior_point.pick_rows(rows, x, _WINDOWS.close).sum() < _WINDOWS.held * (x.size // 2):
        return False
    near = interior_point.pick_rows(rows, x, _WINDOWS.idle)
    some = Rows(rows.first[near], rows.factors[near], rows.bounds[near])
    _steps, converged = interior_point.solve(some, goal, x, tolerance)
    broken = interior_point.pick_rows(rows, x, -_WINDOWS.broken)
    return converged and not broken.any()


def _find_ties(x: FloatArray, at_rest: tuple[bool, bool]) -> list[tuple[int, int, float]]:
    """Return the unknowns at the ends that are not free: which, and by which other or value.

    At rest alpha is constant in the first or last cell: what else it did there would cost nothing,
    because the motion hardly moves.
    """
    last = x.size - 2
    ties = []
    for rest, end, beside in zip(at_rest, (0, last), (2, last - 2), strict=True):
        if rest:
            ties += [(end, beside, 0.0), (end + 1, -1, 0.0), (beside + 1, -1, 0.0)]
        else:
            ties += [(end, -1, float(x[end])), (end + 1, -1, float(x[end + 1]))]
    return ties


def _make_rows(limits: Limits, at: Nodes) -> Rows:
    """Return the rows of all limits, with the tangents of the jerk limit at ``at``."""
    alpha, beta = at
    middle = 0.5 * (alpha[1:] + alpha[:-1]) - 0.25 * limits.delta * np.diff(beta)
    tangent = np.column_stack([alpha[:-1], middle, alpha[1:]])
    return make_limit_rows(limits.delta, _unit(limits), tuple(limits[1:]), tangent)


def _unit(limits: Limits) -> float:
    """Return the factor of beta in the unknowns [s]."""
    return float(limits.delta.sum()) / limits.delta.size


def _stack_unknowns(nodes: Nodes, unit: float) -> FloatArray:
    """Return alpha and ``unit`` times beta of each node in turn."""
    x = np.empty(2 * nodes.alpha.size)
    x[0::2] = nodes.alpha
    x[1::2] = unit * nodes.beta
    return x
