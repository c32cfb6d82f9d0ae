"""A primal-dual interior-point method for the retiming problem, whose rows touch few unknowns.

Minimise   sum_p weight_p / sqrt(point_p . x + offset_p)   subject to   row_r . x <= bound_r

where ``point_p`` and ``row_r`` are nonzero in four consecutive unknowns only. Each step then solves
a symmetric system with seven diagonals, so that a step costs O(n). Predictor and corrector after
Mehrotra (1992), with the true second derivatives of the objective. Everything is scaled to about 1.

An unknown that no row touches stays as it is.

Loops, not whole arrays: those take numba ten seconds longer to compile, once per machine.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from duoglide.arrays import FloatArray

MAX_STEPS = 80
WIDTH = 4  # consecutive unknowns that a row touches
_BACK = 0.995  # how far to go toward the nearest bound
_LEAST_SLACK = 1e-3
_EATEN = 1e-14  # of the diagonal
_HUGE = 1e20
_SHORT = 0.2  # a step that goes less far than this
_CENTRE = 0.5  # of the gap, to aim at then
_FIRST_GAP = 0.1  # of the cost
_BACK_COST = 0.9  # how far to go toward an infinite cost
_FEASIBLE = 1e-6  # of the bounds, which are about 1; rounding alone makes some 1e-8
_STATIONARY = 0.03  # of the cost; the gap decides, rounding alone makes up to 1e-2 here


def _factor(band: FloatArray) -> bool:
    """Factor in place into L D L', D in row 0 and L's lower diagonals in the rows after it.

    A pivot that rounding has eaten is made huge, which keeps that unknown where it is for a step.
    """
    width, n = band.shape
    diagonal = band[0].copy()
    for i in range(n):
        d = band[0, i]
        if not np.isfinite(d):
            return False
        if d <= _EATEN * diagonal[i]:
            d = _HUGE * diagonal[i]
            band[0, i] = d
        for j in range(1, min(width, n - i)):
            ratio = band[j, i] / d
            for k in range(j, min(width, n - i)):
                band[k - j, i + j] -= ratio * band[k, i]
        for j in range(1, min(width, n - i)):
            band[j, i] /= d
    return True


def _back_solve(band: FloatArray, y: FloatArray) -> None:
    """Solve in place with the factors of ``_factor``."""
    width, n = band.shape
    for i in range(n):
        for j in range(1, min(width, n - i)):
            y[i + j] -= band[j, i] * y[i]
    for i in range(n - 1, -1, -1):
        value = y[i] / band[0, i]
        for j in range(1, min(width, n - i)):
            value -= band[j, i] * y[i + j]
        y[i] = value


def _times(first: Any, rows: FloatArray, x: FloatArray, out: FloatArray) -> None:
    """Multiply the rows by ``x``."""
    for r in range(rows.shape[0]):
        total = 0.0
        for j in range(WIDTH):
            total += rows[r, j] * x[first[r] + j]
        out[r] = total


def _add_square(band: FloatArray, k: int, g: FloatArray, w: float) -> None:
    """Add w g g' for one row ``g`` that begins at unknown ``k``."""
    for i in range(WIDTH):
        part = w * g[i]
        for j in range(i, WIDTH):
            band[j - i, k + i] += part * g[j]


def _add(y: FloatArray, k: int, g: FloatArray, w: float) -> None:
    """Add w g for one row ``g`` that begins at unknown ``k``."""
    for i in range(WIDTH):
        y[k + i] += w * g[i]


factor = njit(cache=True)(_factor)
back_solve = njit(cache=True)(_back_solve)
times = njit(cache=True)(_times)
add_square = njit(cache=True)(_add_square)
add = njit(cache=True)(_add)


def _assembled(system: Any, goal: Any, iterate: Any, newton: Any) -> Any:
    """Fill in the Newton matrix and the gradients at the iterate.

    Returns:
        Cost, sum of slack times multiplier, size of the dual residual, largest primal residual.
    """
    first, rows, bounds = system
    point_first, points, _offsets, weights = goal
    x, value, gx, state = iterate
    band, gradient, _dx = newton
    band[:] = 0.0
    gradient[:] = 0.0
    now = 0.0
    for p in range(weights.size):
        root = 1.0 / np.sqrt(value[p])
        cube = weights[p] * root * root * root
        now += weights[p] * root
        add(gradient, point_first[p], points[p], -0.5 * cube)
        add_square(band, point_first[p], points[p], 0.75 * cube * root * root)
    dual = gradient.copy()
    gap = 0.0
    primal = 0.0
    for r in range(bounds.size):
        state[0, r] = gx[r] + state[1, r] - bounds[r]
        add(dual, first[r], rows[r], state[2, r])
        add_square(band, first[r], rows[r], state[2, r] / state[1, r])
        gap += state[1, r] * state[2, r]
        primal = max(primal, abs(state[0, r]))
    slope = 0.0
    for i in range(x.size):
        slope += abs(dual[i] * x[i])
        if band[0, i] == 0.0:  # no row touches this unknown
            band[0, i] = 1.0
    return now, gap, slope, primal


assembled = njit(cache=True)(_assembled)


