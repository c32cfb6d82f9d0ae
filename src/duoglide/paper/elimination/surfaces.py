"""Implicit polynomials of the singular surfaces, in the workspace and in the carriages' space."""

from __future__ import annotations

from cmath import sqrt
from dataclasses import dataclass
from functools import reduce
from operator import mul

from duoglide.arrays import FloatArray
from duoglide.machine import Geometry
from duoglide.paper.elimination.dimensions import Dimensions, Expression, require_sympy
from duoglide.paper.elimination.families import Family
from duoglide.paper.elimination.loops import LoopEquations, loop_equations
from duoglide.paper.elimination.resultants import eliminate
from duoglide.paper.elimination.ring import Reduction, Space
from duoglide.paper.elimination.samples import Shape, family_points

TYPICAL = (45.0, 25.0, 160.0, 180.0, 300.0)  # k, e, l2, l6, l9 [mm], where they are symbols


@dataclass(frozen=True, slots=True)
class SpuriousFactor:
    """A factor that elimination leaves, and that is not part of the surface.

    Attributes:
        polynomial: The factor.
        meaning: Where it comes from.
    """

    polynomial: Expression
    meaning: str


@dataclass(frozen=True, slots=True)
class Surface:
    """The algebraic closure of one family's singular poses.

    Attributes:
        family: Which family.
        space: Workspace (a cylinder along y: a curve in x and z) or carriages.
        variables: x, z or yA1, yA2, yA3.
        factors: Irreducible polynomials; none where the family fills the whole space.
        degrees: Total degree of each factor in the variables.
        spurious: What was taken out.
    """

    family: Family
    space: Space
    variables: tuple[Expression, ...]
    factors: tuple[Expression, ...]
    degrees: tuple[int, ...]
    spurious: tuple[SpuriousFactor, ...]

    @property
    def polynomial(self) -> Expression:
        """Product of the factors; 0 where the family fills the whole space."""
        sympy = require_sympy()
        return reduce(mul, self.factors) if self.factors else sympy.Integer(0)

    def values(self, *coordinates: FloatArray) -> tuple[FloatArray, ...]:
        """Evaluate each factor over arrays of the coordinates [mm]; numeric dimensions only."""
        sympy = require_sympy()
        return tuple(
            sympy.lambdify(self.variables, factor, "numpy")(*coordinates) for factor in self.factors
        )


def surfaces(geometry: Geometry | None = None) -> tuple[Surface, ...]:
    """Eliminate the polynomials of every singularity family (Section 3.3).

    Args:
        geometry: Numeric dimensions; None: the paper's symbols.

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
    reduction = Reduction.of(loops, space)
    found = [
        part
        for factor in eliminate(reduction.system(family))
        for part in reduction.irreducible(factor)
    ]
    found = list(dict.fromkeys(found))
    true = [factor for factor in found if _belongs(factor, family, reduction)]
    x, _, z = loops.position
    return Surface(
        family=family,
        space=space,
        variables=(x, z) if space is Space.WORKSPACE else loops.carriages,
        factors=tuple(reduction.expression(factor) for factor in true),
        degrees=tuple(reduction.degree(factor) for factor in true),
        spurious=tuple(
            SpuriousFactor(reduction.expression(factor), _meaning(factor, reduction))
            for factor in found
            if factor not in true
        ),
    )


def _belongs(factor: Expression, family: Family, reduction: Reduction) -> bool:
    """Whether a factor vanishes on some component of the family's surface."""
    shape = _shape(reduction)
    points = family_points(family, shape)
    return any(_vanishes(reduction.terms(factor, point, shape)) for point in points)


def _vanishes(terms: list[complex]) -> bool:
    """Whether a sum is zero, up to the rounding of its terms."""
    return abs(sum(terms)) <= 1e-9 * max(abs(term) for term in terms)


def _shape(reduction: Reduction) -> Shape:
    return Shape(*(TYPICAL if reduction.symbolic else reduction.lengths))


def _meaning(factor: Expression, reduction: Reduction) -> str:
    """Say where a spurious factor comes from."""
    names = reduction.names(factor)
    if names == {"B"} and reduction.degree(factor) == 1:
        return (
            "yA2 - yA1 - l3 = 0: there the difference of the two leg equations no longer fixes y"
            " (legs parallel)"
        )
    if names <= {"B", "H"}:
        shape = _shape(reduction)
        level = {"X": 0j, "Z": 0j, "B": 2.0 * sqrt(shape.l2**2 - shape.e**2), "W": 0j}
        if _vanishes(reduction.terms(factor, level, shape)):
            return "F3 = 0: there the case-2 condition, the pivot, loses its term in cos(beta)"
        return "F1^2 + F3^2 = 0: there a pivot loses its term in sin(beta)^2; no real pose"
    return "an extraneous root of a resultant: no point of the surface lies on it"
