"""What the commands print: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress

EXTRAS = {"viser": "view", "mujoco": "mujoco", "sympy": "symbolic", "pyarrow": "parquet"}
"""Which optional extra brings a module."""

WORTH_TELLING = 1.0  # [s] of work


def complain(message: str, code: int) -> int:
    """Write one line to stderr and return ``code``."""
    print("duoglide:", " ".join(message.split()), file=sys.stderr)
    return code


def say(text: str = "") -> None:
    """Write text to stdout as it is, at once."""
    print(text, flush=True)


def say_json(value: object) -> None:
    """Write a value to stdout as JSON; what is not finite becomes null."""
    print(json.dumps(_plain(value), indent=2, allow_nan=False))


def say_facts(rows: Iterable[tuple[str, str]]) -> None:
    """Write names and values in two columns; a name left out continues the one before."""
    kept = list(rows)
    width = max((len(name) for name, _ in kept), default=0)
    for name, value in kept:
        print(f"  {name:<{width}}  {value}".rstrip())


@contextmanager
def working(text: str) -> Iterator[None]:
    """Show on stderr that something takes a while; a terminal gets a spinner.

    Example:
        >>> with working("planning"):
        ...     pass
    """
    start = time.monotonic()
    if sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True).status(f"{text} ..."):
            yield
    else:
        yield
    if (took := time.monotonic() - start) > WORTH_TELLING:
        print(f"{text}: {took:.1f} s", file=sys.stderr)


@contextmanager
def progress(text: str, total: float) -> Iterator[Any]:
    """Show on stderr how far something is.

    Args:
        text: What is done.
        total: Its whole amount.

    Yields:
        A function to call with how much of it is done.
    """
    if not sys.stderr.isatty():
        with working(text):
            yield lambda done: None
        return
    bar = _bar()
    with bar:
        task = bar.add_task(text, total=total)
        yield lambda done: bar.update(task, completed=done)


def _bar() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )


def triple(values: Iterable[float], digits: int = 1) -> str:
    """Return three numbers as text."""
    return ", ".join(f"{value:.{digits}f}" for value in values)


def percent(values: Iterable[float]) -> str:
    """Return shares of 1 as text in percent."""
    return ", ".join(f"{100.0 * value:.1f} %" for value in values)


def _plain(value: Any) -> Any:
    """Turn arrays, tuples and what is not finite into what JSON holds."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
