"""Truncated Taylor arithmetic: a value and its derivatives by one parameter, column by column."""

from __future__ import annotations

from math import comb
from typing import TypeAlias

import numpy as np

from duoglide.arrays import FloatArray

Jet: TypeAlias = list[FloatArray]  # value, first derivative, second, ...


def shifted(jet: Jet, origin: float) -> Jet:
    """Return ``jet`` measured from ``origin``."""
    return [jet[0] - origin, *jet[1:]]


def height(value: FloatArray, *sides: Jet) -> Jet:
    """Differentiate r = sqrt(L^2 - a^2 - b^2 ...) for a constant L.

    Leibniz' rule on r^2 + a^2 + b^2 ... = L^2, solved for the highest derivative of r.

    Args:
        value: r itself, above 0.
        sides: The jets a, b, ..., all of one order.

    Returns:
        The jet of r, of the order of the sides.
    """
    order = len(sides[0])
    jet = [value]
    if order == 1:
        return jet
    scale = -1.0 / value
    for n in range(1, order):
        total = sum((_half_of_square(side, n) for side in sides), start=np.zeros_like(value))
        total = total + _half_of_square([*jet, np.zeros_like(value)], n)
        jet.append(scale * total)
    return jet


def _half_of_square(jet: Jet, n: int) -> FloatArray:
    """Return half the n-th derivative of the square of ``jet``."""
    total = np.zeros_like(jet[0])
    for j in range((n + 1) // 2):
        total = total + comb(n, j) * jet[j] * jet[n - j]
    if n % 2 == 0:
        total = total + 0.5 * comb(n, n // 2) * jet[n // 2] ** 2
    return total
