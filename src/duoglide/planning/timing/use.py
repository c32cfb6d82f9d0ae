"""How far a profile uses each limit, between its knots and between samples too."""

from __future__ import annotations

from math import cbrt, sqrt

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.motion.profile import TIME, Profile
from duoglide.planning.timing.timed_curve import CellMotion, TimedCurve

POINTS = 9  # at which each piece of a profile is looked at


def find_largest_use(timed: TimedCurve, profile: Profile, points: int = POINTS) -> FloatArray:
    """Return the largest use of each limit in each piece of a profile, (n, 3, rows)."""
    motion = CellMotion.of(timed, profile, points)
    use = estimate_peaks(motion.uses())
    step = np.diff(profile.knots[:, TIME])[:, None, None, None] / (points - 1)
    rates = motion.carriages[:, :, 1:] * (timed.limits[1:] / timed.limits[:2]) * step
    turns = _find_turning_values(motion.carriages[:, :, :2], rates)
    use[:, :2, : turns.shape[-1]] = np.maximum(use[:, :2, : turns.shape[-1]], turns)
    return use


def find_stretch(use: FloatArray) -> float:
    """Return the factor of all times that brings the worst use to 1.

    Args:
        use: Of limits of velocity, acceleration and jerk, shape (..., 3, rows), or of force too,
            (..., 4, rows).
    """
    v, a, j, *force = (float(use[..., k, :].max()) for k in range(use.shape[-2]))
    return max(v, sqrt(a), cbrt(j), *map(sqrt, force))


def _find_turning_values(values: FloatArray, rates: FloatArray) -> FloatArray:
    """Return the largest amount where the cubics between samples turn; 0 where none does.

    Args:
        values: Evenly spaced, shape (n, points, ...).
        rates: Their derivatives, times the spacing.

    Returns:
        Shape (n, ...).
    """
    low, rise = values[:, :-1], np.diff(values, axis=1)
    sign = np.sign(low + values[:, 1:])
    first, last = sign * rates[:, :-1], sign * rates[:, 1:]
    rise, low = sign * rise, sign * low
    a, b = first + last - 2.0 * rise, 3.0 * rise - 2.0 * first - last
    with np.errstate(divide="ignore", invalid="ignore"):
        u = first / (np.sqrt(b * b - 3.0 * a * first) - b)
        top = low + u * (first + u * (b + u * a))
    largest: FloatArray = np.where((first > 0.0) & (last < 0.0), top, 0.0).max(axis=1)
    return largest


def estimate_peaks(samples: FloatArray) -> FloatArray:
    """Return the largest value between samples along axis 1, estimated by parabolas.

    Args:
        samples: Evenly spaced, shape (n, points, ...), at least three points.

    Returns:
        Shape (n, ...).
    """
    before, middle, after = samples[:, :-2], samples[:, 1:-1], samples[:, 2:]
    bend = before - 2.0 * middle + after
    slope = 0.5 * (after - before)
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = np.abs(slope) < -bend  # the parabola has its peak between the outer two
        top = np.where(inside, middle - 0.5 * slope * slope / bend, middle)
    largest: FloatArray = np.maximum(samples.max(axis=1), top.max(axis=1))
    return largest
