"""Array types, and the one place where input becomes a float64 array or a clear error."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from duoglide.errors import InputError

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IndexArray: TypeAlias = NDArray[np.intp]

AXES = 3


def as_triples(value: ArrayLike, name: str, last_axis: str = "(x, y, z)") -> FloatArray:
    """Convert ``value`` to a finite float64 array of shape (..., 3).

    Args:
        value: What the caller gave.
        name: What to call it in an error.
        last_axis: What the three numbers are, for the error.

    Raises:
        InputError: Not numbers, not three in the last axis, or not finite.
    """
    array = as_floats(value, name)
    if array.ndim == 0 or array.shape[-1] != AXES:
        raise InputError(
            f"{name} must have shape (..., 3) with last axis {last_axis}, got {array.shape}"
        )
    return array


def as_floats(value: ArrayLike, name: str) -> FloatArray:
    """Convert ``value`` to a finite float64 array of any shape.

    Raises:
        InputError: Not real numbers, or not finite; names the first bad entry.
    """
    try:
        raw = np.asarray(value)
        if raw.dtype.kind not in "iuf":  # booleans, text and complex are mistakes, not lengths
            raise TypeError(f"dtype {raw.dtype}")
        array: FloatArray = raw.astype(np.float64, copy=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be real numbers, got {value!r:.80}") from error
    finite = np.isfinite(array)
    if not finite.all():
        index = tuple(int(i) for i in np.argwhere(~finite)[0])
        where = f"[{', '.join(map(str, index))}]" if index else ""
        raise InputError(f"{name}{where} is {array[index]}; every value must be finite")
    return array


def as_number(value: object, name: str) -> float:
    """Convert ``value`` to one finite float.

    Raises:
        InputError: Not one finite real number.
    """
    array = as_floats(value, name)  # type: ignore[arg-type]  # this is where the type is found out
    if array.ndim != 0:
        raise InputError(f"{name} must be one number, got shape {array.shape}")
    return float(array)


def read_only(array: FloatArray) -> FloatArray:
    """Return a copy of ``array`` that nobody can write to."""
    copy = np.array(array, dtype=np.float64)
    copy.flags.writeable = False
    return copy
