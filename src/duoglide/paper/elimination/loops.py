"""The loop equations, from the coordinates of the joints."""

from __future__ import annotations

from dataclasses import dataclass

from duoglide.paper.elimination.dimensions import Dimensions, Expression, require_sympy


@dataclass(frozen=True, slots=True)
class LoopEquations:
    """Polynomials that vanish where the links close, and their variables.

    Attributes:
        dimensions: Numbers or symbols.
        position: x, y, z of the platform.
        carriages: yA1, yA2, yA3.
        cosine: cos(beta), a variable of its own.
        sine: sin(beta), a variable of its own.
        equations: Arm in its plane (x of D2 is b), cos^2 + sin^2 = 1, then Eqs. 14 for the two legs
            and the strut.
    """

    dimensions: Dimensions
    position: tuple[Expression, Expression, Expression]
    carriages: tuple[Expression, Expression, Expression]
    cosine: Expression
    sine: Expression
    equations: tuple[Expression, Expression, Expression, Expression, Expression]


def loop_equations(dimensions: Dimensions) -> LoopEquations:
    """State Eqs. 13 and 14 from the coordinates of the joints of Section 2.3.3.

    Raises:
        ConfigError: sympy is not installed.
    """
    sympy = require_sympy()
    g = dimensions
    x, y, z = position = sympy.symbols("x y z")
    carriages = sympy.symbols("yA1 yA2 yA3")
    c, s = sympy.symbols("cos_beta sin_beta")
    E2 = sympy.Matrix([x + g.d, y, z - g.l7])
    C3 = sympy.Matrix([x - g.d, y, z - g.l8])
    D2 = E2 + g.l6 * sympy.Matrix([c, 0, -s])
    D1 = D2 - sympy.Matrix([0, 0, g.l4])
    half_coupler = sympy.Matrix([0, g.l3 / sympy.Integer(2), 0])
    B1, B2 = (sympy.Matrix([g.b, carriage, g.l1]) for carriage in carriages[:2])
    B3 = sympy.Matrix([-g.b, carriages[2], g.l1])
    in_plane = D2[0] - g.b
    links = (
        (D1 - half_coupler, B1, g.l2),
        (D1 + half_coupler, B2, g.l2),
        (C3, B3, g.l9),
    )

    def across(entry: Expression) -> Expression:
        """Drop what the arm's own equation says is zero: x of C1 and C2 is b."""
        return 0 if sympy.expand(entry - in_plane) == 0 else entry

    closures = []
    for top, foot, length in links:
        link = (top - foot).applyfunc(across)
        closures.append(sympy.expand(link.dot(link) - length**2))
    circle = c**2 + s**2 - 1
    return LoopEquations(g, position, carriages, c, s, (sympy.expand(in_plane), circle, *closures))
