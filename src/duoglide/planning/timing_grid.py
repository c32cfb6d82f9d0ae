"""Where the knots of a profile stand: evenly in time, and at every break of the curve."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray

_LEAST_OF_STEP = 1e-6  # knots nearer than this share of a step are one


def grid(
    fixed: FloatArray, clock: tuple[FloatArray, FloatArray], cells: int, least: int
) -> FloatArray:
    """Divide a motion into cells.

    Args:
        fixed: Times of the motion where a knot must be, its ends included, ascending [s].
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
    keep = np.concatenate(
        [[True], np.diff(fixed) > _LEAST_OF_STEP * (fixed[-1] - fixed[0]) / cells]
    )
    keep[-1] = True
    fixed, ends = fixed[keep], ends[keep]
    counts = np.maximum(np.ceil(np.diff(ends) / step - 0.3).astype(int), least)
    parts = [
        np.interp(np.linspace(low, high, n + 1)[:-1], shown, theta)
        for low, high, n in zip(ends[:-1], ends[1:], counts, strict=True)
    ]
    for part, begin in zip(parts, fixed[:-1], strict=True):
        part[0] = begin
    return np.concatenate([*parts, fixed[-1:]])
