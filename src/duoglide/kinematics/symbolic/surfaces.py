"""Implicit polynomials of the singular surfaces, in the workspace and in the carriages' space."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import reduce
from operator import mul
from typing import Any

from duoglide.arrays import FloatArray
from duoglide.kinematics.symbolic.dimensions import Dimensions, require_sympy
from duoglide.kinematics.symbolic.elimination import (
    Reduced,
    conditions,
    eliminate,
    reduced_system,
)
from duoglide.kinematics.symbolic.families import Family
from duoglide.kinematics.symbolic.loops import LoopEquations, loop_equations
from duoglide.kinematics.symbolic.samples import Shape, family_points
from duoglide.machine import Geometry


class Space(Enum):
    """Where a surface lies."""

    WORKSPACE = "x, z"
    CARRIAGES = "yA1, yA2, yA3"


@dataclass(frozen=True, slots=True)
class SpuriousFactor:
    """A factor that elimination leaves, and that is not part of the surface.

    Attributes:
        polynomial: The factor.
        meaning: Where it comes from.
    """

    polynomial: Any
    meaning: str


@dataclass(frozen=True, slots=True)
class Surface:
    """The algebraic closure of one family's singular poses.

    Attributes:
        family: Which family.
        space: Workspace (a cylinder along y: a curve in x and z) or carriages.
        variables: x, z or yA1, yA2, yA3.
        factors: Irreducible polynomials; none where the family fills the whole space.
        spurious: What was taken out.
    """

    family: Family
    space: Space
    variables: tuple[Any, ...]
    factors: tuple[Any, ...]
    spurious: tuple[SpuriousFactor, ...]

    @property
    def polynomial(self) -> Any:
        """Product of the factors; 0 where the family fills the whole space."""
        sympy = require_sympy()
        return reduce(mul, self.factors) if self.factors else sympy.Integer(0)

    @property
    def degrees(self) -> tuple[int, ...]:
        """Total degree of each factor in the variables."""
        sympy = require_sympy()
        return tuple(sympy.Poly(f, *self.variables).total_degree() for f in self.factors)

    def values(self, *coordinates: FloatArray) -> tuple[FloatArray, ...]:
        """Evaluate each factor over arrays of the coordinates [mm]; numeric dimensions only."""
        sympy = require_sympy()
        return tuple(
            sympy.lambdify(self.variables, factor, "numpy")(*coordinates) for factor in self.factors
        )


def surfaces(geometry: Geometry | None = None) -> tuple[Surface, ...]:
    """Eliminate the polynomials of every singularity family (Section 3.3).

    Args:
        geometry: Numeric dimensions; None: the paper's symbols (about ten times slower).

    Returns:
        One surface per family and space.

    Raises:
        ConfigError: sympy is not installed.
    """
    dimensions = Dimensions.symbols() if geometry is None else Dimensions.of(geometry)
    loops = loop_equations(dimensions)
    return tuple(surface(loops, family, space) for family in Family for space in Space)


def surface(loops: LoopEquations, family: Family, space: Space) -> Surface:
    """Eliminate the polynomial of one family in one space."""
    sympy = require_sympy()
    g = loops.dimensions
    v = Reduced.symbols()
    symbolic = getattr(g.b, "is_Symbol", False)
    k, e = sympy.symbols("k e") if symbolic else (g.half_offset, g.lift)
    equations = (conditions(v)[family], *reduced_system(loops, v, k, e))
    if space is Space.WORKSPACE:
        order = (v.W, v.B, v.y, v.h, v.c, v.s)
    else:
        order = (v.y, v.X, v.Z, v.c, v.s, v.h)
    factors = eliminate(equations, order, v)
    true = [factor for factor in factors if _belongs(factor, family, g, (k, e))]
    return Surface(
        family=family,
        space=space,
        variables=(loops.position[0], loops.position[2])
        if space is Space.WORKSPACE
        else loops.carriages,
        factors=tuple(_unreduced(factor, loops, v, (k, e)) for factor in true),
        spurious=tuple(
            SpuriousFactor(_unreduced(factor, loops, v, (k, e)), _meaning(factor, v))
            for factor in factors
            if factor not in true
        ),
    )


def _belongs(factor: Any, family: Family, g: Dimensions, offsets: tuple[Any, Any]) -> bool:
    """Whether a factor vanishes on some component of the family's surface."""
    numbers, shape = _numbers(factor, g, offsets)
    terms = factor.subs(numbers).expand().as_ordered_terms()
    sympy = require_sympy()
    names = [sympy.Symbol(name) for name in "XZBW"]
    evaluate = sympy.lambdify(names, terms, "numpy")
    for point in family_points(family, shape):
        values = evaluate(*(point[name] for name in "XZBW"))
        if abs(sum(values)) <= 1e-9 * max(abs(value) for value in values):
            return True
    return False


def _numbers(factor: Any, g: Dimensions, offsets: tuple[Any, Any]) -> tuple[dict[Any, Any], Shape]:
    """Return numbers for the dimensions that are symbols, and the shape that they make."""
    typical = (45, 25, 160, 180, 300)
    entries = (*offsets, g.l2, g.l6, g.l9)
    numbers = {
        entry: value
        for entry, value in zip(entries, typical, strict=True)
        if entry in factor.free_symbols
    }
    symbolic = getattr(g.l2, "is_Symbol", False)
    values = typical if symbolic else tuple(float(entry) for entry in entries)
    return numbers, Shape(*(float(value) for value in values))


def _unreduced(factor: Any, loops: LoopEquations, v: Reduced, offsets: tuple[Any, Any]) -> Any:
    """Return a factor in the paper's variables, expanded where the dimensions are numbers."""
    sympy = require_sympy()
    g = loops.dimensions
    x, _, z = loops.position
    yA1, yA2, yA3 = loops.carriages
    back = {
        v.X: x - g.d + g.b,
        v.Z: z - g.l8 - g.l1,
        v.B: yA2 - yA1 - g.l3,
        v.W: yA1 + yA2 - 2 * yA3,
    }
    back |= {offsets[0]: g.half_offset, offsets[1]: g.lift} if offsets[0].is_Symbol else {}
    result = factor.subs(back, simultaneous=True)
    if offsets[0].is_Symbol:
        return result
    variables = [symbol for symbol in (x, z, yA1, yA2, yA3) if symbol in result.free_symbols]
    return sympy.Poly(result, *variables).primitive()[1].as_expr()


def _meaning(factor: Any, v: Reduced) -> str:
    """Say where a spurious factor comes from."""
    if factor == v.B:
        return (
            "yA2 - yA1 - l3 = 0: there the difference of the two leg equations no longer fixes y"
            " (legs parallel)"
        )
    if not factor.has(v.W):
        name = "Z" if factor.has(v.Z) else "F3"
        return f"{name} = 0: there the case-2 condition, the pivot, loses its term in cos(beta)"
    return "an extraneous root of a resultant: no point of the surface lies on it"
