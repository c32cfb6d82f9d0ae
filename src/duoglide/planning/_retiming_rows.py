"""Rows of the retiming problem: limits and duration as functions of its unknowns.

Legend: theta is the time of the profile that is being improved, alpha = (d theta/dt)^2 and
beta = d2 theta/dt2 = (d alpha/d theta) / 2. In each cell of the grid alpha is the cubic through
alpha and beta of both ends, so that d beta/d theta, and with it the jerk, is about linear there and
may jump from cell to cell: it can be at its limit all along. Limits hold at both ends and in the
middle of each cell.

The unknowns are alpha and ``unit`` times beta of each node in turn: cell k touches 2 k to 2 k + 3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray

POINTS = 3  # of a cell
WIDTH = 4  # unknowns that a row touches
_BOOLE = np.array([7.0, 32.0, 12.0, 32.0, 7.0]) / 90.0
_HALVES = np.array([0.25, 0.75])
_BINOMIAL = np.array([1.0, 3.0, 1.0])
_LEAST = 0.02  # of alpha at a node, that its Bernstein coefficient keeps


def _cells(delta: FloatArray, unit: float) -> FloatArray:
    """Return alpha, beta and d beta/d theta at the points of each cell as rows, (n, 3, 3, 4)."""
    rows = np.zeros((3, 3, WIDTH, delta.size))  # point, derivative, unknown, cell
    h, w = 1.0 / delta, 1.0 / unit
    for point, sign in ((0, 1.0), (2, -1.0)):
        rows[point, 0, point] = 1.0
        rows[point, 1, point + 1] = w
        rows[point, 2, 0] = -3.0 * sign * h * h
        rows[point, 2, 1] = (-4.0 if point == 0 else 2.0) * h * w
        rows[point, 2, 2] = 3.0 * sign * h * h
        rows[point, 2, 3] = (-2.0 if point == 0 else 4.0) * h * w
    for j, sign in ((0, 1.0), (2, -1.0)):
        rows[1, 0, j] = 0.5
        rows[1, 0, j + 1] = 0.25 * sign * delta * w
        rows[1, 1, j] = -0.75 * sign * h
        rows[1, 1, j + 1] = -0.25 * w
        rows[1, 2, j + 1] = -sign * h * w
    return np.ascontiguousarray(rows.transpose(3, 0, 1, 2))


def _alpha(delta: FloatArray, unit: float, u: FloatArray) -> FloatArray:
    """Return alpha at shares ``u`` of each cell as rows, (n, shares, 4)."""
    v = 1.0 - u
    slope = 2.0 * delta[:, None] / unit
    rows = np.empty((delta.size, u.size, WIDTH))
    rows[..., 0] = v * v * (1.0 + 2.0 * u)
    rows[..., 1] = slope * (u * v * v)
    rows[..., 2] = u * u * (1.0 + 2.0 * v)
    rows[..., 3] = -slope * (u * u * v)
    return rows


def limit_rows(
    delta: FloatArray, unit: float, limits: tuple[FloatArray, ...], tangent: FloatArray
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
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
    at = _cells(delta, unit)
    node = _node_rows(at, speed, acceleration)
    with np.errstate(divide="ignore", invalid="ignore"):  # no tangent: the solver will not converge
        positive = _positive(delta, unit, tangent)
        jerks = _jerk_rows(at, jerk, tangent)
    halves = 0.5 * (speed[:, :2] + speed[:, 1:])[..., None] * _alpha(delta, unit, _HALVES)
    each = np.concatenate([positive, halves, node[:, :2].reshape(cells, -1, WIDTH), jerks], axis=1)
    bounds = np.ones(each.shape[:2])
    bounds[:, :2] = 0.0
    bounds[:, -len(jerks[0]) :] = 1.5
    last = node[-1, 2]  # elsewhere this is the next cell's first point
    rows = np.concatenate([each.reshape(-1, WIDTH), last])
    first = np.full(len(rows), 2 * (cells - 1))
    first[: bounds.size] = np.repeat(2 * np.arange(cells), len(bounds[0]))
    return first, rows, np.append(bounds, np.ones(len(last)))


def _positive(delta: FloatArray, unit: float, tangent: FloatArray) -> FloatArray:
    """Return rows that keep the cubic's Bernstein coefficients above 0, (n, 2, 4)."""
    rows = np.zeros((delta.size, 2, WIDTH))
    for end in range(2):
        weight = 1.0 / tangent[:, 2 * end]
        rows[:, end, 2 * end] = -(1.0 - _LEAST) * weight
        rows[:, end, 2 * end + 1] = (2.0 * end - 1.0) * weight * delta / (1.5 * unit)
    return rows


def _node_rows(at: FloatArray, speed: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Return the limits of speed and acceleration at each point, (n, 3, rows, 4)."""
    within = acceleration @ at[:, :, 1::-1]
    return np.concatenate([speed[..., None, None] * at[:, :, :1], within, -within], axis=2)


def _jerk_rows(at: FloatArray, jerk: FloatArray, tangent: FloatArray) -> FloatArray:
    """Return the limits of jerk in each cell, (n, rows, 4)."""
    root = np.sqrt(tangent)[..., None, None]
    slope = (0.5 / tangent)[..., None, None] * at[:, :, :1]
    within = (root * jerk * _BINOMIAL) @ at[:, :, ::-1]
    return np.concatenate([slope + within, slope - within], axis=2).reshape(len(at), -1, WIDTH)


def duration_points(
    delta: FloatArray, unit: float
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return alpha at five points of each cell as rows (first unknown, factors), Boole's weights.

    With fewer points an alpha that swings between them would cost nothing.
    """
    count = _BOOLE.size
    points = _alpha(delta, unit, np.linspace(0.0, 1.0, count)).reshape(-1, WIDTH)
    first = np.repeat(2 * np.arange(delta.size), count)
    return first, points, (delta[:, None] * _BOOLE).ravel()


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
    low, high = (choose(unknown for unknown, _, _ in ties) for choose in (min, max))
    reach = 2 * WIDTH  # of an end of the grid
    near = np.flatnonzero((first <= low + reach) | (first >= high - reach))
    for unknown, by, value in ties:
        touched = near[(first[near] > unknown - WIDTH) & (first[near] <= unknown)]
        j = unknown - first[touched]
        if by < 0:
            offset[touched] += rows[touched, j] * value
        else:
            rows[touched, by - first[touched]] += rows[touched, j]
        rows[touched, j] = 0.0
    return offset
