"""Where brakes are in cells, to the second order: one loop, compiled.

G(v, t) is how far a drive goes that began to brake t ago at the velocity v: see ``_brake_cells``.
Its slope by v is the lesser of t and coast + |v| / d, so that two drives with the same deceleration
differ by at most that times the difference of their velocities: nothing, along the rails.
"""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from duoglide.kinematics.compiled import compiled, inlined

COASTING, BRAKING, RESTING, ANYTHING = 1, 2, 3, 0


def _ramp(v: float, d: float, coast: float, t: float) -> tuple[float, float, float]:
    """Return G and its slopes by t and by v, for the deceleration ``d`` after ``coast`` s."""
    coasted, slowing = min(t, coast), abs(v) / d
    braked = min(max(t - coast, 0.0), slowing)
    share = braked / slowing if slowing > 0.0 else 1.0
    return v * (coasted + braked * (1.0 - 0.5 * share)), v * (1.0 - share), coasted + braked


def _doing(speed: float, dv: float, d: float, start: float, end: float) -> int:
    """Tell what a drive does for sure from ``start`` to ``end`` after it began to brake."""
    if end <= 0.0:
        return COASTING
    if start >= (speed + dv) / d:
        return RESTING
    if start >= 0.0 and end <= (speed - dv) / d:
        return BRAKING
    return ANYTHING


def _own_bend(doing: int, dv: float, dt: float, d: float) -> float:
    """Bound what G has beyond its slopes, for velocities within dv and times within dt."""
    resting = 0.5 * dv * dv / d
    if doing == RESTING:
        return resting
    if doing == COASTING:
        return dv * dt
    braking = dv * dt + 0.5 * d * dt * dt
    return braking if doing == BRAKING else max(braking, resting)


def _pair_bend(doing: int, dv: Any, dt: float, d: Any, same_sign: bool) -> float:
    """Bound the same for the difference of two drives that do the same.

    Args:
        doing: What both do.
        dv: How far each velocity may be from the middle's, and how far their difference.
        dt: How far the time may be.
        d: Both decelerations.
        same_sign: Whether both surely go the same way.
    """
    (one, other, pair), (d_one, d_other) = dv, d
    if doing == COASTING:
        return pair * dt
    turn = abs(d_one - d_other) if same_sign else d_one + d_other
    if doing == BRAKING:
        return pair * dt + 0.5 * turn * dt * dt
    if turn == 0.0:
        return 0.5 * pair * (one + other) / d_one
    return 0.5 * (one * one / d_one + other * other / d_other)


ramp, doing_of = inlined(_ramp), inlined(_doing)
own_bend, pair_bend = inlined(_own_bend), inlined(_pair_bend)


def _brake_patches(columns: Any, cells: Any, deceleration: Any, out: Any) -> None:
    """Find middles, ways and bends of cells.

    Args:
        columns: Of ``Columns``: half, q, v, a, most_a, most_j.
        cells: Of ``BrakeCells``: column, coast, t, half.
        deceleration: Of each drive [mm/s^2], (3,).
        out: Arrays of a ``Patch``, to be filled.
    """
    half_u, q, v, a, most_a, most_j = columns
    column, coast, t, half = cells
    middle, ways, beyond = out
    moved, dv, bend = np.empty(3), np.empty(3), np.empty(3)
    doing, pairs = np.empty(3, dtype=np.int64), np.empty(3)
    for n in range(column.size):
        c = column[n]
        hu, ht = half_u[c], half[n]
        square = 0.5 * hu * hu
        start = t[n] - ht - coast[n]
        for i in range(3):
            d = deceleration[i]
            gone, left, moved[i] = ramp(v[c, i], d, coast[n], t[n])
            middle[n, i] = q[c, i] + gone
            ways[n, 0, i], ways[n, 1, i] = (v[c, i] + a[c, i] * moved[i]) * hu, left * ht
            dv[i] = most_a[c, i] * hu
            doing[i] = doing_of(abs(v[c, i]), dv[i], d, start, start + 2.0 * ht)
            bend[i] = own_bend(doing[i], dv[i], ht, d)
            beyond[n, i] = square * (most_a[c, i] + moved[i] * most_j[c, i]) + bend[i]
        for p in range(3):  # of carriages 1 and 2, 1 and 3, 2 and 3
            i, j = p // 2, 1 + (p + 1) // 2
            acceleration = most_a[c, 3] if p == 0 else most_a[c, 4] + 0.5 * most_a[c, 3]
            jerk = most_j[c, 3] if p == 0 else most_j[c, 4] + 0.5 * most_j[c, 3]
            both = bend[i] + bend[j]
            if doing[i] == doing[j] != ANYTHING:
                sure = abs(v[c, i]) > dv[i] and abs(v[c, j]) > dv[j]
                sure = sure and v[c, i] * v[c, j] > 0.0
                apart = dv[i], dv[j], acceleration * hu
                d_pair = deceleration[i], deceleration[j]
                both = min(both, pair_bend(doing[i], apart, ht, d_pair, sure))
            if deceleration[i] == deceleration[j]:
                slower = abs(v[c, i] - v[c, j])
                later = max(ht, max(dv[i], dv[j]) / deceleration[i])
                straight = abs(moved[i] * a[c, i] - moved[j] * a[c, j]) * hu
                straight += abs(ways[n, 1, i] - ways[n, 1, j])
                most = slower * later + acceleration * hu * (t[n] + ht) + straight
                both = min(both, most)
            together = min(moved[i], moved[j]) * jerk
            uneven = abs(moved[i] - moved[j]) * max(most_j[c, i], most_j[c, j])
            pairs[p] = square * (acceleration + together + uneven) + both
        beyond[n, 3] = pairs[0]
        beyond[n, 4] = 0.5 * (pairs[1] + pairs[2])
        for i in range(5):
            if not beyond[n, i] < inf:
                beyond[n, i] = inf


brake_patches = compiled(_brake_patches)
