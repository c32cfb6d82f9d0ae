"""Where the knots of a profile stand: evenly in time, and at every break of the curve."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray

_LEAST_OF_STEP = 0.25  # a wished knot nearer to a fixed one than this share of a step is left out


def grid(
    fixed: FloatArray,
    wished: FloatArray,
    clock: tuple[FloatArray, FloatArray],
    cells: int,
    least: int,
) -> FloatArray:
    """Divide a motion into cells.

    Args:
        fixed: Times of the motion where a knot must be, its ends included, ascending [s].
        wished: Times where a knot would be good.
        clock: Times of the motion (ascending), and what a better clock shows at each; cells are
            even on that clock.
        cells: How many to make, about.
        least: How many to make between two fixed times at least.

    Returns:
        Times of the motion [s].
    """
    theta, shown = clock
    ends = np.interp(fixed, theta, shown)
    step = (ends[-1] - ends[0]) / cells
    near = np.interp(wished, theta, shown)
    apart = np.abs(near[:, None] - ends).min(axis=1, initial=np.inf) > _LEAST_OF_STEP * step
    parts = []
    for low, high, begin in zip(ends[:-1], ends[1:], fixed[:-1], strict=True):
        count = max(int(np.ceil((high - low) / step - 0.3)), least)
        part = np.interp(np.linspace(low, high, count + 1)[:-1], shown, theta)
        part[0] = begin
        parts.append(part)
    return _with_wished(np.concatenate([*parts, fixed[-1:]]), wished[apart], fixed)


def _with_wished(times: FloatArray, wished: FloatArray, fixed: FloatArray) -> FloatArray:
    """Move the knot that is nearest to each wished time there, unless it is a fixed one."""
    free = ~np.isin(times, fixed)
    for wish in wished:
        distance = np.where(free, np.abs(times - wish), np.inf)
        nearest = int(np.argmin(distance))
        if np.isfinite(distance[nearest]):
            times[nearest] = wish
            free[nearest] = False
    return times
