"""Files to write, looked at before the long work begins."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from duoglide.errors import InputError

Force: TypeAlias = Annotated[
    bool, typer.Option("--force", help="Write over a plan or a run that is there.")
]
_PICTURES = (".png", ".pdf", ".svg")
_MCAP = b"\x89MCAP"
_ROOM = 1 << 20  # [byte] that a disk must have left: less is no log


def require_log(
    file: Path | None, *, reads: Iterable[Path | None] = (), force: bool = False
) -> None:
    """Refuse the place of a plan or a run that could not be written in the end.

    Raises:
        InputError: What ``require_place`` says; or something is there, and ``force`` was not given
            or what is there is neither a plan nor a run.
    """
    require_place(file, reads=reads, force=force)
    if file is None or not _filled(file) or (force and _is_recording(file)):
        return
    if force:
        raise InputError(f"cannot write {file}: what is there is neither a plan nor a run")
    raise InputError(_there_already(file))


def require_place(
    *files: Path | None, reads: Iterable[Path | None] = (), force: bool = False
) -> None:
    """Refuse files that could not be written in the end, and those that are read meanwhile.

    Raises:
        InputError: The folder is not there, not to be written in, or full; or the file is a folder,
            would take the place of another that is read or written, or of a plan or a run.
    """
    taken = {Path(os.path.realpath(file)): "what is read" for file in reads if file is not None}
    for file in files:
        if file is None:
            continue
        goal = Path(os.path.realpath(file))
        if goal in taken:
            raise InputError(f"cannot write {file}: it would take the place of {taken[goal]}")
        taken[goal] = "another file to be written"
        _require_writable(file, goal.parent)
        if not force and _is_recording(file):
            raise InputError(_there_already(file))


def require_picture(file: Path | None, *, reads: Iterable[Path | None] = ()) -> None:
    """Refuse a picture that could not be drawn in the end.

    Raises:
        InputError: Its suffix is none of ours, or there is no place for it.
    """
    if file is not None and file.suffix.lower() not in _PICTURES:
        raise InputError(f"{file}: a picture ends in {', '.join(_PICTURES)}")
    require_place(file, reads=reads)


def require_new(folder: Path | None) -> None:
    """Refuse a folder to be made where something is already.

    Raises:
        InputError: Something is there.
    """
    if folder is not None and (folder.exists() or folder.is_symlink()):
        raise InputError(f"cannot write {folder}: it is there already; take another name")


def _require_writable(file: Path, folder: Path) -> None:
    if file.is_dir():
        raise InputError(f"cannot write {file}: it is a folder")
    if not folder.is_dir():
        raise InputError(f"cannot write {file}: there is no folder {file.parent}")
    if not os.access(folder, os.W_OK):
        raise InputError(f"cannot write {file}: no permission to write in {folder}")
    if (free := shutil.disk_usage(folder).free) < _ROOM:
        raise InputError(f"cannot write {file}: its disk is full, {free / 1024:.0f} KiB are left")


def _there_already(file: Path) -> str:
    what = "a plan or a run" if _is_recording(file) else "a file"
    return f"{file} is there already, {what}; --force writes over it, another name keeps it"


def _filled(file: Path) -> bool:
    return file.is_file() and file.stat().st_size > 0


def _is_recording(file: Path) -> bool:
    """Whether a file begins as plans and runs do."""
    if not file.is_file():  # a pipe would keep its reader waiting
        return False
    try:
        with file.open("rb") as opened:
            return opened.read(len(_MCAP)) == _MCAP
    except OSError:
        return False
