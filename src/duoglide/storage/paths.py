"""What may be given for a file, and which files may be replaced."""

from __future__ import annotations

import os
from pathlib import Path

from duoglide.errors import InputError, LogError
from duoglide.storage.head import kind_of
from duoglide.storage.records import LogKind


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


def inside(folder: Path, name: str) -> Path:
    """Return the file of a name that is given by a page, if it is below a folder.

    Args:
        folder: What may be read and written.
        name: Relative to it.

    Raises:
        InputError: Nothing, or something that leads out of the folder, by a link perhaps.
    """
    text = name.strip()
    if not text or "\0" in text:
        raise InputError(f"{name!r:.80} is no name of a file")
    try:
        file = (folder / text).resolve()
    except (OSError, RuntimeError) as error:  # a circle of links
        raise InputError(f"{text:.80}: {error}") from error
    if Path(text).is_absolute() or not file.is_relative_to(folder.resolve()):
        raise InputError(f"{text:.80} is not below {folder}: a page has the files there, no others")
    return file


def as_path(value: object, name: str) -> Path:
    """Convert ``value`` to a path.

    Raises:
        InputError: Neither text nor a path.
    """
    if not isinstance(value, str | os.PathLike):
        raise InputError(f"{name} = {value!r:.80}: must be the path of a file")
    return Path(value)


def require_replaceable(path: str | os.PathLike[str], kind: LogKind | None) -> None:
    """Refuse to write a file where something else stands that would be lost.

    A plan takes the place of a plan, a run of a run, torn or whole; an export of anything but
    these two. A place that is free, and a file that is empty, can be written by all.

    Args:
        path: Where to write.
        kind: What shall be written; None for an export: a table, a picture, frames.

    Raises:
        LogError: What stands there must not be replaced; says what it is.
    """
    file = Path(path)
    try:
        if not file.is_file() or file.stat().st_size == 0:
            return
        there = kind_of(file)
    except OSError as error:
        raise LogError(f"cannot write {path}: {error.strerror}") from error
    if there is kind:
        return
    if there is not None:
        what = f"there is a {there.value}"
    elif kind is None:
        return
    else:
        what = f"there is a file that is no {kind.value} of Duoglide"
    raise LogError(f"cannot write {path}: {what}, and it is not replaced; take another name")
