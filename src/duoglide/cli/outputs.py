"""Files to write, looked at before the long work begins."""

from __future__ import annotations

import os
from pathlib import Path

from duoglide.errors import InputError

_PICTURES = (".png", ".pdf", ".svg")


def require_place(*files: Path | None, reads: Path | None = None) -> None:
    """Refuse files that could not be written in the end, and the one that is read meanwhile.

    Raises:
        InputError: The folder is not there or not to be written in, or the file is a folder, or
            would take the place of ``reads``.
    """
    for file in files:
        if file is None:
            continue
        if reads is not None and file.resolve() == reads.resolve():
            raise InputError(f"cannot write {file}: it would take the place of what is read")
        if file.is_dir():
            raise InputError(f"cannot write {file}: it is a folder")
        if not file.parent.is_dir():
            raise InputError(f"cannot write {file}: there is no folder {file.parent}")
        folder = Path(os.path.realpath(file)).parent
        if not os.access(folder, os.W_OK):
            raise InputError(f"cannot write {file}: no permission to write in {folder}")


def require_picture(file: Path | None) -> None:
    """Refuse a picture that could not be drawn in the end.

    Raises:
        InputError: Its suffix is none of ours, or there is no place for it.
    """
    if file is not None and file.suffix.lower() not in _PICTURES:
        raise InputError(f"{file}: a picture ends in {', '.join(_PICTURES)}")
    require_place(file)
