"""From the loop equations to a polynomial ring, and from its elements back to the paper.

Every polynomial here is homogeneous in the lengths. With symbols for the dimensions the arm's
length is therefore taken for 1, one variable less to factor in, and put back afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import prod

from duoglide.paper.elimination.dimensions import Expression, require_sympy
from duoglide.paper.elimination.families import Family
from duoglide.paper.elimination.loops import LoopEquations
from duoglide.paper.elimination.polynomials import Polynomial, Ring, factors_with, holds
from duoglide.paper.elimination.reduced import (
    Reduced,
    conditions,
    reduced_system,
    with_squares,
)
from duoglide.paper.elimination.resultants import System
from duoglide.paper.elimination.samples import Shape

SOME = {"l2": 17, "l9": 31, "k": 5, "e": 3}  # any numbers: no identity hangs on them


class Space(Enum):
    """Where a surface lies."""

    WORKSPACE = "x, z"
    CARRIAGES = "yA1, yA2, yA3"


@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """The reduced variables of some loop equations, as generators of a polynomial ring.

    Attributes:
        loops: The loop equations.
        space: Where surfaces are sought.
        variables: The reduced variables, as symbols.
        offsets: b - d and l4 + l7 - l8, numbers or symbols.
        ring: Polynomials over the rationals in variables and dimensions.
    """

    loops: LoopEquations
    space: Space
    variables: Reduced
    offsets: tuple[Expression, Expression]
    ring: Ring

    @classmethod
    def of(cls, loops: LoopEquations, space: Space) -> Reduction:
        """Reduce loop equations."""
        sympy = require_sympy()
        g, variables = loops.dimensions, Reduced.symbols()
        offsets = sympy.symbols("k e") if g.symbolic else (g.half_offset, g.lift)
        dimensions = (g.l2, g.l9, *offsets, g.l6) if g.symbolic else ()
        ring = sympy.polys.rings.PolyRing((*variables.all, *dimensions), sympy.QQ)
        return cls(loops, space, variables, offsets, ring)

    @property
    def symbolic(self) -> bool:
        """Whether the dimensions are symbols."""
        return self.loops.dimensions.symbolic

    @property
    def lengths(self) -> tuple[float, ...]:
        """Return k, e, l2, l6 and l9 as numbers [mm]."""
        g = self.loops.dimensions
        return tuple(float(value) for value in (*self.offsets, g.l2, g.l6, g.l9))

    def system(self, family: Family) -> System:
        """Return the equations of a family's surface."""
        g, v = self.loops.dimensions, self.variables
        equations = reduced_system(self.loops, v, *self.offsets)
        order: tuple[Expression, ...] = (v.W, v.B, v.y, v.h, v.c, v.s)
        kept: tuple[Expression, ...] = (v.X, v.Z)
        if self.space is Space.CARRIAGES:
            equations = with_squares(equations, v, g)
            order, kept = (v.y, v.X, v.Z, v.c, v.s, v.h), (v.B, v.W, v.H, v.Q)
        polynomials = [
            self.ring.from_expr(equation.subs(g.l6, 1) if self.symbolic else equation)
            for equation in (conditions(v)[family], *equations)
        ]
        return System(
            polynomials=tuple(polynomials),
            order=self._generators(order),
            kept=self._generators(kept),
            cosine=self.ring(v.c),
            sine=self.ring(v.s),
        )

    def irreducible(self, factor: Polynomial) -> list[Polynomial]:
        """Split a factor that is irreducible in H and Q, where it is not in B and W.

        What stays in one piece with some numbers for the dimensions, its degree kept, cannot come
        to pieces with symbols: those would be pieces with the numbers too.
        """
        v = self.variables
        H, Q, B, W = self._generators((v.H, v.Q, v.B, v.W))
        if not holds(factor, (H, Q)):
            return [factor]
        squares = [self.ring.from_expr(square) for square in v.squares(self.loops.dimensions)]
        whole = factor.compose(list(zip((H, Q), squares, strict=True)))
        if self.symbolic:
            dimensions = [
                (self.ring(require_sympy().Symbol(name)), value) for name, value in SOME.items()
            ]
            example = whole.subs(dimensions)
            pieces = factors_with(example, (B, W))
            if len(pieces) == 1 and all(pieces[0].degree(x) == whole.degree(x) for x in (B, W)):
                return [factor]
        return factors_with(whole, (B, W))

    def expression(self, factor: Polynomial) -> Expression:
        """Return a factor in the paper's variables, expanded where the dimensions are numbers."""
        sympy = require_sympy()
        g, v = self.loops.dimensions, self.variables
        x, _, z = self.loops.position
        yA1, yA2, yA3 = self.loops.carriages
        back = {
            v.X: x - g.d + g.b,
            v.Z: z - g.l8 - g.l1,
            v.B: yA2 - yA1 - g.l3,
            v.W: yA1 + yA2 - 2 * yA3,
        }
        H, Q = (square.subs(back, simultaneous=True) for square in v.squares(g))
        back |= {v.H: H, v.Q: Q}
        if self.symbolic:
            back |= dict(zip(self.offsets, (g.half_offset, g.lift), strict=True))
            factor = self._homogeneous(factor)
        result = factor.as_expr(*(back.get(symbol, symbol) for symbol in self.ring.symbols))
        if self.symbolic:
            return result
        variables = [symbol for symbol in (x, z, yA1, yA2, yA3) if symbol in result.free_symbols]
        return sympy.Poly(result, *variables).primitive()[1].as_expr()

    def degree(self, factor: Polynomial) -> int:
        """Return the total degree in x and z, or in the carriages."""
        v = self.variables
        degrees = {v.X: 1, v.Z: 1, v.B: 1, v.W: 1, v.H: 2, v.Q: 2}
        each = [degrees.get(symbol, 0) for symbol in self.ring.symbols]
        return max(_dot(exponents, each) for exponents in factor.itermonoms())

    def names(self, factor: Polynomial) -> set[str]:
        """Return the names of the reduced variables that occur in a factor."""
        v = self.variables
        return {s.name for s in v.all if factor.degree(self.ring(s)) > 0}

    def terms(self, factor: Polynomial, point: dict[str, complex], shape: Shape) -> list[complex]:
        """Evaluate the terms of a factor at a point (X, Z, B, W)."""
        values = dict(point)
        values |= {"k": shape.k, "e": shape.e, "l2": shape.l2, "l6": shape.l6, "l9": shape.l9}
        values["H"] = shape.l2**2 - point["B"] ** 2 / 4
        values["Q"] = shape.l9**2 - point["W"] ** 2 / 4
        each = [values.get(symbol.name, 0.0) for symbol in self.ring.symbols]
        whole = self._homogeneous(factor) if self.symbolic else factor
        return [
            complex(number) * prod(x**n for x, n in zip(each, exponents, strict=True) if n)
            for exponents, number in whole.terms()
        ]

    def _generators(self, symbols: tuple[Expression, ...]) -> tuple[Polynomial, ...]:
        return tuple(self.ring(symbol) for symbol in symbols)

    def _homogeneous(self, factor: Polynomial) -> Polynomial:
        """Put back the arm's length, which is the last generator; make the numbers whole."""
        v = self.variables
        lengths = {v.c: 0, v.s: 0, v.H: 2, v.Q: 2}
        each = [lengths.get(symbol, 1) for symbol in self.ring.symbols]
        found = {exponents: _dot(exponents, each) for exponents in factor.itermonoms()}
        degree = max(found.values())
        whole = self.ring.from_dict(
            {(*m[:-1], degree - found[m]): number for m, number in factor.terms()}
        )
        return whole.clear_denoms()[1].primitive()[1]


def _dot(exponents: tuple[int, ...], weights: list[int]) -> int:
    return sum(n * weight for n, weight in zip(exponents, weights, strict=True))
