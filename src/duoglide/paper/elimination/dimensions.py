"""Dimensions of the mechanism as exact numbers or as the paper's symbols."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

from duoglide.errors import ConfigError
from duoglide.machine import Geometry

Expression: TypeAlias = Any  # of sympy, whose types a checker cannot read


def require_sympy() -> Any:
    """Return the module sympy.

    Raises:
        ConfigError: It is not installed.
    """
    try:
        import sympy
    except ImportError as error:
        raise ConfigError(
            "symbolic derivations need sympy, which is not installed; pip install"
            " 'duoglide[symbolic]'"
        ) from error
    return sympy


@dataclass(frozen=True, slots=True)
class Dimensions:
    """The dimensions that enter the loops, as sympy expressions, under the paper's symbols."""

    b: Expression
    d: Expression
    l1: Expression
    l2: Expression
    l3: Expression
    l4: Expression
    l6: Expression
    l7: Expression
    l8: Expression
    l9: Expression

    @classmethod
    def symbols(cls) -> Dimensions:
        """Return every dimension as a symbol.

        Raises:
            ConfigError: sympy is not installed.
        """
        return cls(*require_sympy().symbols("b d l1 l2 l3 l4 l6 l7 l8 l9"))

    @classmethod
    def of(cls, geometry: Geometry) -> Dimensions:
        """Return the dimensions of ``geometry`` as exact rationals of their decimal digits.

        Raises:
            ConfigError: sympy is not installed.
        """
        sympy = require_sympy()
        values = (
            geometry.rail_half_spacing,
            geometry.platform_half_width,
            geometry.carriage_height,
            geometry.leg_length,
            geometry.coupler_length,
            geometry.riser_height,
            geometry.arm_length,
            geometry.arm_drop,
            geometry.strut_drop,
            geometry.strut_length,
        )
        return cls(*(sympy.Rational(repr(value)) for value in values))

    @property
    def symbolic(self) -> bool:
        """Whether these are the paper's symbols."""
        return bool(getattr(self.b, "is_Symbol", False))

    @property
    def half_offset(self) -> Expression:
        """K = b - d: x of the platform where the arm stands upright."""
        return self.b - self.d

    @property
    def lift(self) -> Expression:
        """E = l4 + l7 - l8: what F3 of Eq. 11 has beside the rise of the legs."""
        return self.l4 + self.l7 - self.l8
