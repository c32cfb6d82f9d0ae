"""Where the knots of a profile stand: evenly in time, and at every break of the curve."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.planning.compare import whole

# [s] A piece of the curve that is passed quicker is one cell: of shorter ones, what rounding leaves
# of the jerk is seen. The base's own clock does not know yet what is quick.
_BRIEF = 20e-6
_NEAR = 0.25 * (1.0 + 1e-9)  # of a step; a knot nearer than that to a more important one is left
# out, and one just as near too, whatever rounding makes of that


def divide_motion(
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
        least: How many to make between two fixed times at least; one where they are next to one.

    Returns:
        Times of the motion [s].
    """
    theta, shown = clock
    ends = np.interp(fixed, theta, shown)
    step = (ends[-1] - ends[0]) / cells
    clocked = shown is not theta
    free = []
    for low, high in pairwise(ends):
        brief = clocked and high - low < _BRIEF
        count = max(whole((high - low) / step - 0.3), 1 if brief else least)
        free.append(np.linspace(low, high, count + 1)[1:-1])
    kept = _apart(np.interp(wished, theta, shown), ends[1:-1], _NEAR * step)
    evenly = _apart(np.concatenate(free), kept, _NEAR * step)
    return np.union1d(np.interp(np.concatenate([kept, evenly]), shown, theta), fixed)


def _apart(points: FloatArray, others: FloatArray, distance: float) -> FloatArray:
    """Return the points that are at least ``distance`` from all the others, which are ascending."""
    if not others.size:
        return points
    right = np.searchsorted(others, points).clip(0, others.size - 1)
    left = (right - 1).clip(0)
    gap = np.minimum(np.abs(others[right] - points), np.abs(others[left] - points))
    result: FloatArray = points[gap > distance]
    return result
