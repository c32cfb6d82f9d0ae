"""Truncated Taylor arithmetic: a value and its derivatives by one parameter, column by column."""

from __future__ import annotations

from math import comb
from typing import TypeAlias

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
        total = _half_of_square(sides[0], n)
        for side in sides[1:]:
            total = total + _half_of_square(side, n)
        if n > 1:  # without r r^(n), which is what is sought
            total = total + _half_of_square(jet, n, 1)
        jet.append(scale * total)
    return jet


def _half_of_square(jet: Jet, n: int, first: int = 0) -> FloatArray:
    """Return half the n-th derivative, n > 0, of the square of ``jet``, from a term of it on."""
    terms = [
        comb(n, j) * jet[j] * jet[n - j] if j else jet[0] * jet[n]
        for j in range(first, (n + 1) // 2)
    ]
    if n % 2 == 0:
        terms.append(0.5 * comb(n, n // 2) * jet[n // 2] ** 2)
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total
