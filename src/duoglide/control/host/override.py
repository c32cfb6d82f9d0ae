"""The share of the planned speed that an operator asks for."""

from __future__ import annotations

from duoglide.arrays import as_number
from duoglide.errors import InputError


def require_override(override: object) -> float:
    """Return what a run in progress may be told, from 0 to 1; at 0 it stands.

    Raises:
        InputError: It is not.
    """
    value = as_number(override, "override")
    if not 0.0 <= value <= 1.0:
        raise InputError(f"override = {value:g}: must be from 0 to 1 (1 is the planned speed)")
    return value


def require_first_override(override: object) -> float:
    """Return what a run may begin with, above 0 to 1; at 0 it would never end.

    Raises:
        InputError: It is not.
    """
    value = require_override(override)
    if value == 0.0:
        raise InputError(
            "override = 0: the run would never end; begin above 0, to 1 (the planned speed)."
            " set_override(0) and hold() halt a run that has begun"
        )
    return value
