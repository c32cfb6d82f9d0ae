"""A primal-dual interior-point method for the retiming problem, whose rows touch three unknowns.

Minimise   sum_p weight_p / sqrt(point_p . x)   subject to   row_r . x <= bound_r

where ``point_p`` and ``row_r`` are nonzero in three consecutive unknowns only. Each step then solves
a symmetric system with five diagonals, so that a step costs O(n). Predictor and corrector after
Mehrotra (1992), with the true second derivatives of the objective.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from duoglide.arrays import FloatArray

MAX_STEPS = 60
_BACK = 0.995  # how far to go toward the nearest bound


def _factor(band: FloatArray) -> bool:
    """Factor in place into L D L', with L's two lower diagonals in rows 1 and 2."""
    n = band.shape[1]
    for i in range(n):
        d = band[0, i]
        if not d > 0.0:
            return False
        l1 = band[1, i] / d
        l2 = band[2, i] / d
        if i + 1 < n:
            band[0, i + 1] -= l1 * band[1, i]
            band[1, i + 1] -= l1 * band[2, i]
        if i + 2 < n:
            band[0, i + 2] -= l2 * band[2, i]
        band[1, i] = l1
        band[2, i] = l2
    return True


def _back_solve(band: FloatArray, y: FloatArray) -> None:
    """Solve in place with the factors of ``_factor``."""
    n = y.size
    for i in range(n):
        if i + 1 < n:
            y[i + 1] -= band[1, i] * y[i]
        if i + 2 < n:
            y[i + 2] -= band[2, i] * y[i]
    for i in range(n - 1, -1, -1):
        value = y[i] / band[0, i]
        if i + 1 < n:
            value -= band[1, i] * y[i + 1]
        if i + 2 < n:
            value -= band[2, i] * y[i + 2]
        y[i] = value


def _times(first: FloatArray, rows: FloatArray, x: FloatArray, out: FloatArray) -> None:
    for r in range(rows.shape[0]):
        k = first[r]
        out[r] = rows[r, 0] * x[k] + rows[r, 1] * x[k + 1] + rows[r, 2] * x[k + 2]


def _add_square(band: FloatArray, k: int, g: FloatArray, w: float) -> None:
    """Add w g g' for one row that begins at unknown ``k``."""
    band[0, k] += w * g[0] * g[0]
    band[1, k] += w * g[0] * g[1]
    band[2, k] += w * g[0] * g[2]
    band[0, k + 1] += w * g[1] * g[1]
    band[1, k + 1] += w * g[1] * g[2]
    band[0, k + 2] += w * g[2] * g[2]


def _add(y: FloatArray, k: int, g: FloatArray, w: float) -> None:
    y[k] += w * g[0]
    y[k + 1] += w * g[1]
    y[k + 2] += w * g[2]


factor = njit(cache=True)(_factor)
back_solve = njit(cache=True)(_back_solve)
times = njit(cache=True)(_times)
add_square = njit(cache=True)(_add_square)
add = njit(cache=True)(_add)


def _solve(first, rows, bounds, point_first, points, weights, x, fixed, tolerance):  # type: ignore[no-untyped-def]
    n = x.size
    m = bounds.size
    p = weights.size
    value = np.empty(p)
    gx = np.empty(m)
    s = np.empty(m)
    z = np.empty(m)
    ds = np.empty(m)
    dz = np.empty(m)
    gd = np.empty(m)
    band = np.empty((3, n))
    gradient = np.empty(n)
    residual = np.empty(n)
    dx = np.empty(n)
    times(point_first, points, x, value)
    cost = 0.0
    for i in range(p):
        cost += weights[i] / np.sqrt(value[i])
    times(first, rows, x, gx)
    for r in range(m):
        s[r] = max(bounds[r] - gx[r], 1e-3 * abs(bounds[r]))
        z[r] = 0.1 * cost / m / s[r]
    for step in range(MAX_STEPS):
        band[:] = 0.0
        gradient[:] = 0.0
        cost = 0.0
        for i in range(p):
            root = 1.0 / np.sqrt(value[i])
            w = weights[i]
            cost += w * root
            cube = root * root * root
            add(gradient, point_first[i], points[i], -0.5 * w * cube)
            add_square(band, point_first[i], points[i], 0.75 * w * cube * root * root)
        residual[:] = gradient
        mu = 0.0
        primal = 0.0
        for r in range(m):
            add(residual, first[r], rows[r], z[r])
            add_square(band, first[r], rows[r], z[r] / s[r])
            mu += z[r] * s[r]
            primal = max(primal, gx[r] + s[r] - bounds[r])
        dual = 0.0
        for i in range(fixed, n):
            dual += abs(residual[i] * x[i])
        if mu <= tolerance * cost and dual <= tolerance * cost and primal <= 1e-9:
            return step, True
        mu /= m
        for i in range(fixed):
            band[0, i] = 1.0
            band[1, i] = 0.0
            band[2, i] = 0.0
        if not factor(band):
            return step, False
        target = 0.0
        for phase in range(2):
            for i in range(n):
                dx[i] = -gradient[i]
            for r in range(m):
                back = z[r] / s[r] * (gx[r] + s[r] - bounds[r])
                if phase == 1:
                    back += (target - ds[r] * dz[r]) / s[r]
                add(dx, first[r], rows[r], -back)
            for i in range(fixed):
                dx[i] = 0.0
            back_solve(band, dx)
            times(first, rows, dx, gd)
            step_s = 1.0
            step_z = 1.0
            for r in range(m):
                move_s = -(gx[r] + s[r] - bounds[r]) - gd[r]
                move_z = -z[r] - z[r] / s[r] * move_s
                if phase == 1:
                    move_z += (target - ds[r] * dz[r]) / s[r]
                ds[r] = move_s
                dz[r] = move_z
                if move_s < 0.0:
                    step_s = min(step_s, -s[r] / move_s)
                if move_z < 0.0:
                    step_z = min(step_z, -z[r] / move_z)
            if phase == 0:
                ahead = 0.0
                for r in range(m):
                    ahead += (s[r] + step_s * ds[r]) * (z[r] + step_z * dz[r])
                target = mu * (ahead / m / mu) ** 3
        step_s = min(1.0, _BACK * step_s)
        step_z = min(1.0, _BACK * step_z)
        for i in range(p):
            k = point_first[i]
            g = points[i]
            move = g[0] * dx[k] + g[1] * dx[k + 1] + g[2] * dx[k + 2]
            if move < 0.0:
                step_s = min(step_s, -0.9 * value[i] / move)
        for i in range(n):
            x[i] += step_s * dx[i]
        for r in range(m):
            s[r] += step_s * ds[r]
            z[r] += step_z * dz[r]
        times(point_first, points, x, value)
        times(first, rows, x, gx)
    return MAX_STEPS, False


solve = njit(cache=True)(_solve)
