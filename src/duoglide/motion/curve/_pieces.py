"""Powers and lengths of the pieces of a curve."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from duoglide.arrays import FloatArray, IndexArray

DERIVATIVES = 4  # position and three derivatives
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@lru_cache
def power_tables(count: int) -> tuple[IndexArray, FloatArray]:
    """Exponent and factor of u^k in its derivatives 0 to 3, for k below ``count``."""
    k, order = np.arange(count), np.arange(DERIVATIVES)[:, None]
    factors = np.ones((DERIVATIVES, count))
    for i in range(DERIVATIVES - 1):
        factors *= np.where(order > i, np.maximum(k - i, 0), 1)
    return np.maximum(k - order, 0), factors


def raise_powers(base: FloatArray, count: int) -> FloatArray:
    """Return base^0 to base^(count - 1), shape (..., count)."""
    powers = np.empty((*base.shape, count))
    powers[..., 0] = 1.0
    powers[..., 1:] = base[..., None]
    return np.multiply.accumulate(powers, axis=-1, out=powers)


def integrate_length(
    rows: FloatArray, span: FloatArray, rate: FloatArray, end: FloatArray, panels: int
) -> FloatArray:
    """Integrate |p'| of pieces from s = 0 to ``end`` by Gauss-Legendre, shape (n,)."""
    nodes = ((np.arange(panels)[:, None] + 0.5 * (1.0 + _NODES)) / panels).ravel()
    u = (end / span)[:, None] * nodes
    degree = rows.shape[1] - 1
    slope = raise_powers(u, degree) @ (rows[:, 1:] * np.arange(1.0, degree + 1.0)[:, None])
    turning = rate > 0.0
    if turning.any():
        turned, c = (rate * span)[turning, None, None], rows[turning, :, None]
        angle = turned * u[turning, :, None]
        slope[turning] = turned * (c[:, 2] * np.cos(angle) - c[:, 1] * np.sin(angle)) + c[:, 3]
    speed = np.sqrt((slope * slope).sum(axis=-1)).reshape(-1, panels, _NODES.size)
    lengths: FloatArray = (speed @ _WEIGHTS).sum(axis=1) * end / (2.0 * panels * span)
    return lengths
