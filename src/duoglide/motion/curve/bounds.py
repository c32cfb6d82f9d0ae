"""Bounds on the derivatives of a curve that hold between samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import comb

import numpy as np

from duoglide.arrays import FloatArray, read_only
from duoglide.motion.curve.curve import Curve

_ROUNDING = 1.0 + 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class CurveBounds:
    """The greatest absolute value of each component of p', p'' and p''' on each piece.

    Attributes:
        first: Bound on p' [1], shape (n, 3).
        second: Bound on p'' [1/mm], shape (n, 3).
        third: Bound on p''' [1/mm^2], shape (n, 3).
    """

    first: FloatArray
    second: FloatArray
    third: FloatArray


def bound_curve(curve: Curve) -> CurveBounds:
    """Bound the derivatives of every piece: by Bernstein coefficients, or by an arc's radius.

    A helix adds its constant advance to the first derivative.
    """
    return CurveBounds(*bound_derivatives(curve, 3))


def bound_derivatives(curve: Curve, highest: int) -> list[FloatArray]:
    """Bound the derivatives 1 to ``highest`` of every piece, (n, 3) each [mm per mm^order]."""
    bounds = []
    powers = curve.coefficients
    arcs = curve.rates > 0.0
    radius = np.hypot(powers[arcs, 1], powers[arcs, 2])
    rate = curve.rates[arcs, None]
    advance = np.zeros_like(radius)
    if powers.shape[1] > 3:
        advance = np.abs(powers[arcs, 3]) / curve.spans[arcs, None]
    for order in range(1, highest + 1):
        powers = powers[:, 1:] * np.arange(1, powers.shape[1])[:, None] / curve.spans[:, None, None]
        if powers.shape[1] == 0:
            powers = np.zeros((curve.count, 1, 3))
        bound = np.abs(bernstein(powers.shape[1] - 1) @ powers).max(axis=1)
        bound[arcs] = radius * rate**order + (advance if order == 1 else 0.0)
        bounds.append(bound * _ROUNDING)
    return bounds


@cache
def bernstein(degree: int) -> FloatArray:
    """Return the matrix from powers of u to Bernstein coefficients on [0, 1]."""
    rows = range(degree + 1)
    return read_only(np.array([[comb(i, j) / comb(degree, j) for j in rows] for i in rows]))
