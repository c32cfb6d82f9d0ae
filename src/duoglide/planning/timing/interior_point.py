"""A primal-dual interior-point method for the retiming problem, whose rows touch few unknowns.

Minimise   sum_p weight_p / sqrt(point_p . x + offset_p)   subject to   row_r . x <= bound_r

where ``point_p`` and ``row_r`` are nonzero in four consecutive unknowns only. Each step then solves
a symmetric system with seven diagonals, so that a step costs O(n). Predictor and corrector after
Mehrotra (1992), with the true second derivatives of the objective. Everything is scaled to about 1.

An unknown that no row touches stays as it is.

Compiling must stay short, once per machine: the compiled parts are loops over entries, each called
from one place, and the steps themselves are plain Python.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray
from duoglide.kinematics.compiled import compiled, inlined


class _Stepping(NamedTuple):
    """How a step of the method is made, and what ends it. Compiled code holds the values.

    Attributes:
        steps: At most; then it has not converged.
        back: Share of the way to the nearest bound.
        back_cost: Share of the way to an infinite cost.
        eaten: A pivot below this share of the diagonal is lost to rounding.
        huge: Times the diagonal: the pivot in its place.
        short: A step that goes less far than this only centres.
        centre: Share of the gap at which it then aims.
        first_gap: The first gap, as a share of the cost.
        rough: From this tolerance on, the first gap is ``rough_gap``.
        rough_gap: What is at a bound at first leaves it sooner, yet the last digits scatter
            more.
        feasible: Of the bounds, which are about 1; rounding alone makes some 1e-8.
        stationary: Of the cost; the gap decides, rounding alone makes up to 1e-2 here.
    """

    steps: int = 80
    back: float = 0.995
    back_cost: float = 0.9
    eaten: float = 1e-14
    huge: float = 1e20
    short: float = 0.2
    centre: float = 0.5
    first_gap: float = 0.1
    rough: float = 3e-3
    rough_gap: float = 0.5
    feasible: float = 1e-6
    stationary: float = 0.03


_STEP = _Stepping()
WIDTH = 4  # consecutive unknowns that a row touches
LEAST_SLACK = 1e-3  # to begin with, where few rows are exceeded and by little


class Rows(NamedTuple):
    """Rows of the problem, each nonzero in ``WIDTH`` consecutive unknowns.

    Attributes:
        first: First unknown of each row, (m,).
        factors: Of its unknowns, (m, 4).
        bounds: What the row times the unknowns may be at most, (m,).
    """

    first: NDArray[np.int64]
    factors: FloatArray
    bounds: FloatArray


class Goal(NamedTuple):
    """The sum to be minimised.

    Attributes:
        first: First unknown of each point, (p,).
        points: Factors of its unknowns, (p, 4).
        offsets: What is added to each product, (p,).
        weights: Of 1 / sqrt of that, (p,).
    """

    first: NDArray[np.int64]
    points: FloatArray
    offsets: FloatArray
    weights: FloatArray


@compiled
def factor(band: FloatArray, diagonal: FloatArray) -> bool:
    """Factor in place into L D L', D in row 0 and L's lower diagonals in the rows after it.

    A pivot that rounding has eaten is made huge, which keeps that unknown where it is for a step.

    Args:
        band: The diagonal and the three below it, (4, n).
        diagonal: A copy of the diagonal, (n,).
    """
    n = diagonal.size
    for i in range(n):
        d = band[0, i]
        if not abs(d) < np.inf:
            return False
        if d <= _STEP.eaten * diagonal[i]:
            d = _STEP.huge * diagonal[i]
            band[0, i] = d
        end = WIDTH if n - i > WIDTH else n - i
        for j in range(1, end):
            ratio = band[j, i] / d
            for k in range(j, end):
                band[k - j, i + j] -= ratio * band[k, i]
        for j in range(1, end):
            band[j, i] /= d
    return True


@inlined
def back_solve(band: FloatArray, y: FloatArray) -> None:
    """Solve in place with the factors of ``factor``."""
    n = y.size
    for i in range(n):
        end = WIDTH if n - i > WIDTH else n - i
        for j in range(1, end):
            y[i + j] -= band[j, i] * y[i]
    for i in range(n - 1, -1, -1):
        value = y[i] / band[0, i]
        end = WIDTH if n - i > WIDTH else n - i
        for j in range(1, end):
            value -= band[j, i] * y[i + j]
        y[i] = value


@compiled
def multiply(first: Any, rows: FloatArray, x: FloatArray, out: FloatArray) -> None:
    """Multiply the rows by ``x``."""
    for r in range(out.size):
        total = 0.0
        for j in range(WIDTH):
            total += rows[r, j] * x[first[r] + j]
        out[r] = total


@inlined
def evaluate_cost(goal: Any, value: FloatArray, gradient: FloatArray, band: FloatArray) -> float:
    """Set gradient and Newton matrix to the derivatives of the cost, and return it."""
    first, points, _offsets, weights = goal
    for i in range(gradient.size):
        gradient[i] = 0.0
        for j in range(WIDTH):
            band[j, i] = 0.0
    cost = 0.0
    for p in range(value.size):
        root = 1.0 / np.sqrt(value[p])
        cost += weights[p] * root
        slope = -0.5 * weights[p] * root * root * root
        curvature = -1.5 * slope * root * root
        for i in range(WIDTH):
            k = first[p] + i
            gradient[k] += slope * points[p, i]
            for j in range(i, WIDTH):
                band[j - i, k] += curvature * points[p, i] * points[p, j]
    return cost


@compiled
def assemble(system: Any, goal: Any, iterate: Any, newton: Any, dual: FloatArray) -> Any:
    """Set gradient and Newton matrix to what cost and constraints make them; find the residuals.

    Args:
        system: As ``Rows``.
        goal: As ``Goal``.
        iterate: Unknowns, cost's points, rows times unknowns, and the state of ``find_direction``.
        newton: Newton matrix, gradient of the cost, step.
        dual: Where to write the gradient of the Lagrangian, (n,).

    Returns:
        Cost, sum of slack times multiplier, size of the dual residual, largest primal residual.
    """
    x, value, gx, state = iterate
    band, gradient, _dx = newton
    cost = evaluate_cost(goal, value, gradient, band)
    for i in range(x.size):
        dual[i] = gradient[i]
    first, rows, bounds = system
    gap = 0.0
    primal = 0.0
    for r in range(bounds.size):
        s = state[1, r]
        z = state[2, r]
        residual = gx[r] + s - bounds[r]
        inverse = 1.0 / s
        state[0, r] = residual
        state[5, r] = inverse
        gap += s * z
        primal = max(primal, abs(residual))
        curvature = z * inverse
        for i in range(WIDTH):
            k = first[r] + i
            dual[k] += z * rows[r, i]
            part = curvature * rows[r, i]
            for j in range(i, WIDTH):
                band[j - i, k] += part * rows[r, j]
    slope = 0.0
    for i in range(x.size):
        slope += abs(dual[i] * x[i])
        if band[0, i] == 0.0:  # no row touches this unknown
            band[0, i] = 1.0
    return cost, gap, slope, primal


@compiled
def find_direction(system: Any, state: FloatArray, newton: Any, target: float, second: bool) -> Any:
    """Solve for one step, of dx and of the slacks and multipliers in ``state``.

    ``state`` holds, a row each: residual of the constraint, slack, multiplier, step of the slack,
    step of the multiplier, 1 / slack. The first step is the predictor; the second corrects it.

    Returns:
        How far the slacks and the multipliers can go until one of them is zero, at most 1, and
        the sum of slack times multiplier there.
    """
    first, rows, bounds = system
    band, gradient, dx = newton
    for i in range(dx.size):
        dx[i] = -gradient[i]
    for r in range(bounds.size):
        pull = state[2, r] * state[0, r] + target
        if second:
            pull -= state[3, r] * state[4, r]
        pull *= state[5, r]
        for j in range(WIDTH):
            dx[first[r] + j] -= pull * rows[r, j]
    back_solve(band, dx)
    go_s = 1.0
    go_z = 1.0
    for r in range(bounds.size):
        s = state[1, r]
        z = state[2, r]
        move = -state[0, r]
        for j in range(WIDTH):
            move -= rows[r, j] * dx[first[r] + j]
        aim = target - z * move
        if second:
            aim -= state[3, r] * state[4, r]
        change = aim * state[5, r] - z
        state[3, r] = move
        state[4, r] = change
        if -move * go_s > s:
            go_s = -s / move
        if -change * go_z > z:
            go_z = -z / change
    ahead = 0.0
    for r in range(bounds.size):
        ahead += (state[1, r] + go_s * state[3, r]) * (state[2, r] + go_z * state[4, r])
    return go_s, go_z, ahead


@compiled
def advance(system: Any, goal: Any, iterate: Any, dx: FloatArray, go: Any) -> None:
    """Step as far as slacks, multipliers and cost stay positive and finite, and evaluate."""
    go_s, go_z = go
    first, points, offsets, weights = goal
    x, value, gx, state = iterate
    for p in range(weights.size):
        move = 0.0
        for j in range(WIDTH):
            move += points[p, j] * dx[first[p] + j]
        if -move * go_s > _STEP.back_cost * value[p]:
            go_s = -_STEP.back_cost * value[p] / move
    for i in range(x.size):
        x[i] += go_s * dx[i]
    for r in range(state.shape[1]):
        state[1, r] += go_s * state[3, r]
        state[2, r] += go_z * state[4, r]
    multiply(first, points, x, value)
    for p in range(weights.size):
        value[p] += offsets[p]
    row_first, rows, _bounds = system
    multiply(row_first, rows, x, gx)


def measure_excess(rows: Rows, x: FloatArray) -> float:
    """Return the largest row over its bound, of the bounds above zero."""
    product = np.empty(rows.bounds.size)
    multiply(rows.first, rows.factors, x, product)
    above = rows.bounds > 0.0
    return float((product[above] / rows.bounds[above]).max(initial=0.0))


def pick_rows(rows: Rows, x: FloatArray, slack: float) -> NDArray[np.bool_]:
    """Tell which rows have less than ``slack`` left at ``x``, (m,)."""
    product = np.empty(rows.bounds.size)
    multiply(rows.first, rows.factors, x, product)
    return np.asarray(rows.bounds - product < slack)


def _begin(rows: Rows, goal: Goal, iterate: Any, least: float, share: float) -> None:
    """Choose slacks, ``least`` or more, and multipliers: the gap is a share of the cost."""
    x, value, gx, state = iterate
    multiply(goal.first, goal.points, x, value)
    value += goal.offsets
    multiply(rows.first, rows.factors, x, gx)
    with np.errstate(divide="ignore", invalid="ignore"):  # then it does not converge
        cost = (goal.weights / np.sqrt(value)).sum()
    np.maximum(rows.bounds - gx, least, out=state[1])
    np.divide(share * cost / gx.size, state[1], out=state[2])


def solve(
    rows: Rows, goal: Goal, x: FloatArray, tolerance: float, least: float = LEAST_SLACK
) -> tuple[int, bool]:
    """Solve in place.

    Args:
        rows: What is to be kept.
        goal: What is to be minimised.
        x: Where to begin, (n,); need not be feasible, but must have a finite cost. The solution.
        tolerance: Of the cost, relative.
        least: Slack to begin with in rows that have less, or are exceeded.

    Returns:
        Number of steps, and whether the tolerance was reached.
    """
    n, m = x.size, rows.bounds.size
    iterate = (x, np.empty(goal.weights.size), np.empty(m), np.zeros((6, m)))
    newton = (np.empty((WIDTH, n)), np.empty(n), np.empty(n))
    share = _STEP.rough_gap if tolerance >= _STEP.rough else _STEP.first_gap
    _begin(rows, goal, iterate, least, share)
    # plain tuples: numba takes longer to tell a named one
    count, converged = take_steps(tuple(rows), tuple(goal), iterate, newton, tolerance)
    return count, bool(converged)


@compiled
def take_steps(system: Any, goal: Any, iterate: Any, newton: Any, tolerance: float) -> Any:
    """Step from what ``_begin`` chose until the tolerance is reached; see ``solve``."""
    state = iterate[3]
    band, _gradient, step = newton
    m = state.shape[1]
    dual = np.empty(step.size)
    diagonal = np.empty(step.size)
    for count in range(_STEP.steps):
        now, gap, slope, primal = assemble(system, goal, iterate, newton, dual)
        if gap <= tolerance * now and slope <= _STEP.stationary * now and primal <= _STEP.feasible:
            return count, True
        diagonal[:] = band[0]
        if not factor(band, diagonal):
            return count, False
        _go_s, _go_z, ahead = find_direction(system, state, newton, 0.0, False)
        target = gap / m * (ahead / gap) ** 3
        go_s, go_z, _ahead = find_direction(system, state, newton, target, True)
        if min(go_s, go_z) < _STEP.short:  # the correction does more harm than good: only centre
            target = _STEP.centre * gap / m
            go_s, go_z, _ahead = find_direction(system, state, newton, target, False)
        go = min(1.0, _STEP.back * go_s), min(1.0, _STEP.back * go_z)
        advance(system, goal, iterate, step, go)
    return _STEP.steps, False
