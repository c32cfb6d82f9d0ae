"""Where drive stops are in cells, to the second order: one loop, compiled.

G(v, t) is how far a drive goes that has braked for t from the velocity v: see ``braking.cells``.
Its slope by v is the lesser of t and |v| / d, so that two drives with the same deceleration differ
by at most that times the difference of their velocities: nothing, along the rails.
"""

from __future__ import annotations

from math import inf
from typing import Any, TypeAlias

import numpy as np

from duoglide.kinematics.compiled import compiled, inlined

Two: TypeAlias = tuple[float, float]
Three: TypeAlias = tuple[float, float, float]

BRAKING, RESTING, EITHER = 1, 2, 0


@inlined
def ramp(v: float, d: float, t: float) -> tuple[float, float, float]:
    """Return G and its slopes by t and by v, for the deceleration ``d``."""
    slowing = abs(v) / d
    braked = min(t, slowing)
    share = braked / slowing if slowing > 0.0 else 1.0
    return v * braked * (1.0 - 0.5 * share), v * (1.0 - share), braked


@inlined
def doing_of(speed: float, dv: float, d: float, start: float, end: float) -> int:
    """Tell what a drive does for sure from ``start`` to ``end`` after it began to brake."""
    if start >= (speed + dv) / d:
        return RESTING
    if end <= (speed - dv) / d:
        return BRAKING
    return EITHER


@inlined
def own_bend(doing: int, dv: float, dt: float, d: float) -> float:
    """Bound what G has beyond its slopes, for velocities within dv and times within dt."""
    resting, braking = 0.5 * dv * dv / d, dv * dt + 0.5 * d * dt * dt
    if doing == RESTING:
        return resting
    return braking if doing == BRAKING else max(braking, resting)


@inlined
def pair_bend(doing: int, dv: Three, dt: float, d: Two, same_sign: bool) -> float:
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


@inlined
def pair_beyond(p: int, plan: Any, own: Any, times: Any, deceleration: Any) -> float:
    """Bound what the difference of two carriages has beyond its slopes.

    Args:
        p: Which: 0 for carriages 1 and 2, 1 for 1 and 3, 2 for 2 and 3.
        plan: v and a of the column, and its bounds most_a and most_j, B and D included.
        own: How long each carriage has moved, the velocity it is left with, how far its first one
            may be off, what its own ramp has beyond its slopes, and what it does, (3,) each.
        times: c and t in the middle, and half the lengths of u, c and t.
        deceleration: Of each drive.
    """
    (v, a, most_a, most_j), (moved, left, dv, bend, doing) = plan, own
    coast, t, hu, hc, ht = times
    i, j = p // 2, 1 + (p + 1) // 2
    acceleration = most_a[3] if p == 0 else most_a[4] + 0.5 * most_a[3]
    jerk = most_j[3] if p == 0 else most_j[4] + 0.5 * most_j[3]
    apart, both = acceleration * hu, bend[i] + bend[j]
    if doing[i] == doing[j] != EITHER:
        sure = abs(v[i]) > dv[i] and abs(v[j]) > dv[j] and v[i] * v[j] > 0.0
        speeds, d_pair = (dv[i], dv[j], apart), (deceleration[i], deceleration[j])
        both = min(both, pair_bend(doing[i], speeds, ht, d_pair, sure) + apart * hc)
    if deceleration[i] == deceleration[j]:
        longer = 2.0 * hc + max(ht, max(dv[i], dv[j]) / deceleration[i])
        most = abs(v[i] - v[j]) * longer + apart * (coast + hc + t + ht)
        most += abs(moved[i] * a[i] - moved[j] * a[j]) * hu + abs(left[i] - left[j]) * ht
        both = min(both, most)
    together, uneven = min(moved[i], moved[j]) * jerk, abs(moved[i] - moved[j])
    change = acceleration + together + uneven * max(most_j[i], most_j[j])
    beyond: float = 0.5 * hu * hu * change + both
    return beyond


@compiled
def brake_patches(columns: Any, cells: Any, deceleration: Any, out: Any) -> None:
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
    moved, left, dv, bend = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    doing, pairs = np.empty(3, dtype=np.int64), np.empty(3)
    for n in range(column.size):
        c = column[n]
        coast, t, hc, ht, hu = times[n, 0], times[n, 1], half[n, 0], half[n, 1], half_u[c]
        for i in range(3):
            d = deceleration[i]
            gone, left[i], braked = ramp(v[c, i], d, t)
            moved[i], dv[i] = coast + braked, most_a[c, i] * hu
            middle[n, i] = q[c, i] + v[c, i] * coast + gone
            ways[n, 0, i] = (v[c, i] + a[c, i] * moved[i]) * hu
            ways[n, 1, i], ways[n, 2, i] = v[c, i] * hc, left[i] * ht
            doing[i] = doing_of(abs(v[c, i]), dv[i], d, t - ht, t + ht)
            bend[i] = own_bend(doing[i], dv[i], ht, d) + dv[i] * hc
            change = most_a[c, i] + moved[i] * most_j[c, i]
            beyond[n, i] = 0.5 * hu * hu * change + bend[i]
        plan = v[c], a[c], most_a[c], most_j[c]
        own, length = (moved, left, dv, bend, doing), (coast, t, hu, hc, ht)
        for p in range(3):  # in a loop, for numba compiles a call once for every literal
            pairs[p] = pair_beyond(p, plan, own, length, deceleration)
        beyond[n, 3], beyond[n, 4] = pairs[0], 0.5 * (pairs[1] + pairs[2])
        for i in range(5):
            if not beyond[n, i] < inf:
                beyond[n, i] = inf
