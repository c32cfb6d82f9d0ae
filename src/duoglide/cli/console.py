"""What the commands print: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import math
import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from duoglide.errors import printable

if TYPE_CHECKING:
    from rich.progress import Progress

EXTRAS = {
    "viser": "view",
    "mujoco": "mujoco",
    "sympy": "symbolic",
    "pyarrow": "parquet",
    "rerun": "rerun",
    "rosbags": "ros2",
}
"""Which optional extra brings a module."""

WORTH_TELLING = 1.0  # [s] of work
_COLUMNS = 80  # where there is no terminal
_LINES = 3  # of a refusal


class Failed(Exception):  # noqa: N818  # not an error of its own: it carries one
    """A failure with what ``--json`` says of it beside the words.

    Attributes:
        cause: What has gone wrong.
        facts: More of it, by the keys of the JSON.
    """

    def __init__(self, cause: BaseException, facts: Mapping[str, object]) -> None:
        super().__init__(str(cause))
        self.cause, self.facts = cause, facts


class Stopped(KeyboardInterrupt):
    """An interrupt of a run, after which the machine stands.

    Attributes:
        facts: Of the run, by the keys of the JSON.
    """

    def __init__(self, words: str, facts: Mapping[str, object]) -> None:
        super().__init__(words)
        self.facts = facts


def complain(message: str, code: int) -> int:
    """Write a message to stderr, in short lines where it is long, and return ``code``."""
    words = " ".join(printable(message).split())
    for line in short_lines(f"duoglide: {words}", _columns()):
        print(line, file=sys.stderr)
    return code


def short_lines(message: str, columns: int) -> list[str]:
    """Break a message between its clauses, as the messages of ``errors`` have them after ``;``.

    Where that gives more than three lines, they are filled instead.
    """
    lines: list[str] = []
    for clause in message.split("; "):
        if lines and len(lines[-1]) + 2 + len(clause) <= columns:
            lines[-1] += f"; {clause}"
        else:
            lines += _filled(clause, columns, "  " if lines else "")
    return lines if len(lines) <= _LINES else _filled(message, columns, "")


def _filled(text: str, columns: int, first: str, rest: str = "  ") -> list[str]:
    """Wrap at spaces; file names and addresses stay whole, however long."""
    return textwrap.wrap(
        text,
        columns,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    ) or [""]


def _columns() -> int:
    return shutil.get_terminal_size((_COLUMNS, 24)).columns


def say(text: str = "") -> None:
    """Write text to stdout, at once; what is too long for the terminal goes on indented."""
    for line in printable(text).splitlines() or [""]:
        fits = len(line) <= _columns()
        print(line if fits else "\n".join(_filled(line, _columns(), "")), flush=True)


def say_as_it_is(text: str) -> None:
    """Write text to stdout that will be pasted: a terminal must not wrap it."""
    sys.stdout.write(printable(text))
    sys.stdout.flush()


def say_json(verb: str, result: Mapping[str, object], *, ok: bool = True) -> None:
    """Write what a verb has found out to stdout as JSON; what is not finite becomes null.

    Every verb says the same of itself first: see the page on scripts in the documentation.

    Args:
        verb: Which.
        result: Its own keys and values.
        ok: Whether it has done what it was asked for.
    """
    from duoglide import __version__

    document = {"duoglide": __version__, "verb": verb, "ok": ok, **result}
    print(json.dumps(_plain(document), indent=2, allow_nan=False, default=str), flush=True)


def say_facts(rows: Iterable[tuple[str, str]]) -> None:
    """Write names and values in two columns; a name left out continues the one before."""
    kept = [(printable(name), printable(value)) for name, value in rows]
    width = max((len(name) for name, _ in kept), default=0)
    for name, value in kept:
        line = f"  {name:<{width}}  {value}".rstrip()
        if len(line) > _columns():
            line = "\n".join(_filled(value, _columns(), line[: width + 4], " " * (width + 4)))
        print(line)


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
def progress(text: str, total: float, first: str = "") -> Iterator[Callable[[float], None]]:
    """Show on stderr how far something is.

    Args:
        text: What is done.
        total: Its whole amount.
        first: What is done before anything of it is.

    Yields:
        A function to call with how much of it is done.
    """
    if not sys.stderr.isatty():
        if first:
            print(first, file=sys.stderr, flush=True)
        with working(text):
            yield lambda done: None
        return
    bar = _bar()
    with bar:
        task = bar.add_task(first or text, total=None if first else total, share="")

        def show(done: float) -> None:
            if done > 0.0 or not first:
                share = f"{100.0 * done / total:3.0f} %"
                bar.update(task, completed=done, total=total, description=text, share=share)

        yield show


def _bar() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[share]}"),
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
