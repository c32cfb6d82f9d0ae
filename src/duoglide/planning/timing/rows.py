"""Rows of the retiming problem: limits and duration as functions of its unknowns.

Legend: theta is the time of the profile that is being improved, alpha = (d theta/dt)^2 and
beta = d2 theta/dt2 = (d alpha/d theta) / 2. In each cell of the grid alpha is the cubic through
alpha and beta of both ends, so that d beta/d theta, and with it the jerk, is about linear there and
may jump from cell to cell: it can be at its limit all along. Limits hold at both ends and in the
middle of each cell.

The unknowns are alpha and ``unit`` times beta of each node in turn: cell k touches 2 k to 2 k + 3.

The rows are filled in compiled loops: numpy would spend its time on being called.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray
from duoglide.kinematics.compiled import compiled, inlined
from duoglide.planning.timing.interior_point import WIDTH, Goal, Rows

POINTS = 3  # Limits are kept at so many points of each cell.
_BOOLE = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) / 90.0
_LEAST = 0.02  # of alpha at a node, that its Bernstein coefficient keeps


def make_limit_rows(
    delta: FloatArray, unit: float, limits: tuple[FloatArray, ...], tangent: FloatArray
) -> Rows:
    """Return the rows of every limit.

    Args:
        delta: Length of each cell, (n,).
        unit: Factor of beta in the unknowns [s].
        limits: At each point of each cell: alpha is at most 1 / limits[0], (n, 3); factors of beta
            and alpha in each acceleration, which is within +-1, (n, 3, rows, 2); factors of
            d beta/d theta, 3 beta and alpha in each jerk, which times sqrt(alpha) is within +-1,
            (n, 3, rows, 3); factors of beta, alpha and sqrt(alpha) in each force along one
            direction, which is at most 1, (n, 3, rows, 3).
        tangent: alpha at which 1 / sqrt(alpha) and sqrt(alpha) are replaced by their tangents,
            (n, 3).
    """
    _speed, acceleration, jerk, force = limits
    nodes = 1 + 2 * acceleration.shape[2] + force.shape[2]
    count = delta.size * (4 + 2 * nodes + 2 * POINTS * jerk.shape[2]) + nodes
    rows = Rows(np.empty(count, dtype=np.int64), np.empty((count, WIDTH)), np.empty(count))
    fill_limits((delta, unit), limits, tangent, np.zeros((POINTS, 3, WIDTH)), tuple(rows))
    return rows


def make_duration_points(delta: FloatArray, unit: float) -> Goal:
    """Return the duration: alpha at five points of each cell, with Boole's weights.

    With fewer points an alpha that swings between them would cost nothing.
    """
    count = delta.size * _BOOLE.size
    first, points, weights = np.empty(count, np.int64), np.empty((count, WIDTH)), np.empty(count)
    fill_points(delta, unit, _BOOLE, (first, points, weights))
    return Goal(first, points, np.zeros(count), weights)


def replace_unknowns(
    first: NDArray[np.int64], rows: FloatArray, ties: list[tuple[int, int, float]]
) -> FloatArray:
    """Take unknowns out of rows, in place: each is another one (``by``), or a value (by = -1).

    Every row that touches an unknown touches the other one too.

    Args:
        first: First unknown of each row, (m,).
        rows: Four factors of each, (m, 4).
        ties: Unknown, by, value.

    Returns:
        What is to be added to each row's product, (m,).
    """
    offset = np.zeros(first.size)
    for tie in ties:
        replace_unknown(first, rows, tie, offset)
    return offset


@compiled
def replace_unknown(first: Any, rows: FloatArray, tie: Any, offset: FloatArray) -> None:
    """Take one unknown out of the rows that touch it."""
    unknown, by, value = tie
    for r in range(first.size):
        j = unknown - first[r]
        if 0 <= j < WIDTH:
            if by < 0:
                offset[r] += rows[r, j] * value
            else:
                rows[r, by - first[r]] += rows[r, j]
            rows[r, j] = 0.0


@inlined
def write_alpha(u: float, slope: float, factor: float, row: FloatArray) -> None:
    """Write ``factor`` times alpha at the share ``u`` of a cell; ``slope`` is 2 delta / unit."""
    v = 1.0 - u
    row[0] = factor * (v * v * (1.0 + 2.0 * u))
    row[1] = factor * (slope * (u * v * v))
    row[2] = factor * (u * u * (1.0 + 2.0 * v))
    row[3] = -factor * (slope * (u * u * v))


@compiled
def fill_points(delta: FloatArray, unit: float, boole: FloatArray, out: Any) -> None:
    """Fill the rows of ``make_duration_points``."""
    first, points, weights = out
    count = boole.size
    for k in range(delta.size):
        for p in range(count):
            r = k * count + p
            first[r] = 2 * k
            weights[r] = delta[k] * boole[p]
            write_alpha(p / (count - 1.0), 2.0 * delta[k] / unit, 1.0, points[r])


@inlined
def write_cell(delta: float, unit: float, at: FloatArray) -> None:
    """Write alpha, beta and d beta/d theta at the points of a cell as rows, (3, 3, 4).

    What is zero in every cell is zero already.
    """
    h = 1.0 / delta
    w = 1.0 / unit
    for point in range(0, POINTS, 2):
        sign = 1.0 - point
        at[point, 0, point] = 1.0
        at[point, 1, point + 1] = w
        at[point, 2, 0] = -3.0 * sign * h * h
        at[point, 2, 1] = -(1.0 + 3.0 * sign) * h * w
        at[point, 2, 2] = 3.0 * sign * h * h
        at[point, 2, 3] = (1.0 - 3.0 * sign) * h * w
        at[1, 0, point] = 0.5
        at[1, 0, point + 1] = 0.25 * sign * delta * w
        at[1, 1, point] = -0.75 * sign * h
        at[1, 1, point + 1] = -0.25 * w
        at[1, 2, point + 1] = -sign * h * w


@inlined
def write_pair(at: Any, factors: Any, slack: float, rows: FloatArray, r: int) -> None:
    """Keep a sum of alpha, beta and d beta/d theta within 1, or 1.5 less ``slack`` times alpha."""
    by_alpha, by_beta, by_rate = factors
    for j in range(WIDTH):
        within = by_alpha * at[0, j] + by_beta * at[1, j] + by_rate * at[2, j]
        rows[r, j] = slack * at[0, j] + within
        rows[r + 1, j] = slack * at[0, j] - within


@compiled
def fill_limits(cells: Any, limits: Any, tangent: FloatArray, at: FloatArray, out: Any) -> None:
    """Fill the rows of ``make_limit_rows``.

    Args:
        cells: Length of each, and the factor of beta in the unknowns.
        limits: See ``make_limit_rows``.
        tangent: See there.
        at: Zeros, (3, 3, 4): room for the rows of alpha, beta and d beta/d theta of one cell.
        out: The rows.
    """
    delta, unit = cells
    speed, acceleration, jerk, force = limits
    first, rows, bounds = out
    r = 0
    for k in range(delta.size):
        write_cell(delta[k], unit, at)
        begin = r
        for end in range(2):  # the cubic's Bernstein coefficients stay above 0
            weight = 1.0 / tangent[k, 2 * end]
            for j in range(WIDTH):
                rows[r, j] = 0.0
            rows[r, 2 * end] = -(1.0 - _LEAST) * weight
            rows[r, 2 * end + 1] = (2.0 * end - 1.0) * weight * delta[k] / (1.5 * unit)
            bounds[r] = 0.0
            pace = 0.5 * (speed[k, end] + speed[k, end + 1])
            write_alpha(0.25 + 0.5 * end, 2.0 * delta[k] / unit, pace, rows[r + 1])
            bounds[r + 1] = 1.0
            r += 2
        for p in range(POINTS):
            root = sqrt(tangent[k, p])
            if p < 2 or k == delta.size - 1:  # elsewhere this is the next cell's first point
                pace = speed[k, p]
                if p == 0 and k > 0:  # a cap may end here: the node belongs to both cells
                    pace = max(pace, speed[k - 1, POINTS - 1])
                for j in range(WIDTH):
                    rows[r, j] = pace * at[p, 0, j]
                bounds[r] = 1.0
                r += 1
                for i in range(acceleration.shape[2]):
                    factors = acceleration[k, p, i, 1], acceleration[k, p, i, 0], 0.0
                    write_pair(at[p], factors, 0.0, rows, r)
                    bounds[r] = 1.0
                    bounds[r + 1] = 1.0
                    r += 2
                for i in range(force.shape[2]):
                    slowed = 0.5 * force[k, p, i, 2]  # sqrt(alpha) at most (root + alpha / root)/2
                    by_alpha = force[k, p, i, 1] + slowed / root
                    for j in range(WIDTH):
                        rows[r, j] = by_alpha * at[p, 0, j] + force[k, p, i, 0] * at[p, 1, j]
                    bounds[r] = 1.0 - slowed * root
                    r += 1
            for i in range(jerk.shape[2]):
                third = root * jerk[k, p, i, 0]
                factors = root * jerk[k, p, i, 2], 3.0 * root * jerk[k, p, i, 1], third
                write_pair(at[p], factors, 0.5 / tangent[k, p], rows, r)
                bounds[r] = 1.5
                bounds[r + 1] = 1.5
                r += 2
        for row in range(begin, r):
            first[row] = 2 * k
