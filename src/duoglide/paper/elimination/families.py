"""The singularity families, found as factors of the Jacobian determinants."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from duoglide.paper.elimination.dimensions import Expression, require_sympy
from duoglide.paper.elimination.loops import LoopEquations


class Family(Enum):
    """A singularity family; the value is its field in ``Margins``."""

    LEGS_VERTICAL = "legs_vertical"
    STRUT = "strut"
    LEGS_PARALLEL = "legs_parallel"
    LEGS_FLAT = "legs_flat"
    ARM_STRUT = "arm_strut"
    ARM_FLAT = "arm_flat"


@dataclass(frozen=True, slots=True)
class Determinants:
    """Factors of the two determinants, constants and dimensions left out.

    Attributes:
        parallel: Of the derivative of the loops by position, cos(beta) and sin(beta): where the
            platform can move although the carriages are held.
        serial: Of the derivative by carriages, cos(beta) and sin(beta): where the carriages, or the
            sign v, are not determined by the platform.
    """

    parallel: tuple[Expression, ...]
    serial: tuple[Expression, ...]


def singularities(loops: LoopEquations) -> Determinants:
    """Factor det A and det B of Eq. 16, the angle beta kept as a variable.

    Kept so, cot(beta) brings no quotient, and the families that [Shen2021]_ misses appear: legs
    flat as a factor of the first, arm flat as a factor of the second.

    Raises:
        ConfigError: sympy is not installed.
    """
    sympy = require_sympy()
    angle = (loops.cosine, loops.sine)
    variables = {*loops.position, *loops.carriages, *angle}
    system = sympy.Matrix(loops.equations)

    def factors(unknowns: tuple[Expression, ...]) -> tuple[Expression, ...]:
        determinant = system.jacobian(unknowns).det(method="berkowitz")
        found = (factor for factor, _ in sympy.factor_list(determinant)[1])
        return tuple(factor for factor in found if factor.free_symbols & variables)

    return Determinants(
        parallel=factors((*loops.position, *angle)),
        serial=factors((*loops.carriages, *angle)),
    )
