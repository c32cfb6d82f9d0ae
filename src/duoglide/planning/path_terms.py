"""What a motion along a curve asks of the carriages, and the share of their limits that is."""

from __future__ import annotations

from math import cbrt, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray
from duoglide.machine import CarriageLimits
from duoglide.motion.carriage_path import CarriagePath
from duoglide.motion.profile import Profile


def pieces_of(path: CarriagePath, sigma: FloatArray) -> NDArray[np.intp]:
    """Return the index of the curve's piece that holds each sigma; at a break the later one."""
    breaks = path.curve.breaks
    inside = np.searchsorted(breaks, sigma, side="right") - 1
    return np.clip(inside, 0, len(breaks) - 2)


def carriage_motion(path: CarriagePath, motion: FloatArray, piece: Any) -> FloatArray:
    """Differentiate the carriages by time.

    Args:
        path: The curve of the carriages.
        motion: Sigma and its three time derivatives, shape (..., 4).
        piece: Piece of the curve that each belongs to, shape (...).

    Returns:
        Velocity, acceleration and jerk of the carriages, shape (..., 3, 3), carriages last.
    """
    sigma, v, a, j = (motion[..., k, None] for k in range(4))
    q = path.derivatives(sigma[..., 0], piece)
    q1, q2, q3 = q[..., 1, :], q[..., 2, :], q[..., 3, :]
    result: FloatArray = np.stack(
        [q1 * v, q1 * a + q2 * (v * v), q1 * j + (3.0 * q2 * a + q3 * (v * v)) * v], axis=-2
    )
    return result


def motion_within(path: CarriagePath, profile: Profile, points: int) -> FloatArray:
    """Return ``carriage_motion`` at ``points`` times of each piece of a profile, ends included.

    No piece of the profile may cross a break of the curve. Shape (n, points, 3, 3).
    """
    times, motion = profile.within_pieces(points)
    middle = profile.at(0.5 * (times[:, 0] + times[:, -1]))[:, 0]
    piece = np.broadcast_to(pieces_of(path, middle)[:, None], times.shape)
    return carriage_motion(path, motion, piece)


def limit_table(limits: CarriageLimits) -> FloatArray:
    """Return the limits as an array like ``carriage_motion``: derivative, carriage, (3, 3)."""
    return np.stack([limits.velocity, limits.acceleration, limits.jerk])


def stretch(use: FloatArray) -> float:
    """Return the factor of all times that brings the worst use to 1.

    Args:
        use: Absolute derivatives over their limits, shape (..., 3, 3) as ``carriage_motion``.
    """
    v, a, j = (float(use[..., k, :].max()) for k in range(3))
    return max(v, sqrt(a), cbrt(j))


def peaks(samples: FloatArray) -> FloatArray:
    """Return the largest absolute value between samples along axis 1, estimated by parabolas.

    Args:
        samples: Evenly spaced, shape (n, points, ...), at least three points.

    Returns:
        Shape (n, ...).
    """
    before, middle, after = samples[:, :-2], samples[:, 1:-1], samples[:, 2:]
    bend = before - 2.0 * middle + after
    slope = 0.5 * (after - before)
    with np.errstate(divide="ignore", invalid="ignore"):
        where = np.abs(slope) < np.abs(bend)  # the parabola's peak is between the outer two
        top = np.where(where, middle - 0.5 * slope * slope / bend, 0.0)
    largest: FloatArray = np.maximum(np.abs(samples).max(axis=1), np.abs(top).max(axis=1))
    return largest
