"""What may be given for a file."""

from __future__ import annotations

import os
from pathlib import Path

from duoglide.errors import InputError


def numbered(path: Path) -> Path:
    """Return ``path``, or where something is there already the first free of ``name-2``, ...

    Example:
        >>> import tempfile
        >>> folder = Path(tempfile.mkdtemp())
        >>> (folder / "run.mcap").touch()
        >>> numbered(folder / "run.mcap").name
        'run-2.mcap'
    """
    free, number = path, 1
    while free.exists() or free.is_symlink():
        number += 1
        free = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return free


def as_path(value: object, name: str) -> Path:
    """Convert ``value`` to a path.

    Raises:
        InputError: Neither text nor a path.
    """
    if not isinstance(value, str | os.PathLike):
        raise InputError(f"{name} = {value!r:.80}: must be the path of a file")
    return Path(value)
