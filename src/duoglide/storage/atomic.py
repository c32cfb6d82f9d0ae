"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from duoglide.errors import LogError


@contextmanager
def appearing(path: str | Path) -> Iterator[Path]:
    """Give the path of a file to write, and put it in the place of ``path`` when that is done.

    If writing fails, ``path`` stays as it was.

    Args:
        path: Where the file shall appear.

    Raises:
        LogError: It cannot be written.

    Example:
        >>> import tempfile
        >>> file = Path(tempfile.mkdtemp()) / "numbers.csv"
        >>> with appearing(file) as temporary:
        ...     _ = temporary.write_text("1,2,3")
        >>> file.read_text()
        '1,2,3'
    """
    goal = Path(path)
    temporary = goal.with_name(f".{goal.stem}.{os.getpid()}.part{goal.suffix}")
    try:
        if goal.is_dir():
            raise LogError(f"cannot write {goal}: it is a directory")
        yield temporary
        temporary.replace(goal)
    except OSError as error:
        raise LogError(f"cannot write {goal}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)
