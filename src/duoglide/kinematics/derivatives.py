"""The derivatives of the closed form, which come down to those of one root: r r = L^2 - a^2 - b^2.

Leibniz' rule on that product, solved for the highest derivative of r, gives them. It stands here
three times, because it is asked for in three ways. ``root_jet`` is the first three for one pose,
and ``root_rates`` two of them: the stream has no time for arrays, and the search for a timing
compiles them. ``root_jets`` is for many poses, by whole columns, and for as many orders as are
asked for. ``root_bounds`` and ``root_jet_bounds`` are those two with the absolute value of each
term: they bound the derivatives where a, b and theirs are known only within bounds. Tests hold
them together.
"""

from __future__ import annotations

from math import comb, sqrt
from typing import TypeAlias

from duoglide.arrays import FloatArray
from duoglide.kinematics.constants import PoseConstants

Jet: TypeAlias = tuple[float, float, float, float]  # a value and three derivatives
Three: TypeAlias = tuple[float, float, float]  # three of them, the value among them or not
ArrayJet: TypeAlias = list[FloatArray]  # values, first derivatives, second, ...


def root_rates(r: float, a: Three, b: Three) -> tuple[float, float]:
    """Differentiate r = sqrt(L^2 - a^2 - b^2) twice, from r r' = -(a a' + b b').

    Args:
        r: The root, above 0.
        a: A value and two derivatives.
        b: Likewise.
    """
    r1 = -(a[0] * a[1] + b[0] * b[1]) / r
    return r1, -(a[1] * a[1] + a[0] * a[2] + b[1] * b[1] + b[0] * b[2] + r1 * r1) / r


def root_jet(r: float, a: Jet, b: Jet) -> Jet:
    """Differentiate r = sqrt(L^2 - a^2 - b^2) three times."""
    r1, r2 = root_rates(r, (a[0], a[1], a[2]), (b[0], b[1], b[2]))
    r3 = -(3.0 * (a[1] * a[2] + b[1] * b[2] + r1 * r2) + a[0] * a[3] + b[0] * b[3]) / r
    return r, r1, r2, r3


def root_bounds(low: float, square: tuple[float, float], one: Three, other: Three) -> Three:
    """Bound three derivatives of a root r >= low of L^2 - a^2 - b^2: ``root_jet``, every term +.

    Args:
        low: Least r.
        square: Bounds on a and b.
        one: Bounds on the derivatives of a.
        other: Bounds on those of b.
    """
    (a, b), (a1, a2, a3), (b1, b2, b3) = square, one, other
    r1 = (a * a1 + b * b1) / low
    r2 = (a1 * a1 + a * a2 + b1 * b1 + b * b2 + r1 * r1) / low
    r3 = (3.0 * (a1 * a2 + b1 * b2 + r1 * r2) + a * a3 + b * b3) / low
    return r1, r2, r3


def shift(jet: ArrayJet, origin: float) -> ArrayJet:
    """Measure ``jet`` from ``origin``."""
    return [jet[0] - origin, *jet[1:]]


def root_jets(value: FloatArray, *sides: ArrayJet) -> ArrayJet:
    """Differentiate r = sqrt(L^2 - a^2 - b^2 ...), L constant, for arrays and to any order.

    Leibniz' rule on r^2 + a^2 + b^2 ... = L^2, solved for the highest derivative of r.

    Args:
        value: r itself, above 0.
        sides: The jets a, b, ..., all of one order.

    Returns:
        The jet of r, of the order of the sides.
    """
    if len(sides[0]) == 1:
        return [value]  # which may be 0: on the edge of reach only the derivatives are infinite
    return _solve([value], -1.0 / value, sides)


def root_jet_bounds(low: FloatArray, *sides: ArrayJet) -> ArrayJet:
    """Bound the derivatives of a root r >= low: ``root_jets``, every term +, to any order.

    Args:
        low: Least r, above 0.
        sides: Bounds on a, b, ... and their derivatives, all of one order.

    Returns:
        ``low``, and bounds on the derivatives of r.
    """
    return _solve([low], 1.0 / low, sides)


def _solve(jet: ArrayJet, scale: FloatArray, sides: tuple[ArrayJet, ...]) -> ArrayJet:
    """Append to the value of a root its derivatives, one after the other."""
    for n in range(1, len(sides[0])):
        total = _half_of_square(sides[0], n)
        for side in sides[1:]:
            total = total + _half_of_square(side, n)
        if n > 1:  # without r r^(n), which is what is sought
            total = total + _half_of_square(jet, n, 1)
        jet.append(scale * total)
    return jet


def _half_of_square(jet: ArrayJet, n: int, first: int = 0) -> FloatArray:
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


def carriage_jets(x: Jet, y: Jet, z: Jet, k: PoseConstants) -> tuple[Jet, Jet, Jet]:
    """Carry a position and three derivatives through the closed form.

    Beyond reach, in plain floats, a square root or a quotient fails; compiled, the third derivative
    of carriage 1 or 3 is not finite.
    """
    l6, l2, l9, half, w1, w2, w3 = k.l6, k.l2, k.l9, k.half_l3, k.w1, k.w2, k.w3
    u, X, Z = x[0] - k.cx, x[0] - k.xb, z[0] - k.zb
    none = (0.0, 0.0, 0.0, 0.0)
    A = root_jet(k.v * sqrt((l6 - u) * (l6 + u)), (u, x[1], x[2], x[3]), none)
    h = (z[0] - k.base - A[0], z[1] - A[1], z[2] - A[2], z[3] - A[3])
    p = root_jet(sqrt((l2 - h[0]) * (l2 + h[0])), h, none)
    across, up = (X, x[1], x[2], x[3]), (Z, z[1], z[2], z[3])
    q = root_jet(sqrt(l9 * l9 - (X * X + Z * Z)), across, up)
    return (
        (y[0] - half + w1 * p[0], y[1] + w1 * p[1], y[2] + w1 * p[2], y[3] + w1 * p[3]),
        (y[0] + half + w2 * p[0], y[1] + w2 * p[1], y[2] + w2 * p[2], y[3] + w2 * p[3]),
        (y[0] + w3 * q[0], y[1] + w3 * q[1], y[2] + w3 * q[2], y[3] + w3 * q[3]),
    )
