"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from duoglide.errors import LogError
from duoglide.storage.paths import require_replaceable


@contextmanager
def appearing(path: str | Path) -> Iterator[Path]:
    """Give the path of a file to write, and put it in the place of ``path`` when that is done.

    If writing fails, ``path`` stays as it was. A plan or a run is never replaced.

    Args:
        path: Where the file shall appear.

    Raises:
        LogError: It cannot be written, or a plan or a run stands there.

    Example:
        >>> import tempfile
        >>> file = Path(tempfile.mkdtemp()) / "numbers.csv"
        >>> with appearing(file) as temporary:
        ...     _ = temporary.write_text("1,2,3")
        >>> file.read_text()
        '1,2,3'
    """
    goal = file_behind(path)
    require_replaceable(path, None)
    temporary = goal.with_name(f".{goal.stem}.{os.getpid()}.part{goal.suffix}")
    try:
        yield temporary
        temporary.replace(goal)
    except OSError as error:
        raise LogError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def file_behind(path: str | Path) -> Path:
    """Return the file that ``path`` names, through links; whether it exists or not.

    Raises:
        LogError: It is a directory, or a device that a file must not take the place of.
    """
    goal = Path(os.path.realpath(path))
    try:
        folder, device = goal.is_dir(), goal.exists() and not goal.is_file()
    except OSError as error:
        raise LogError(f"cannot write {path}: {error.strerror}") from error
    if folder:
        raise LogError(f"cannot write {path}: it is a directory")
    if device:
        raise LogError(f"cannot write {path}: it is a device, not a file")
    return goal
