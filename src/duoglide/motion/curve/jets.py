"""Position and three derivatives of one axis of one piece of a curve, in plain floats or compiled.

The stream asks for one point a cycle, and has no time for arrays; the search for a timing compiles
the same code. For arcs, ``Curve`` runs it on arrays too; for polynomials it multiplies matrices.
"""

from __future__ import annotations

from math import cos, sin
from typing import Any


def evaluate_polynomial(c: Any, local: float, span: float) -> tuple[float, float, float, float]:
    """Evaluate sum of c_k u^k with u = local / span, and three derivatives by ``local``."""
    u = local / span
    w = 1.0 / span
    p, d1, d2, d3 = c[-1], 0.0, 0.0, 0.0
    for k in range(len(c) - 2, -1, -1):
        d3 = d3 * u + d2
        d2 = d2 * u + d1
        d1 = d1 * u + p
        p = p * u + c[k]
    return p, d1 * w, d2 * (2.0 * w * w), d3 * (6.0 * w * w * w)


def evaluate_arc(c: Any, local: Any, span: Any, rate: Any) -> tuple[Any, Any, Any, Any]:
    """Evaluate c_0 + c_1 (cos(w s) - 1) + c_2 sin(w s) + c_3 s / span, and three derivatives.

    Args:
        c: Coefficients; without a fourth one the arc does not advance along its axis.
        local: s [mm].
        span: Length of the piece [mm].
        rate: w [rad/mm].
    """
    advance = c[3] if len(c) > 3 else 0.0
    cosine = cos(rate * local)
    sine = sin(rate * local)
    drop = 2.0 * sin(0.5 * rate * local) ** 2  # 1 - cos, and no digits lost
    radial = c[1] * cosine + c[2] * sine
    along = (c[2] * cosine - c[1] * sine) * rate
    way = c[2] * sine - c[1] * drop + advance * (local / span)
    return c[0] + way, along + advance / span, -radial * rate * rate, -along * rate * rate
