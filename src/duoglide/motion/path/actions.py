"""What the machine does at points of a path besides moving."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, TypeAlias

from duoglide.arrays import as_number
from duoglide.errors import InputError

_AXES = (1, 2, 3)
_BITS = 32  # CiA 402 digital inputs 0x60FD and outputs 0x60FE are 32 bits wide


@dataclass(frozen=True, slots=True)
class SetOutput:
    """Set one digital output of a drive, in passing.

    Attributes:
        axis: Which drive, 1 to 3.
        bit: Which bit of its digital outputs (CiA 402, 0x60FE:01), 0 to 31.
        value: On or off.
    """

    axis: int
    bit: int
    value: bool

    def __post_init__(self) -> None:
        _require_line(self.axis, self.bit, self.value)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and the type, for ``read_action``."""
        return {"type": "set_output", **asdict(self)}


@dataclass(frozen=True, slots=True)
class WaitInput:
    """Stand still until a digital input of a drive has a value.

    Attributes:
        axis: Which drive, 1 to 3.
        bit: Which bit of its digital inputs (CiA 402, 0x60FD), 0 to 31.
        value: What to wait for.
        timeout: How long to wait before the run fails [s].
    """

    axis: int
    bit: int
    value: bool
    timeout: float = 5.0

    def __post_init__(self) -> None:
        _require_line(self.axis, self.bit, self.value)
        object.__setattr__(self, "timeout", _require_positive(self.timeout, "timeout"))

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and the type, for ``read_action``."""
        return {"type": "wait_input", **asdict(self)}


@dataclass(frozen=True, slots=True)
class Dwell:
    """Stand still for a time.

    Attributes:
        seconds: How long [s], above 0.
    """

    seconds: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "seconds", _require_positive(self.seconds, "dwell"))

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and the type, for ``read_action``."""
        return {"type": "dwell", **asdict(self)}


@dataclass(frozen=True, slots=True)
class SetPayload:
    """Say what the platform carries from here on: for the forces, nothing is done.

    Attributes:
        mass: [kg], 0 or above.
    """

    mass: float

    def __post_init__(self) -> None:
        mass = as_number(self.mass, "mass [kg]")
        if mass < 0.0:
            raise InputError(f"mass = {mass:g} kg: must be 0 or above")
        object.__setattr__(self, "mass", mass)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and the type, for ``read_action``."""
        return {"type": "set_payload", **asdict(self)}


Action: TypeAlias = SetOutput | WaitInput | Dwell | SetPayload

_KINDS: dict[str, type[SetOutput] | type[WaitInput] | type[Dwell] | type[SetPayload]] = {
    "set_output": SetOutput,
    "wait_input": WaitInput,
    "dwell": Dwell,
    "set_payload": SetPayload,
}


def needs_rest(action: Action) -> bool:
    """Whether the motion must stand still for ``action``."""
    return isinstance(action, WaitInput | Dwell)


def require_action(action: object, waypoint: int, last: int) -> None:
    """Refuse what is no action, or stands at no waypoint from 0 to ``last``.

    Raises:
        InputError: Says which.
    """
    if not 0 <= waypoint <= last:
        raise InputError(f"an action at waypoint {waypoint}: there are 0 to {last}")
    if not isinstance(action, Action):
        raise InputError(f"at waypoint {waypoint}: {action!r:.80} is not an action")


def read_action(table: Mapping[str, Any]) -> Action:
    """Build an action from what an action's ``to_dict`` gave, or from a program file's table.

    Raises:
        InputError: An unknown type, a missing or unknown field, or a value that breaks a rule.
    """
    values = dict(table)
    kind = values.pop("type", None)
    if kind not in _KINDS:
        known = ", ".join(_KINDS)
        raise InputError(f"action type {kind!r:.80} is not known; the types are {known}")
    try:
        return _KINDS[kind](**values)
    except TypeError as error:
        raise InputError(f"action {kind}: {str(error).split('() ')[-1]}") from error


def _require_line(axis: object, bit: object, value: object) -> None:
    if isinstance(axis, bool) or not isinstance(axis, int) or axis not in _AXES:
        raise InputError(f"axis = {axis!r:.80}: must be 1, 2 or 3")
    if isinstance(bit, bool) or not isinstance(bit, int) or not 0 <= bit < _BITS:
        raise InputError(f"bit = {bit!r:.80}: must be a whole number from 0 to {_BITS - 1}")
    if not isinstance(value, bool):
        raise InputError(f"value = {value!r:.80}: must be true or false")


def _require_positive(value: object, name: str) -> float:
    number = as_number(value, f"{name} [s]")
    if number <= 0.0:
        raise InputError(f"{name} = {number:g} s: must be above 0")
    return number
