"""How fast velocity and acceleration of the carriages may change in parts of a motion.

The bounds hold between samples. On a checked path they follow from those of the curve's derivatives
(Bernstein coefficients) and of the profile's, through the closed form, root by root: see
``kinematics.derivatives``.

A transfer consists of cubic polynomials of the time. B and D have bounds of their own: they do not
change at all where the platform moves along the rails, however fast the carriages are.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt
from typing import TypeAlias

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.compiled import compiled, share
from duoglide.kinematics.constants import PoseConstants, pose_constants
from duoglide.kinematics.derivatives import root_bounds
from duoglide.kinematics.headroom.nearby import with_pairs
from duoglide.kinematics.modes import WORKING
from duoglide.motion.curve.bounds import bernstein, bound_curve
from duoglide.motion.motion import Motion
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import ACCELERATION, SIGMA, SPEED, TIME, Profile

share(root_bounds)

Rates: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]  # bounds on three derivatives


@dataclass(frozen=True, slots=True, eq=False)
class CarriageBounds:
    """Bounds on the motion of carriages 1 to 3, B and D in any part of a motion.

    Attributes:
        motion: Whose.
        curve: Bounds on the derivatives of the curve by sigma, per piece, each (n, 3) for a checked
            path and (n, 5) for a transfer.
        breaks: Sigma of the piece boundaries, shape (n + 1,).
        profile: Bounds on the derivatives of sigma by time, per piece of the profile, each (m, 1).
    """

    motion: Motion
    curve: Rates
    breaks: FloatArray
    profile: Rates

    @classmethod
    def of(cls, motion: Motion) -> CarriageBounds:
        """Bound every piece of the curve and of the profile."""
        path = motion.path
        if isinstance(path, TransferPath):
            curve, breaks = bound_transfer(path), path.breaks
        else:
            bounds = bound_curve(path.curve)
            curve, breaks = (bounds.first, bounds.second, bounds.third), path.curve.breaks
        return cls(motion, curve, breaks, _bound_profile(motion.profile))

    def within(self, start: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bound second and third derivatives by time from ``start`` to ``end`` [s], (n,) each.

        Returns:
            Bounds for carriages 1 to 3, B and D [mm/s^2, mm/s^3], shape (n, 5) each; inf where a
            link may not suffice.
        """
        motion = self.motion
        s1, s2, s3 = _largest_over(motion.profile.knots[:, TIME], self.profile, start, end)
        middle = 0.5 * (start + end)
        sigma = motion.profile.at(np.stack([start, middle, end]))[..., 0]
        c1, c2, c3 = _largest_over(self.breaks, self.curve, sigma[0], sigma[2])
        rates = c1 * s1, c2 * s1**2 + c1 * s2, c3 * s1**3 + 3.0 * c2 * s1 * s2 + c1 * s3
        if isinstance(motion.path, TransferPath):
            return rates[1], rates[2]
        path, out = motion.path, (np.empty((start.size, 5)), np.empty((start.size, 5)))
        constants = pose_constants(path.machine.geometry, WORKING)
        through_links(path.position(sigma[1]), rates, 0.5 * (end - start), constants, out)
        return out


def bound_transfer(path: TransferPath) -> Rates:
    """Bound the derivatives of carriages 1 to 3, B and D in each piece of a transfer, (n, 5)."""
    table = with_pairs(path.polynomials[:, 1:])
    steps = np.diff(path.breaks)[:, None]
    first = table * (np.arange(1, 4)[:, None] * steps[:, :, None] ** np.arange(3)[:, None])
    third = 6.0 * table[:, 2]
    second = np.maximum(np.abs(2.0 * table[:, 1]), np.abs(2.0 * table[:, 1] + third * steps))
    return np.abs(bernstein(2) @ first).max(axis=1), second, np.abs(third)


def _bound_profile(profile: Profile) -> Rates:
    """Bound the derivatives of sigma in each piece of a profile, (m, 1), from its Bezier points."""
    h, rise = np.diff(profile.knots[:, : SIGMA + 1], axis=0).T
    speed, rate = profile.knots[:, SPEED] / 5.0, profile.knots[:, ACCELERATION] / 20.0
    first, last = h * speed[:-1], h * speed[1:]
    second, fourth = first + h * h * rate[:-1], last - h * h * rate[1:]
    third = rise - (first + second + fourth + last)
    steps = np.stack([first, second, third, fourth, last])
    found = []
    for factor in (5.0, 4.0, 3.0):
        steps = steps * (factor / h)
        found.append(np.abs(steps).max(axis=0)[:, None])
        steps = np.diff(steps, axis=0)
    return found[0], found[1], found[2]


def _largest_over(breaks: FloatArray, rates: Rates, start: FloatArray, end: FloatArray) -> Rates:
    """Return the largest of each bound in all pieces that parts touch."""
    last = len(breaks) - 2
    low = np.clip(np.searchsorted(breaks, start, side="left") - 1, 0, last)
    high = np.clip(np.searchsorted(breaks, end, side="right") - 1, 0, last)
    slices = np.column_stack([low, high + 1]).ravel()
    one, two, three = (
        np.maximum.reduceat(np.concatenate([bound, bound[-1:]]), slices)[::2] for bound in rates
    )
    return one, two, three


@compiled
def through_links(
    position: FloatArray,
    rates: Rates,
    half: FloatArray,
    k: PoseConstants,
    out: tuple[FloatArray, FloatArray],
) -> None:
    """Carry bounds on the platform's derivatives through the closed form.

    Args:
        position: Platform in the middle of each part, (n, 3).
        rates: Bounds on its three derivatives by time in the whole part, (n, 3) each.
        half: Half of each part's length [s], (n,).
        k: As ``pose_constants`` gives them.
        out: Bounds on the second and third derivatives of carriages 1 to 3, B and D, (n, 5) each.
    """
    cx, base, xb, zb, v, l6, l2, l9 = k.cx, k.base, k.xb, k.zb, k.v, k.l6, k.l2, k.l9
    none = (0.0, 0.0, 0.0)
    for i in range(half.size):
        x, z, t = position[i, 0], position[i, 2], half[i]
        by_x = (rates[0][i, 0], rates[1][i, 0], rates[2][i, 0])
        by_z = (rates[0][i, 2], rates[1][i, 2], rates[2][i, 2])
        u = abs(x - cx) + by_x[0] * t
        A1, A2, A3 = root_bounds(sqrt((l6 - u) * (l6 + u)), (u, 0.0), by_x, none)
        rise = (by_z[0] + A1, by_z[1] + A2, by_z[2] + A3)
        h = abs(z - base - v * sqrt((l6 - (x - cx)) * (l6 + (x - cx)))) + rise[0] * t
        _p1, p2, p3 = root_bounds(sqrt((l2 - h) * (l2 + h)), (h, 0.0), rise, none)
        X, Z = abs(x - xb) + by_x[0] * t, abs(z - zb) + by_z[0] * t
        _q1, q2, q3 = root_bounds(sqrt(l9 * l9 - X * X - Z * Z), (X, Z), by_x, by_z)
        for order, p, q in ((0, p2, q2), (1, p3, q3)):
            y = rates[order + 1][i, 1]
            out[order][i, 0] = out[order][i, 1] = y + p
            out[order][i, 2] = y + q
            out[order][i, 3] = 2.0 * p
            out[order][i, 4] = q
            for j in range(5):
                if not out[order][i, j] < inf:
                    out[order][i, j] = inf
