"""The two loops of the stop bounds that run over every cell of a plan, compiled."""

from __future__ import annotations

from math import sqrt
from typing import TypeAlias

import numpy as np

from duoglide.arrays import FloatArray, IndexArray
from duoglide.kinematics.compiled import compiled

Two: TypeAlias = tuple[FloatArray, FloatArray]


@compiled
def find_largest_slopes(
    peaks: FloatArray, limits: Two, levels: Two, rho: float, out: FloatArray
) -> None:
    """Find the largest R1 that each cell allows with R2 = R1^2 / rho, falling and rising.

    Each limit is looked at from both sides: what the plan itself adds there is its own peak; with
    r' < 0, q' r' and q'' r' add to it where q' and q'' have the other sign. Both conditions grow
    with R1, so that it is solved for only where the R1 so far breaks one of them.

    Args:
        peaks: Largest positive and largest negative values, both as amounts, of velocity,
            acceleration and jerk, (2, 3, n, 3).
        limits: Of acceleration and jerk, (2, 3); what of each is left at least, (2, 3).
        levels: Upper edge of each cell of r, and r' at its lower edge as a share of R1, (m,) each.
        rho: Shape of a change.
        out: Falling and rising, (2, n); what to begin with, and the result.
    """
    limit, reserve = limits
    upper, share = levels
    for way in range(2):
        for k in range(out.shape[1]):
            slope = out[way, k]
            for side in range(2):
                other = side if way == 1 else 1 - side
                for c in range(3):
                    v = peaks[other, 0, k, c]
                    a = 1.5 * peaks[other, 1, k, c]
                    bend = max(peaks[0, 0, k, c], peaks[1, 0, k, c]) / rho
                    own_a = peaks[side, 1, k, c]
                    own_j = peaks[side, 2, k, c]
                    for i in range(upper.size):
                        r = upper[i]
                        spare = max(limit[0, c] - own_a * r * r, reserve[0, c])
                        if slope * v * share[i] > spare:
                            slope = spare / (v * share[i])
                        room = max(limit[1, c] - own_j * r * r * r, reserve[1, c])
                        half = a * r * share[i]
                        if slope * (2.0 * half + slope * bend) > room:
                            slope = room / (half + sqrt(half * half + room * bend))
            out[way, k] = slope


@compiled
def fill_windows(largest: FloatArray, lasting: float, slope: FloatArray, until: IndexArray) -> None:
    """Find the R1 that the whole window of each cell allows, and the last cell of the window.

    Args:
        largest: R1 that each cell by itself allows [1/s], (n,).
        lasting: Length of a window, in cells, times its R1 [1/s].
        slope: R1 of each window, (n,); set.
        until: Last cell of each window, (n,); set.
    """
    cells = largest.size
    for start in range(cells):
        least = largest[start]
        last = start
        while last + 1 < cells and lasting > least * (last - start):
            last += 1
            least = min(least, largest[last])
        slope[start] = least
        until[start] = last


def find_windows(largest: FloatArray, lasting: float) -> tuple[FloatArray, IndexArray]:
    """Return what ``fill_windows`` sets."""
    slope, until = np.empty(largest.size), np.empty(largest.size, dtype=np.intp)
    fill_windows(largest, lasting, slope, until)
    return slope, until
