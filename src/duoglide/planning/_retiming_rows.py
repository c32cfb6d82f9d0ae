"""Rows of the retiming problem: limits and duration as functions of its unknowns.

Legend: theta is the time of the profile that is being improved, alpha = (d theta/dt)^2 and
beta = d2 theta/dt2 = (d alpha/d theta) / 2. In each cell of the grid alpha is the cubic through
alpha and beta of both ends, so that d beta/d theta, and with it the jerk, is about linear there and
may jump from cell to cell: it can be at its limit all along. Limits hold at both ends and in the
middle of each cell.

The unknowns are alpha and ``unit`` times beta of each node in turn: cell k touches 2 k to 2 k + 3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from duoglide.arrays import FloatArray

POINTS = 3  # of a cell
WIDTH = 4  # unknowns that a row touches
_BOOLE = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) / 90.0
_LEAST = 0.02  # of alpha at a node, that its Bernstein coefficient keeps


def _basis(delta: float, unit: float, point: int, out: FloatArray) -> None:
    """Write alpha, beta and d beta/d theta at a point of a cell as rows, (3, 4)."""
    for i in range(3):  # entry by entry, here and below: whole rows take 10 s to compile
        for j in range(WIDTH):
            out[i, j] = 0.0
    h = 1.0 / delta
    w = 1.0 / unit
    if point == 1:
        for j in range(2):
            sign = 1.0 - 2.0 * j
            out[0, 2 * j] = 0.5
            out[0, 2 * j + 1] = 0.25 * sign * delta * w
            out[1, 2 * j] = -0.75 * sign * h
            out[1, 2 * j + 1] = -0.25 * w
            out[2, 2 * j + 1] = -sign * h * w
        return
    out[0, point] = 1.0
    out[1, point + 1] = w
    sign = 1.0 if point == 0 else -1.0
    out[2, 0] = -3.0 * sign * h * h
    out[2, 1] = (-4.0 if point == 0 else 2.0) * h * w
    out[2, 2] = 3.0 * sign * h * h
    out[2, 3] = (-2.0 if point == 0 else 4.0) * h * w


basis_rows = njit(cache=True)(_basis)


def _alpha(delta: float, unit: float, u: float, out: FloatArray) -> None:
    """Write alpha at share ``u`` of a cell as a row, (4,)."""
    v = 1.0 - u
    slope = 2.0 * delta / unit
    out[0] = v * v * (1.0 + 2.0 * u)
    out[1] = slope * u * v * v
    out[2] = u * u * (1.0 + 2.0 * v)
    out[3] = -slope * u * u * v


alpha_row = njit(cache=True)(_alpha)


def _mix(third: float, beta: float, alpha: float, basis: FloatArray, out: FloatArray) -> None:
    """Write a sum of the rows of ``_basis`` with these factors, (4,)."""
    for j in range(WIDTH):
        out[j] = third * basis[2, j] + beta * basis[1, j] + alpha * basis[0, j]


mix = njit(cache=True)(_mix)


def _limit_rows(delta: FloatArray, unit: float, limits: Any, tangent: FloatArray) -> Any:
    """Return the rows (first unknown, four factors, bound) of every limit.

    Args:
        delta: Length of each cell, (n,).
        unit: Factor of beta in the unknowns [s].
        limits: At each point of each cell: alpha is at most 1 / limits[0], (n, 3); factors of beta
            and alpha in each acceleration, which is within +-1, (n, 3, rows, 2); factors of
            d beta/d theta, 3 beta and alpha in each jerk, which times sqrt(alpha) is within +-1,
            (n, 3, rows, 3).
        tangent: alpha at which 1 / sqrt(alpha) is replaced by its tangent, (n, 3).
    """
    speed, acceleration, jerk = limits
    cells = delta.size
    ma = acceleration.shape[2]
    mj = jerk.shape[2]
    count = (2 * cells + 1) * (1 + 2 * ma) + 6 * cells * mj + 4 * cells
    first = np.empty(count, np.int64)
    rows = np.zeros((count, 4))
    bounds = np.ones(count)
    basis = np.empty((3, 4))
    r = 0
    for k in range(cells):
        for end in range(2):  # the cubic's Bernstein coefficients stay positive, and so does alpha
            first[r] = 2 * k
            bounds[r] = 0.0
            weight = 1.0 / tangent[k, 2 * end]
            rows[r, 2 * end] = -(1.0 - _LEAST) * weight
            rows[r, 2 * end + 1] = (2.0 * end - 1.0) * weight * delta[k] / (1.5 * unit)
            r += 1
        for half in range(2):
            first[r] = 2 * k
            alpha_row(delta[k], unit, 0.25 + 0.5 * half, rows[r])
            for j in range(WIDTH):
                rows[r, j] *= 0.5 * (speed[k, half] + speed[k, half + 1])
            r += 1
        for point in range(POINTS):
            basis_rows(delta[k], unit, point, basis)
            if point < 2 or k == cells - 1:
                first[r] = 2 * k
                mix(0.0, 0.0, speed[k, point], basis, rows[r])
                r += 1
                for i in range(ma):
                    for sign in (1.0, -1.0):
                        first[r] = 2 * k
                        q1 = sign * acceleration[k, point, i, 0]
                        q2 = sign * acceleration[k, point, i, 1]
                        mix(0.0, q1, q2, basis, rows[r])
                        r += 1
            root = np.sqrt(tangent[k, point])
            slope = 0.5 / tangent[k, point]
            for i in range(mj):
                for sign in (root, -root):
                    first[r] = 2 * k
                    bounds[r] = 1.5
                    q1 = sign * jerk[k, point, i, 0]
                    q2 = sign * 3.0 * jerk[k, point, i, 1]
                    q3 = sign * jerk[k, point, i, 2] + slope
                    mix(q1, q2, q3, basis, rows[r])
                    r += 1
    return first, rows, bounds


limit_rows = njit(cache=True)(_limit_rows)


def _duration_points(delta: FloatArray, unit: float) -> Any:
    """Return alpha at five points of each cell as rows, and Boole's weights.

    With fewer points an alpha that swings between them would cost nothing.
    """
    count = _BOOLE.size
    first = np.empty(count * delta.size, np.int64)
    points = np.empty((count * delta.size, 4))
    weights = np.empty(count * delta.size)
    for k in range(delta.size):
        for j in range(count):
            p = count * k + j
            first[p] = 2 * k
            alpha_row(delta[k], unit, j / (count - 1.0), points[p])
            weights[p] = delta[k] * _BOOLE[j]
    return first, points, weights


duration_points = njit(cache=True)(_duration_points)


def _replace(first: Any, rows: FloatArray, unknown: int, by: int, value: float) -> FloatArray:
    """Take an unknown out of rows, in place: it is another one (``by``), or a value (by = -1).

    Every row that touches the unknown touches the other one too.

    Returns:
        What is to be added to each row's product, (m,).
    """
    offset = np.zeros(first.size)
    for r in range(first.size):
        j = unknown - first[r]
        if 0 <= j < 4:
            if by < 0:
                offset[r] = rows[r, j] * value
            else:
                rows[r, by - first[r]] += rows[r, j]
            rows[r, j] = 0.0
    return offset


replace_unknown = njit(cache=True)(_replace)
