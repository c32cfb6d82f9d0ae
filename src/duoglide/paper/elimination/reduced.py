"""The loop equations in the coordinates that make elimination short.

Nothing changes when everything moves along y, so two combinations of the carriages are enough, and
x and z count best from B3: the reduced variables are X = x - d + b, Z = z - l8 - l1,
B = yA2 - yA1 - l3, W = yA1 + yA2 - 2 yA3 and y, taken from the middle of the carriages 1 and 2. In
the carriages' space B and W come with the lengths as H = l2^2 - B^2/4 and Q = l9^2 - W^2/4, the
squares of the legs' rise and of the strut's projection, which count as variables of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from duoglide.paper.elimination.dimensions import Dimensions, Expression, require_sympy
from duoglide.paper.elimination.families import Family
from duoglide.paper.elimination.loops import LoopEquations


@dataclass(frozen=True, slots=True)
class Reduced:
    """Variables of the reduced system: h is the rise of the legs, c and s belong to beta."""

    X: Expression
    Z: Expression
    B: Expression
    W: Expression
    y: Expression
    c: Expression
    s: Expression
    h: Expression
    H: Expression
    Q: Expression

    @classmethod
    def symbols(cls) -> Reduced:
        """Return fresh symbols."""
        return cls(*require_sympy().symbols("X Z B W y cos_beta sin_beta h H Q"))

    @property
    def all(self) -> tuple[Expression, ...]:
        """Every variable."""
        return tuple(getattr(self, name) for name in Reduced.__slots__)

    def squares(self, g: Dimensions) -> tuple[Expression, Expression]:
        """Return what H and Q stand for."""
        return g.l2**2 - self.B**2 / 4, g.l9**2 - self.W**2 / 4


@lru_cache(maxsize=8)
def reduced_system(
    loops: LoopEquations, v: Reduced, k: Expression, e: Expression
) -> tuple[Expression, ...]:
    """Rewrite the loop equations in the reduced variables, without H and Q.

    Args:
        loops: The loop equations.
        v: The reduced variables.
        k: Value or symbol for b - d.
        e: Value or symbol for l4 + l7 - l8.

    Returns:
        Arm in its plane, cos^2 + sin^2 = 1, rise of the legs, first leg, its difference from the
        second, strut.
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
    offsets = {g.b: g.d + k, g.l7: e + g.l8 - g.l4} if g.symbolic else {}
    plane, circle, leg1, leg2, strut = (
        sympy.expand(equation.subs(change, simultaneous=True).subs(offsets))
        for equation in loops.equations
    )
    rise = v.Z - e - g.l6 * v.s
    leg = sympy.expand((v.y + v.B / 2) ** 2 + v.h**2 - g.l2**2)
    if sympy.expand(leg.subs(v.h, rise) - leg1) != 0:  # the loop equations are the authority
        raise ArithmeticError("the reduced leg equation is not the loop equation")
    return plane, circle, rise - v.h, leg, sympy.expand(leg1 - leg2), strut


def with_squares(
    equations: tuple[Expression, ...], v: Reduced, g: Dimensions
) -> tuple[Expression, ...]:
    """Bring H and Q into the reduced system; what each stands for is added, less its symbol."""
    *others, leg, difference, strut = equations
    H, Q = v.squares(g)
    expand = require_sympy().expand
    return *others, expand(leg + H - v.H), difference, expand(strut + Q - v.Q)


def conditions(v: Reduced) -> dict[Family, Expression]:
    """Return each family's condition in the reduced variables."""
    return {
        Family.LEGS_VERTICAL: v.y + v.B / 2,
        Family.STRUT: v.y + v.W / 2,
        Family.LEGS_PARALLEL: v.B,
        Family.LEGS_FLAT: v.h,
        Family.ARM_STRUT: v.X * v.s + v.Z * v.c,
        Family.ARM_FLAT: v.s,
    }
