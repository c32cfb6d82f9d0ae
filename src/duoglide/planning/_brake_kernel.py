"""Where brakes are in cells, to the second order: one loop, compiled.

G(v, t) is how far a drive goes that has braked for t from the velocity v: see ``_brake_cells``. Its
slope by v is the lesser of t and |v| / d, so that two drives with the same deceleration differ by
at most that times the difference of their velocities: nothing, along the rails.
"""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from duoglide.kinematics.compiled import compiled, inlined

BRAKING, RESTING, EITHER = 1, 2, 0


def _ramp(v: float, d: float, t: float) -> tuple[float, float, float]:
    """Return G and its slopes by t and by v, for the deceleration ``d``."""
    slowing = abs(v) / d
    braked = min(t, slowing)
    share = braked / slowing if slowing > 0.0 else 1.0
    return v * braked * (1.0 - 0.5 * share), v * (1.0 - share), braked


def _doing(speed: float, dv: float, d: float, start: float, end: float) -> int:
    """Tell what a drive does for sure from ``start`` to ``end`` after it began to brake."""
    if start >= (speed + dv) / d:
        return RESTING
    if end <= (speed - dv) / d:
        return BRAKING
    return EITHER


def _own_bend(doing: int, dv: float, dt: float, d: float) -> float:
    """Bound what G has beyond its slopes, for velocities within dv and times within dt."""
    resting, braking = 0.5 * dv * dv / d, dv * dt + 0.5 * d * dt * dt
    if doing == RESTING:
        return resting
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
        cells: Of ``BrakeCells``: column, middle, half.
        deceleration: Of each drive [mm/s^2], (3,).
        out: Arrays of a ``Patch``, to be filled.
    """
    half_u, q, v, a, most_a, most_j = columns
    column, times, half = cells
    middle, ways, beyond = out
    moved, dv, bend = np.empty(3), np.empty(3), np.empty(3)
    doing, pairs = np.empty(3, dtype=np.int64), np.empty(3)
    for n in range(column.size):
        c = column[n]
        coast, t, hc, ht, hu = times[n, 0], times[n, 1], half[n, 0], half[n, 1], half_u[c]
        square = 0.5 * hu * hu
        for i in range(3):
            d = deceleration[i]
            gone, left, braked = ramp(v[c, i], d, t)
            moved[i] = coast + braked
            middle[n, i] = q[c, i] + v[c, i] * coast + gone
            ways[n, 0, i] = (v[c, i] + a[c, i] * moved[i]) * hu
            ways[n, 1, i], ways[n, 2, i] = v[c, i] * hc, left * ht
            dv[i] = most_a[c, i] * hu
            doing[i] = doing_of(abs(v[c, i]), dv[i], d, t - ht, t + ht)
            bend[i] = own_bend(doing[i], dv[i], ht, d) + dv[i] * hc
            beyond[n, i] = square * (most_a[c, i] + moved[i] * most_j[c, i]) + bend[i]
        for p in range(3):  # of carriages 1 and 2, 1 and 3, 2 and 3
            i, j = p // 2, 1 + (p + 1) // 2
            acceleration = most_a[c, 3] if p == 0 else most_a[c, 4] + 0.5 * most_a[c, 3]
            jerk = most_j[c, 3] if p == 0 else most_j[c, 4] + 0.5 * most_j[c, 3]
            apart = acceleration * hu
            both = bend[i] + bend[j]
            if doing[i] == doing[j] != EITHER:
                sure = abs(v[c, i]) > dv[i] and abs(v[c, j]) > dv[j]
                sure = sure and v[c, i] * v[c, j] > 0.0
                speeds, d_pair = (dv[i], dv[j], apart), (deceleration[i], deceleration[j])
                both = min(both, pair_bend(doing[i], speeds, ht, d_pair, sure) + apart * hc)
            if deceleration[i] == deceleration[j]:
                longer = hc + max(ht, max(dv[i], dv[j]) / deceleration[i])
                most = abs(v[c, i] - v[c, j]) * longer + apart * (coast + hc + t + ht)
                most += abs(moved[i] * a[c, i] - moved[j] * a[c, j]) * hu
                most += abs(ways[n, 1, i] - ways[n, 1, j]) + abs(ways[n, 2, i] - ways[n, 2, j])
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
