"""The curves that bound a cross-section, as functions z(x) with closed-form integrals."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.constants import Plane
from duoglide.machine import Geometry


class CurveKind(Enum):
    """What a boundary curve means."""

    LEGS = "legs: constant rise h"  # an arc of radius l6
    STRUT_TOP = "strut: constant stroke, above B3"  # an arc about B3
    STRUT_BOTTOM = "strut: constant stroke, below B3"
    CASE_2 = "arm in line with strut"  # the quartic


@dataclass(frozen=True, slots=True)
class Curve:
    """A curve of the xz plane.

    Attributes:
        geometry: Dimensions of the robot.
        kind: What it is.
        level: Rise h of the legs, or distance from B3 to C3 in the plane [mm]; 0 for case 2.
        v: Sign of sin(beta).
    """

    geometry: Geometry
    kind: CurveKind
    level: float = 0.0
    v: int = 1

    @property
    def centre(self) -> tuple[float, float]:
        """Centre (x, z) of the arc [mm]; of case 2, the pole's x and the height of B3."""
        plane = Plane.of(self.geometry)
        if self.kind is CurveKind.LEGS:
            return plane.cx, plane.base + self.level
        return (plane.cx if self.kind is CurveKind.CASE_2 else plane.xb), plane.zb

    @property
    def radius(self) -> float:
        """Radius of the arc [mm]; of case 2, the length of the arm."""
        arm = self.kind in (CurveKind.LEGS, CurveKind.CASE_2)
        return self.geometry.arm_length if arm else self.level

    @property
    def _sign(self) -> float:
        if self.kind is CurveKind.STRUT_TOP:
            return 1.0
        return -1.0 if self.kind is CurveKind.STRUT_BOTTOM else float(self.v)

    def z(self, x: FloatArray) -> FloatArray:
        """Return the height of the curve at ``x`` [mm]; NaN beside an arc, on either side."""
        x0, z0 = self.centre
        u = x - x0
        with np.errstate(invalid="ignore", divide="ignore"):
            root = self._sign * np.sqrt(self.radius**2 - u * u)
            height = root * (u + 2.0 * x0) / u if self.kind is CurveKind.CASE_2 else root
        result: FloatArray = z0 + height
        return result

    def integral(self, start: float, end: float) -> float:
        """Return the integral of z over x, in closed form [mm^2]."""
        return self._primitive(end) - self._primitive(start)

    def _primitive(self, x: float) -> float:
        """Antiderivative of z; for case 2 z - z0 = A + F1 A / u with A = v sqrt(l6^2 - u^2)."""
        x0, z0 = self.centre
        r = self.radius
        u = float(np.clip(x - x0, -r, r))
        root = float(np.sqrt((r - u) * (r + u)))
        total = z0 * x + self._sign * 0.5 * (u * root + r * r * float(np.arcsin(u / r)))
        if self.kind is CurveKind.CASE_2:
            logarithm = float(np.log((r + root) / abs(u)))
            total += self._sign * 2.0 * x0 * (root - r * logarithm)
        return total
