"""What may be given for a file."""

from __future__ import annotations

import os
from pathlib import Path

from duoglide.errors import InputError


def as_path(value: object, name: str) -> Path:
    """Convert ``value`` to a path.

    Raises:
        InputError: Neither text nor a path.
    """
    if not isinstance(value, str | os.PathLike):
        raise InputError(f"{name} = {value!r:.80}: must be the path of a file")
    return Path(value)
