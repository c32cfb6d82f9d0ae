"""Which of the solutions: the signs of the square roots."""

from __future__ import annotations

from dataclasses import dataclass, fields
from numbers import Real

from duoglide.errors import InputError


class Numbered:
    """Room for a number that stands for the signs, so that looking them up is quick.

    No field, so that it is neither compared, printed nor pickled; missing in an unpickled mode.
    """

    __slots__ = ("code",)
    code: int


@dataclass(frozen=True, slots=True)
class WorkingMode(Numbered):
    """Which inverse solution, Eqs. 13 and 15 of [Shen2021]_; each sign is +1 or -1.

    Attributes:
        v: Sign of sin(beta): +1 where the arm points up from the legs to the platform.
        w1: Side of C1 on which carriage 1 stands: +1 at larger y.
        w2: Side of C2 on which carriage 2 stands.
        w3: Side of the platform on which carriage 3 stands.

    Raises:
        InputError: A sign is not +1 or -1.
    """

    v: int = 1
    w1: int = -1
    w2: int = 1
    w3: int = 1

    def __post_init__(self) -> None:
        _require_signs(self)


@dataclass(frozen=True, slots=True)
class AssemblyMode(Numbered):
    """Which forward solution, Eqs. 9 and 11 of [Shen2021]_; each sign is +1 or -1.

    Attributes:
        m: Sign of sin(alpha): +1 where the coupler is above the carriages' joints.
        n: Sign of X sin(beta) + Z cos(beta): which side of case 2.

    Raises:
        InputError: A sign is not +1 or -1.
    """

    m: int = 1
    n: int = 1

    def __post_init__(self) -> None:
        _require_signs(self)


def _require_signs(mode: WorkingMode | AssemblyMode) -> None:
    """Store each field as a plain int, or refuse it."""
    for field in fields(mode):
        value = getattr(mode, field.name)
        if isinstance(value, bool) or not isinstance(value, Real) or value not in (-1, 1):
            raise InputError(f"{type(mode).__name__}.{field.name} must be +1 or -1, got {value!r}")
        object.__setattr__(mode, field.name, 1 if value == 1 else -1)
    number(mode)


def number(mode: WorkingMode | AssemblyMode) -> int:
    """Return a number that no other mode of the class has, and write it on the mode."""
    signs = [getattr(mode, field.name) for field in fields(mode)]
    code = sum(1 << i for i, sign in enumerate(signs) if sign > 0)
    object.__setattr__(mode, "code", code)
    return code


WORKING = WorkingMode()
ASSEMBLY = AssemblyMode()