def _direction(system: Any, state: FloatArray, newton: Any, target: float, second: bool) -> Any:
    """Solve for one step, of dx and of the slacks and multipliers in ``state``.

    ``state`` holds, a row each: residual of the constraint, slack, multiplier, step of the slack,
    step of the multiplier. The first step is the predictor; the second one corrects it.

    Returns:
        How far the slacks and the multipliers can go until one of them is zero, at most 1.
    """
    first, rows, _bounds = system
    band, gradient, dx = newton
    residual, s, z, ds, dz = state
    for i in range(dx.size):
        dx[i] = -gradient[i]
    for r in range(s.size):
        pull = z[r] * residual[r]
        pull += target
        if second:
            pull -= ds[r] * dz[r]
        add(dx, first[r], rows[r], -pull / s[r])
    back_solve(band, dx)
    go_s = 1.0
    go_z = 1.0
    for r in range(s.size):
        move = -residual[r]
        for j in range(WIDTH):
            move -= rows[r, j] * dx[first[r] + j]
        change = target / s[r] - z[r] * (1.0 + move / s[r])
        if second:
            change -= ds[r] * dz[r] / s[r]
        ds[r] = move
        dz[r] = change
        if move < 0.0:
            go_s = min(go_s, -s[r] / move)
        if change < 0.0:
            go_z = min(go_z, -z[r] / change)
    return go_s, go_z


direction = njit(cache=True)(_direction)


def _advance(goal: Any, iterate: Any, dx: FloatArray, go_s: float, go_z: float) -> None:
    """Step as far as slacks, multipliers and cost stay positive and finite."""
    point_first, points, _offsets, weights = goal
    x, value, _gx, state = iterate
    go_s = min(1.0, _BACK * go_s)
    go_z = min(1.0, _BACK * go_z)
    move = np.empty(weights.size)
    times(point_first, points, dx, move)
    for p in range(weights.size):
        if move[p] < 0.0:
            go_s = min(go_s, -_BACK_COST * value[p] / move[p])
    for i in range(x.size):
        x[i] += go_s * dx[i]
    for r in range(state.shape[1]):
        state[1, r] += go_s * state[3, r]
        state[2, r] += go_z * state[4, r]


advance = njit(cache=True)(_advance)


def _evaluate(system: Any, goal: Any, iterate: Any) -> None:
    """Multiply rows and points by the unknowns."""
    x, value, gx, _state = iterate
    times(goal[0], goal[1], x, value)
    for p in range(value.size):
        value[p] += goal[2][p]
    times(system[0], system[1], x, gx)


evaluate = njit(cache=True)(_evaluate)


def _excess(system: Any, x: FloatArray) -> float:
    """Return the largest row over its bound, of the bounds above zero."""
    first, rows, bounds = system
    product = np.empty(bounds.size)
    times(first, rows, x, product)
    largest = 0.0
    for r in range(bounds.size):
        if bounds[r] > 0.0:
            largest = max(largest, product[r] / bounds[r])
    return largest


excess = njit(cache=True)(_excess)


def _solve(system: Any, goal: Any, x: FloatArray, tolerance: float) -> Any:
    """Solve in place.

    Args:
        system: First unknown of each row (m,), the rows (m, 4), their bounds (m,).
        goal: First unknown of each point (p,), the points (p, 4), offsets (p,), weights (p,).
        x: Where to begin, (n,); need not be feasible, but must have a finite cost. The solution.
        tolerance: Of the cost, relative.

    Returns:
        Number of steps, and whether the tolerance was reached.
    """
    n = x.size
    m = system[2].size
    value = np.empty(goal[3].size)
    gx = np.empty(m)
    state = np.zeros((5, m))
    iterate = (x, value, gx, state)
    newton = (np.empty((WIDTH, n)), np.empty(n), np.empty(n))
    evaluate(system, goal, iterate)
    cost = 0.0
    for p in range(value.size):
        cost += goal[3][p] / np.sqrt(value[p])
    for r in range(m):
        state[1, r] = max(system[2][r] - gx[r], _LEAST_SLACK)
        state[2, r] = _FIRST_GAP * cost / m / state[1, r]
    for step in range(MAX_STEPS):
        now, gap, slope, primal = assembled(system, goal, iterate, newton)
        if gap <= tolerance * now and slope <= _STATIONARY * now and primal <= _FEASIBLE:
            return step, True
        if not factor(newton[0]):
            return step, False
        go_s, go_z = direction(system, state, newton, 0.0, False)
        ahead = 0.0
        for r in range(m):
            ahead += (state[1, r] + go_s * state[3, r]) * (state[2, r] + go_z * state[4, r])
        target = gap / m * (ahead / gap) ** 3
        go_s, go_z = direction(system, state, newton, target, True)
        if min(go_s, go_z) < _SHORT:  # the correction does more harm than good: only centre
            go_s, go_z = direction(system, state, newton, _CENTRE * gap / m, False)
        advance(goal, iterate, newton[2], go_s, go_z)
        evaluate(system, goal, iterate)
    return MAX_STEPS, False


solve = njit(cache=True)(_solve)
