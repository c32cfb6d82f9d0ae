"""How far blends cut back so that they keep, and use, their corner tolerance."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from duoglide.arrays import BoolArray, FloatArray, IndexArray
from duoglide.motion.curve.curve import Curve
from duoglide.motion.rounding.blend import find_nearest, join_quintics

UNEVEN = 3.0  # the longer cut-back over the shorter, at most
WIDEST = 0.5  # [rad] of an arc that a blend may take
EXACT = 1e-9  # relative, to which the tolerance is used, from below
_ROUNDS = 80


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners to round, one row each.

    Attributes:
        waypoint: Index of the waypoint, shape (n,).
        left: Index of the curve's piece before it; the piece after it is the next one.
        tolerance: Corner tolerance [mm]; of no meaning where ``explicit``.
        shape: Shape of the blend.
        explicit: Whether the cut-backs are given.
        before: Given cut-back before the corner [mm], else 0.
        after: Given cut-back after it [mm], else 0.
    """

    waypoint: IndexArray
    left: IndexArray
    tolerance: FloatArray
    shape: FloatArray
    explicit: BoolArray
    before: FloatArray
    after: FloatArray

    def those(self, mask: BoolArray) -> Corners:
        """Return the corners where ``mask`` is true."""
        return Corners(*(getattr(self, field.name)[mask] for field in fields(self)))


def cut_backs(curve: Curve, corners: Corners) -> tuple[FloatArray, FloatArray]:
    """Choose cut-backs: equal where there is room, up to three to one where one side is short.

    The longest ones within the tolerance are taken. Two blends share a segment by halves; what one
    does not need goes to the other.

    Returns:
        Cut-backs before and after each corner [mm], shape (n,).
    """
    before, after = corners.before.copy(), corners.after.copy()
    free = np.flatnonzero(~corners.explicit)
    if free.size == 0:
        return before, after
    room = np.where(curve.rates > 0.0, WIDEST / np.maximum(curve.rates, 1e-300), np.inf)
    shared = np.zeros(curve.count, dtype=np.intp)
    np.add.at(shared, corners.left, 1)
    np.add.at(shared, corners.left + 1, 1)
    half = curve.spans / np.maximum(shared, 1)
    used = np.zeros((2, curve.count))  # at the start and at the end of each piece
    used[0, corners.left[corners.explicit] + 1] = after[corners.explicit]
    used[1, corners.left[corners.explicit]] = before[corners.explicit]
    open_ends = np.zeros((2, curve.count), dtype=bool)
    for last in (False, True):
        left, right = corners.left[free], corners.left[free] + 1
        rest_left = curve.spans[left] - used[0, left]
        rest_right = curve.spans[right] - used[1, right]
        if last:  # a neighbour that has met its tolerance leaves the rest of the segment
            limit_a = np.where(open_ends[0, left], half[left], rest_left)
            limit_b = np.where(open_ends[1, right], half[right], rest_right)
        else:
            given_a, given_b = used[0, left] > 0.0, used[1, right] > 0.0
            limit_a = np.where(given_a, rest_left, half[left])
            limit_b = np.where(given_b, rest_right, half[right])
        limits = np.minimum(limit_a, room[left]), np.minimum(limit_b, room[right])
        before[free], after[free], met = _fit(curve, corners, free, *limits)
        if met.all():
            break
        used[1, left], used[0, right] = before[free], after[free]
        open_ends[1, left[~met]] = open_ends[0, right[~met]] = True
        free = free[~met]
    return before, after


def _fit(
    curve: Curve, corners: Corners, which: IndexArray, limit_a: FloatArray, limit_b: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Find the largest cut-backs within limits and tolerance; tells where the tolerance decided."""
    limit_a, limit_b = np.minimum(limit_a, UNEVEN * limit_b), np.minimum(limit_b, UNEVEN * limit_a)
    left, shape = corners.left[which], corners.shape[which]
    goal = corners.tolerance[which] * (1.0 - EXACT)

    corner = curve.position(curve.breaks[left + 1])

    def deviation(cut: FloatArray, rows: IndexArray) -> FloatArray:
        a, b = np.minimum(cut, limit_a[rows]), np.minimum(cut, limit_b[rows])
        states = curve.both_sides(a, b, left[rows])
        bends = join_quintics(*states, 5.0 * shape[rows] * np.minimum(a, b))
        return find_nearest(bends, corner[rows])[1]

    low = np.zeros(goal.size)
    high = np.maximum(limit_a, limit_b)
    cut = np.minimum(limit_a, limit_b)  # equal cut-backs: between lines the deviation grows with it
    rows, known_cut, known = np.arange(goal.size), np.ones(goal.size), np.ones(goal.size)
    result, met, power = np.empty(goal.size), np.zeros(goal.size, dtype=bool), np.ones(goal.size)
    for turn in range(_ROUNDS):
        value = deviation(cut, rows)
        over = value > goal[rows]
        low, high = np.where(over, low, cut), np.where(over, cut, high)
        met[rows] |= over
        result[rows] = low
        near = (~over & (value >= (1.0 - EXACT) * goal[rows])) | (high - low < 1e-15 * high)
        met[rows] |= near & (high > low)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if turn:
                power = np.log(value / known) / np.log(cut / known_cut)
            step = cut * (goal[rows] * (1.0 - 0.1 * EXACT) / value) ** (1.0 / power)
        usable = np.isfinite(step) & (step > low) & (step < high)
        following = np.where(usable, step, np.where(met[rows], 0.5 * (low + high), high))
        going = np.flatnonzero(~near & (following != cut))
        if going.size == 0:
            break
        known_cut, known, cut = cut[going], value[going], following[going]
        rows, low, high, power = rows[going], low[going], high[going], power[going]
    return np.minimum(result, limit_a), np.minimum(result, limit_b), met
