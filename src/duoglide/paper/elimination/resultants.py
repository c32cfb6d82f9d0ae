"""Elimination of variables by resultants."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial, reduce
from operator import mul

from duoglide.paper.elimination.polynomials import (
    Polynomial,
    coefficients,
    factors_with,
    holds,
    on_circle,
    resultant,
)


@dataclass(frozen=True, slots=True, eq=False)
class System:
    """Equations in a polynomial ring over the rationals, and what to eliminate from them.

    Attributes:
        polynomials: Elements of the ring; cos^2 + sin^2 - 1 is one of them.
        order: Generators to eliminate, in turn.
        kept: Generators that the result is in; the others are dimensions.
        cosine: The generator cos(beta).
        sine: The generator sin(beta).
    """

    polynomials: tuple[Polynomial, ...]
    order: tuple[Polynomial, ...]
    kept: tuple[Polynomial, ...]
    cosine: Polynomial
    sine: Polynomial


def eliminate(system: System) -> tuple[Polynomial, ...]:
    """Eliminate one generator after the other.

    For each the polynomial of least degree in it is the pivot, one with a constant first
    coefficient before others, which bring that in as a factor. Its resultants with the others go
    on, square-free, and reduced by cos^2 + sin^2 = 1. A factor with nothing left to eliminate
    belongs to the result at once.

    Returns:
        Irreducible factors of what is left; spurious ones among them.
    """
    left, found = list(system.polynomials), []
    circle = system.cosine**2 + system.sine**2 - 1
    for number, variable in enumerate(system.order):
        later = system.order[number + 1 :]
        active = [p for p in left if p.degree(variable) > 0]
        left = [p for p in left if p.degree(variable) <= 0]
        active.sort(key=partial(_as_pivot, variable=variable))
        for other in active[1:]:
            result = resultant(active[0], other, variable)
            if result not in (0, circle):
                result = on_circle(result, system.cosine, system.sine)
            factors = factors_with(result, (*later, *system.kept))
            found += [factor for factor in factors if not holds(factor, later)]
            if unfinished := [factor for factor in factors if holds(factor, later)]:
                left.append(reduce(mul, unfinished))
    found += [factor for p in left for factor in factors_with(p, system.kept)]
    return tuple(dict.fromkeys(found))


def _as_pivot(polynomial: Polynomial, variable: Polynomial) -> tuple[int, bool, int]:
    """Return what puts the best pivots first."""
    first = coefficients(polynomial, variable)[-1]
    return polynomial.degree(variable), not first.is_ground, len(polynomial)
