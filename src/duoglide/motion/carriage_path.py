"""A checked path seen from the rails: where the three carriages go."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.constants import Constants, pose_constants
from duoglide.kinematics.model import inverse_derivatives
from duoglide.kinematics.modes import WORKING
from duoglide.machine import Machine
from duoglide.motion.checked import CheckedPath
from duoglide.motion.curve import Curve


@dataclass(frozen=True)
class CarriagePath:
    """The carriages along a checked curve, exact to the third derivative.

    Attributes:
        checked: The path that this is the image of.
    """

    checked: CheckedPath

    def __repr__(self) -> str:
        return f"CarriagePath({self.length:.6g} mm, {self.checked.path!r})"

    @property
    def machine(self) -> Machine:
        """The machine that it was checked for."""
        return self.checked.machine

    @property
    def curve(self) -> Curve:
        """The curve of the platform's centre."""
        return self.checked.curve

    @property
    def length(self) -> float:
        """How long the platform's path is [mm]."""
        return self.checked.curve.length

    @property
    def least_clearance(self) -> float:
        """Least distance to a singular surface or edge of reach on the path [mm]."""
        return self.checked.report["clearance"].margin

    def position(self, sigma: float | FloatArray) -> FloatArray:
        """Return the platform centre O' in the base frame [mm], shape (..., 3)."""
        return self.checked.curve.position(sigma)

    @cached_property
    def _constants(self) -> Constants:
        return pose_constants(self.checked.machine.geometry, WORKING)

    def derivatives(self, sigma: float | FloatArray, piece: Any = None) -> FloatArray:
        """Evaluate the carriages and three derivatives by sigma, through the closed form.

        Args:
            sigma: Parameter [mm], clamped to the curve; a scalar or any shape.
            piece: Index of the curve's piece to use, which names the side at a break.

        Returns:
            Shape (..., 4, 3), last axis the carriages [mm, 1, 1/mm, 1/mm^2].
        """
        states = self.checked.curve.derivatives(sigma, piece)
        if states.ndim == 2:
            return _one_point(states.tolist(), self._constants)
        return inverse_derivatives(self.checked.machine.geometry, states)


def map_to_carriages(checked: CheckedPath) -> CarriagePath:
    """Carry a checked path to the rails."""
    return CarriagePath(checked)


def _one_point(rows: list[list[float]], k: Constants) -> FloatArray:
    """Do what ``inverse_derivatives`` does, in plain floats: the stream has no time for arrays."""
    cx, base, l6, l2, half, xb, zb, l9, v, w1, w2, w3 = k
    x, y, z = zip(*rows, strict=True)
    u, X, Z = x[0] - cx, x[0] - xb, z[0] - zb
    A = _root(v * sqrt((l6 - u) * (l6 + u)), (u, *x[1:]), (0.0, 0.0, 0.0, 0.0))
    h = (z[0] - base - A[0], z[1] - A[1], z[2] - A[2], z[3] - A[3])
    p = _root(sqrt((l2 - h[0]) * (l2 + h[0])), h, (0.0, 0.0, 0.0, 0.0))
    q = _root(sqrt(l9 * l9 - (X * X + Z * Z)), (X, *x[1:]), (Z, *z[1:]))
    offsets = (half, 0.0, 0.0, 0.0)
    return np.array(
        [
            [yi - shift + w1 * pi, yi + shift + w2 * pi, yi + w3 * qi]
            for yi, shift, pi, qi in zip(y, offsets, p, q, strict=True)
        ]
    )


def _root(r: float, a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
    """Differentiate r = sqrt(L^2 - a^2 - b^2) three times, from r r' = -(a a' + b b')."""
    r1 = -(a[0] * a[1] + b[0] * b[1]) / r
    r2 = -(a[1] * a[1] + a[0] * a[2] + b[1] * b[1] + b[0] * b[2] + r1 * r1) / r
    r3 = -(3.0 * (a[1] * a[2] + b[1] * b[2] + r1 * r2) + a[0] * a[3] + b[0] * b[3]) / r
    return r, r1, r2, r3
