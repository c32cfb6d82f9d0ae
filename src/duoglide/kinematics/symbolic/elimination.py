"""Elimination of variables by resultants, in the coordinates that make it short.

Nothing changes when everything moves along y, so two combinations of the carriages are enough, and
x and z count best from B3: the reduced variables are X = x - d + b, Z = z - l8 - l1,
B = yA2 - yA1 - l3, W = yA1 + yA2 - 2 yA3 and y, taken from the middle of the carriages 1 and 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from duoglide.kinematics.symbolic.dimensions import Dimensions, require_sympy
from duoglide.kinematics.symbolic.families import Family
from duoglide.kinematics.symbolic.loops import LoopEquations


@dataclass(frozen=True, slots=True)
class Reduced:
    """Variables of the reduced system: h is the rise of the legs, c and s belong to beta."""

    X: Any
    Z: Any
    B: Any
    W: Any
    y: Any
    c: Any
    s: Any
    h: Any

    @classmethod
    def symbols(cls) -> Reduced:
        """Return fresh symbols."""
        return cls(*require_sympy().symbols("X Z B W y cos_beta sin_beta h"))

    @property
    def all(self) -> frozenset[Any]:
        """Every variable."""
        return frozenset((self.X, self.Z, self.B, self.W, self.y, self.c, self.s, self.h))


def reduced_system(loops: LoopEquations, v: Reduced, k: Any, e: Any) -> tuple[Any, ...]:
    """Rewrite the loop equations in the reduced variables.

    Args:
        loops: The loop equations.
        v: The reduced variables.
        k: Value or symbol for b - d.
        e: Value or symbol for l4 + l7 - l8.
    """
    sympy = require_sympy()
    g: Dimensions = loops.dimensions
    x, y, z = loops.position
    yA1, yA2, yA3 = loops.carriages
    half = (v.B + g.l3) / sympy.Integer(2)
    change = {
        x: v.X + g.d - g.b,
        z: v.Z + g.l8 + g.l1,
        y: v.y,
        yA1: -half,
        yA2: half,
        yA3: -v.W / sympy.Integer(2),
    }
    offsets = {g.b: g.d + k, g.l7: e + g.l8 - g.l4} if getattr(g.b, "is_Symbol", False) else {}
    plane, circle, leg1, leg2, strut = (
        sympy.expand(equation.subs(change, simultaneous=True).subs(offsets))
        for equation in loops.equations
    )
    rise = v.Z - e - g.l6 * v.s
    leg = sympy.expand((v.y + v.B / 2) ** 2 + v.h**2 - g.l2**2)
    if sympy.expand(leg.subs(v.h, rise) - leg1) != 0:  # the loop equations are the authority
        raise ArithmeticError("the reduced leg equation is not the loop equation")
    return plane, circle, rise - v.h, leg, sympy.expand(leg1 - leg2), strut


def conditions(v: Reduced) -> dict[Family, Any]:
    """Return each family's condition in the reduced variables."""
    return {
        Family.LEGS_VERTICAL: v.y + v.B / 2,
        Family.STRUT: v.y + v.W / 2,
        Family.LEGS_PARALLEL: v.B,
        Family.LEGS_FLAT: v.h,
        Family.ARM_STRUT: v.X * v.s + v.Z * v.c,
        Family.ARM_FLAT: v.s,
    }


def eliminate(polynomials: Sequence[Any], order: Sequence[Any], v: Reduced) -> tuple[Any, ...]:
    """Eliminate the variables ``order`` one after the other.

    For each variable the polynomial of least degree in it is the pivot, and its resultants with the
    others go on, square-free, and reduced by cos^2 + sin^2 = 1.

    Returns:
        Irreducible factors of what is left; spurious ones among them.
    """
    sympy = require_sympy()
    circle = v.c**2 + v.s**2 - 1
    left = [sympy.expand(polynomial) for polynomial in polynomials]
    factored: dict[Any, list[Any]] = {}
    for variable in order:
        active = [p for p in left if p.has(variable)]
        left = [p for p in left if not p.has(variable)]
        active.sort(key=lambda p: (sympy.degree(p, variable), sympy.count_ops(p)))
        for other in active[1:]:
            result = sympy.resultant(active[0], other, variable)
            if result.has(v.c) and sympy.expand(result - circle) != 0:
                result = sympy.rem(result, circle, v.c)
            if factors := _factors(result, v):
                product = sympy.expand(sympy.prod(factors))
                factored[product] = factors
                left.append(product)
    return tuple(dict.fromkeys(f for p in left for f in (factored.get(p) or _factors(p, v))))


def _factors(polynomial: Any, v: Reduced) -> list[Any]:
    """Return the irreducible factors that hold a variable."""
    if polynomial == 0:
        return []
    found = require_sympy().factor_list(polynomial)[1]
    return [factor for factor, _ in found if factor.free_symbols & v.all]
