"""The carriages and three derivatives along a motion of one pose, in plain floats or compiled.

``model.inverse_derivatives`` does the same for arrays and to any order; the stream has no time for
arrays, and the search for a timing compiles this.
"""

from __future__ import annotations

from math import sqrt
from typing import TypeAlias

from duoglide.kinematics.constants import Constants

Jet: TypeAlias = tuple[float, float, float, float]  # a value and three derivatives


def root_jet(r: float, a: Jet, b: Jet) -> Jet:
    """Differentiate r = sqrt(L^2 - a^2 - b^2) three times, from r r' = -(a a' + b b')."""
    r1 = -(a[0] * a[1] + b[0] * b[1]) / r
    r2 = -(a[1] * a[1] + a[0] * a[2] + b[1] * b[1] + b[0] * b[2] + r1 * r1) / r
    r3 = -(3.0 * (a[1] * a[2] + b[1] * b[2] + r1 * r2) + a[0] * a[3] + b[0] * b[3]) / r
    return r, r1, r2, r3


def carriage_jets(x: Jet, y: Jet, z: Jet, k: Constants) -> tuple[Jet, Jet, Jet]:
    """Carry a position and three derivatives through the closed form.

    Beyond reach, in plain floats, a square root or a quotient fails; compiled, the third derivative
    of carriage 1 or 3 is not finite.
    """
    cx, base, l6, l2, half, xb, zb, l9, v, w1, w2, w3 = k
    u, X, Z = x[0] - cx, x[0] - xb, z[0] - zb
    none = (0.0, 0.0, 0.0, 0.0)
    A = root_jet(v * sqrt((l6 - u) * (l6 + u)), (u, x[1], x[2], x[3]), none)
    h = (z[0] - base - A[0], z[1] - A[1], z[2] - A[2], z[3] - A[3])
    p = root_jet(sqrt((l2 - h[0]) * (l2 + h[0])), h, none)
    across, up = (X, x[1], x[2], x[3]), (Z, z[1], z[2], z[3])
    q = root_jet(sqrt(l9 * l9 - (X * X + Z * Z)), across, up)
    return (
        (y[0] - half + w1 * p[0], y[1] + w1 * p[1], y[2] + w1 * p[2], y[3] + w1 * p[3]),
        (y[0] + half + w2 * p[0], y[1] + w2 * p[1], y[2] + w2 * p[2], y[3] + w2 * p[3]),
        (y[0] + w3 * q[0], y[1] + w3 * q[1], y[2] + w3 * q[2], y[3] + w3 * q[3]),
    )
