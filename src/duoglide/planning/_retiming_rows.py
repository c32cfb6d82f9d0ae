"""Rows of the retiming problem: limits and duration as functions of its unknowns.

Legend: theta is the time of the profile that is being improved, alpha = (d theta/dt)^2 and
beta = d2 theta/dt2, alpha quadratic in each cell of the grid and continuously differentiable, so
beta = (d alpha/d theta) / 2 is continuous and linear. The coefficients of alpha in quadratic
B-splines are the unknowns: cell k touches coefficients k, k + 1, k + 2 alone. Where the motion
starts or ends at rest, the first or last three are one unknown: alpha is constant in that cell.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from duoglide.arrays import FloatArray

REST = 2  # unknowns that a rest takes away


def _node(delta: FloatArray, k: int, basis: FloatArray) -> None:
    """Write alpha and beta of node ``k`` over coefficients k, k + 1 into ``basis`` (2, 2)."""
    before = delta[k - 1] if k > 0 else 0.0
    after = delta[k] if k < delta.size else 0.0
    span = before + after
    basis[0, 0] = after / span
    basis[0, 1] = before / span
    basis[1, 0] = -1.0 / span
    basis[1, 1] = 1.0 / span


node = njit(cache=True)(_node)


def _limit_rows(
    delta: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
    jerk: FloatArray,
    tangent: FloatArray,
) -> Any:
    """Return the rows (first coefficient, three factors, bound) of every limit.

    Args:
        delta: Length of each cell, (n,).
        speed: alpha is at most 1 / speed at each node, (n + 1,).
        acceleration: Factors of beta and alpha at each node, (n + 1, rows, 2).
        jerk: Factors of d beta/d theta, 3 beta and alpha at both ends of each cell; their sum
            times sqrt(alpha) is within +-1, (n, 2, rows, 3).
        tangent: alpha at which 1 / sqrt(alpha) is replaced by its tangent, (n + 1,).
    """
    cells = delta.size
    count = (cells + 1) * (1 + 2 * acceleration.shape[1]) + cells * 4 * jerk.shape[2]
    first = np.empty(count, np.int64)
    rows = np.zeros((count, 3))
    bounds = np.ones(count)
    left = np.empty((2, 2))
    right = np.empty((2, 2))
    r = 0
    for k in range(cells + 1):
        node(delta, k, left)
        shift = 1 if k == cells else 0
        first[r] = k - shift
        rows[r, shift] = speed[k] * left[0, 0]
        rows[r, shift + 1] = speed[k] * left[0, 1]
        r += 1
        for i in range(acceleration.shape[1]):
            q1 = acceleration[k, i, 0]
            q2 = acceleration[k, i, 1]
            for sign in (1.0, -1.0):
                first[r] = k - shift
                for j in range(2):
                    rows[r, shift + j] = sign * (q1 * left[1, j] + q2 * left[0, j])
                r += 1
    alpha = np.zeros((2, 3))
    beta = np.zeros((2, 3))
    third = np.zeros(3)
    for k in range(cells):
        node(delta, k, left)
        node(delta, k + 1, right)
        for j in range(2):
            alpha[0, j], alpha[1, j + 1] = left[0, j], right[0, j]
            beta[0, j], beta[1, j + 1] = left[1, j], right[1, j]
        for j in range(3):
            third[j] = (beta[1, j] - beta[0, j]) / delta[k]
        for end in range(2):
            root = np.sqrt(tangent[k + end])
            slope = 0.5 / tangent[k + end]
            for i in range(jerk.shape[2]):
                q1 = jerk[k, end, i, 0] * root
                q2 = 3.0 * jerk[k, end, i, 1] * root
                q3 = jerk[k, end, i, 2] * root
                for sign in (1.0, -1.0):
                    first[r] = k
                    bounds[r] = 1.5
                    for j in range(3):
                        sum_ = q1 * third[j] + q2 * beta[end, j] + q3 * alpha[end, j]
                        rows[r, j] = sign * sum_ + slope * alpha[end, j]
                    r += 1
    return first, rows, bounds


limit_rows = njit(cache=True)(_limit_rows)


def _duration_points(delta: FloatArray) -> Any:
    """Return alpha at both ends and the middle of each cell as rows, and Simpson's weights."""
    cells = delta.size
    first = np.empty(3 * cells, np.int64)
    points = np.zeros((3 * cells, 3))
    weights = np.empty(3 * cells)
    left = np.empty((2, 2))
    right = np.empty((2, 2))
    for k in range(cells):
        node(delta, k, left)
        node(delta, k + 1, right)
        p = 3 * k
        for j in range(3):
            first[p + j] = k
            weights[p + j] = delta[k] * (4.0 if j == 1 else 1.0) / 6.0
        for j in range(2):
            points[p, j] = left[0, j]
            points[p + 2, j + 1] = right[0, j]
            # alpha of the middle: mean of both ends less delta/4 of the change of beta
            points[p + 1, j] += 0.5 * left[0, j] + 0.25 * delta[k] * left[1, j]
            points[p + 1, j + 1] += 0.5 * right[0, j] - 0.25 * delta[k] * right[1, j]
    return first, points, weights


duration_points = njit(cache=True)(_duration_points)


def _tie(first: Any, rows: FloatArray, count: int, low: int, high: int) -> None:
    """Rewrite rows in place: the first ``low`` + 1 of ``count`` coefficients are one unknown.

    Likewise the last ``high`` + 1.
    """
    top = count - 1 - low - high
    sums = np.empty(3)
    for r in range(first.size):
        k = first[r]
        base = min(max(k - low, 0), top - 2)
        sums[:] = 0.0
        for j in range(3):
            sums[min(max(k + j - low, 0), top) - base] += rows[r, j]
        first[r] = base
        rows[r] = sums


tie = njit(cache=True)(_tie)


def _nodes_of(delta: FloatArray, coefficients: FloatArray) -> Any:
    """Return alpha and beta at every node."""
    count = delta.size + 1
    alpha = np.empty(count)
    beta = np.empty(count)
    basis = np.empty((2, 2))
    for k in range(count):
        node(delta, k, basis)
        alpha[k] = basis[0, 0] * coefficients[k] + basis[0, 1] * coefficients[k + 1]
        beta[k] = basis[1, 0] * coefficients[k] + basis[1, 1] * coefficients[k + 1]
    return alpha, beta


nodes_of = njit(cache=True)(_nodes_of)
