"""Resultants and factors of elements of a polynomial ring (``sympy.polys.rings``).

Polynomials are kept as sympy's sparse ones all along: expressions would be expanded and collected
again at every step. The pivots of an elimination here are of degree one or two, for which the
resultant has a closed form.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

Polynomial: TypeAlias = Any  # an element of a ring of sympy, or one of its generators
Ring: TypeAlias = Any


def coefficients(polynomial: Polynomial, variable: Polynomial) -> list[Polynomial]:
    """Return the coefficients of the powers of a generator, from the zeroth."""
    ring = polynomial.ring
    index = ring.gens.index(variable)
    found: list[dict[tuple[int, ...], Polynomial]] = [
        {} for _ in range(polynomial.degree(variable) + 1)
    ]
    for exponents, number in polynomial.terms():
        found[exponents[index]][(*exponents[:index], 0, *exponents[index + 1 :])] = number
    return [ring.from_dict(entry) for entry in found]


def resultant(pivot: Polynomial, other: Polynomial, variable: Polynomial) -> Polynomial:
    """Eliminate a generator from two polynomials.

    Args:
        pivot: Of degree one or two in the generator.
        other: Of at least that degree.
        variable: The generator.

    Raises:
        ArithmeticError: The pivot is of another degree.
    """
    first, second = coefficients(pivot, variable), coefficients(other, variable)
    if len(first) == 2:
        root, scale = -first[0], first[1]
        n = len(second) - 1
        terms = (second[i] * power(root, i) * power(scale, n - i) for i in range(n + 1))
        return sum(terms, pivot.ring.zero)
    if len(first) == 3:
        return _with_quadratic(first, second, pivot.ring)
    raise ArithmeticError(f"no pivot of degree one or two in {variable}")


def _with_quadratic(pivot: list[Polynomial], other: list[Polynomial], ring: Ring) -> Polynomial:
    """Multiply the values of a polynomial at both roots of a v^2 + b v + c.

    At a root a^(i-1) v^i = A v + C, so that a^(n-1) times the polynomial is U v + V, and the
    product over both roots follows from their sum -b/a and their product c/a.
    """
    c, b, a = pivot
    n = len(other) - 1
    A, C = [ring.zero, ring.one], [ring.one, ring.zero]
    for i in range(1, n):
        A.append(a * C[i] - b * A[i])
        C.append(-c * A[i])
    scales = [power(a, n - max(i, 1)) for i in range(n + 1)]
    U = sum((p * s * q for p, s, q in zip(other, scales, A, strict=True)), ring.zero)
    V = sum((p * s * q for p, s, q in zip(other, scales, C, strict=True)), ring.zero)
    return (a * V * V - b * U * V + c * U * U).exquo(power(a, n - 1))


def on_circle(polynomial: Polynomial, cosine: Polynomial, sine: Polynomial) -> Polynomial:
    """Replace the squares of the cosine by 1 - sin^2."""
    ring = polynomial.ring
    rest = ring.one - sine * sine
    terms = enumerate(coefficients(polynomial, cosine))
    powers = ((entry * power(rest, i // 2), i % 2) for i, entry in terms)
    return sum((entry * cosine if odd else entry for entry, odd in powers), ring.zero)


def factors_with(polynomial: Polynomial, variables: Iterable[Polynomial]) -> list[Polynomial]:
    """Return the irreducible factors in which one of the generators occurs, each once."""
    wanted = tuple(variables)
    if polynomial == 0:
        return []
    return [f for f, _ in polynomial.factor_list()[1] if holds(f, wanted)]


def holds(polynomial: Polynomial, variables: Iterable[Polynomial]) -> bool:
    """Whether one of the generators occurs."""
    return any(polynomial.degree(variable) > 0 for variable in variables)


def power(polynomial: Polynomial, exponent: int) -> Polynomial:
    """Return a power; 0 to the power of 0 is 1, which sympy's rings refuse."""
    return polynomial**exponent if exponent else polynomial.ring.one
