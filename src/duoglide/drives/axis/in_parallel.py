"""The same for several drives at once: what takes one of them long, takes all of them no longer."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import TYPE_CHECKING, TypeVar

from duoglide.errors import DriveError, DriveTimeout

if TYPE_CHECKING:
    from duoglide.drives.axis.axis import Axis

T = TypeVar("T")
_PREFIX = re.compile(r"axis (\d) \(node \d+\)[:,] ")


def in_parallel(axes: Sequence[Axis], do: Callable[[Axis], T]) -> list[T]:
    """Call ``do`` with each axis, each in a thread of its own, and return what it has returned.

    Raises:
        DriveError: Of one axis, as it is; of several, one that has the words of all of them.
    """
    pool = ThreadPoolExecutor(len(axes))
    try:
        futures = [pool.submit(do, axis) for axis in axes]
        wait(futures)
    finally:  # where the caller was interrupted, the threads end once their bus is closed
        pool.shutdown(wait=False, cancel_futures=True)
    raised = [error for future in futures if (error := future.exception()) is not None]
    errors = [error for error in raised if isinstance(error, DriveError)]
    if len(errors) < len(raised):  # the bus, or a mistake of ours, comes first
        raise next(error for error in raised if not isinstance(error, DriveError))
    if errors:
        raise _join(errors)
    return [future.result() for future in futures]


def _join(errors: Sequence[DriveError]) -> DriveError:
    """Make one error of several; what several axes have in common is said once."""
    first, *others = errors
    if not others:
        return first
    said: dict[str, list[str]] = {}
    for error in errors:
        prefix = _PREFIX.match(str(error))
        number, words = (prefix[1], str(error)[prefix.end() :]) if prefix else ("", str(error))
        said.setdefault(words, []).append(number)
    parts = [f"{_name(numbers)}{words}" for words, numbers in said.items()]
    kind = DriveTimeout if all(isinstance(error, DriveTimeout) for error in errors) else DriveError
    return kind("; ".join(parts), axis=0, code=first.code)


def _name(numbers: Sequence[str]) -> str:
    if not any(numbers):
        return ""
    return f"{'axis' if len(numbers) == 1 else 'axes'} {', '.join(numbers)}: "
