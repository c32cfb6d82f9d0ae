"""A fuzzer of files, led by which lines of the readers an input reaches first."""

from __future__ import annotations

import random
import re
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import CodeType, FrameType
from typing import Any

from duoglide.errors import DuoglideError

NUMBERS = (
    *("0", "-0", "1", "-1", "0.5", "1e-9", "1e308", "-1e308", "1e999", "nan", "inf", "-inf"),
    *("1,5", "1.200", "1_000", "0x10", "9" * 25, "9" * 400, "0." + "9" * 400, "1e", "--1", "+.5"),
    *("2147483648", "18446744073709551616", "0x" + "f" * 4000, "1e18", "1.0e18", "5e-324"),
)
PIECES = (
    *(b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\xfc", b"\x85", b"\x1a", b"\r", b"\r\n", b"\n", b"\t"),
    *("\u0661".encode(), "\u2028".encode(), "\u2212".encode(), b" ", b",", b";", b'"', b"'", b"#"),
    *(b"[" * 2000, b"{a=" * 500, b"a." * 300 + b"b=1\n", b"(", b")", b"%", b"*71", b"/", b"-"),
)
_NUMBER = re.compile(rb"[-+]?[0-9][0-9.]*")
_TOKEN = re.compile(rb"[A-Za-z_]+|[-+]?[0-9][0-9.]*|\s+|.", re.DOTALL)
_LONGEST = 20_000


def mutated(
    data: bytes, others: Sequence[bytes], words: Sequence[bytes], rng: random.Random
) -> bytes:
    """Return ``data`` with one to five changes."""
    for _ in range(rng.choice((1, 1, 2, 3, 5))):
        data = _CHANGES[rng.randrange(len(_CHANGES))](data, others, words, rng)[:_LONGEST]
    return data


_Change = Callable[[bytes, Sequence[bytes], Sequence[bytes], random.Random], bytes]


def _span(data: bytes, rng: random.Random) -> tuple[int, int]:
    start = rng.randrange(len(data) + 1)
    return start, min(len(data), start + rng.choice((1, 1, 2, 4, 8, 32)))


def _drop(data: bytes, others: Any, words: Any, rng: random.Random) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + data[end:]


def _repeat(data: bytes, others: Any, words: Any, rng: random.Random) -> bytes:
    start, end = _span(data, rng)
    return data[:end] + data[start:end] * rng.choice((1, 1, 2, 50)) + data[end:]


def _flip(data: bytes, others: Any, words: Any, rng: random.Random) -> bytes:
    start, _ = _span(data, rng)
    return data[:start] + bytes([rng.randrange(256)]) + data[start + 1 :]


def _put(data: bytes, others: Any, words: Sequence[bytes], rng: random.Random) -> bytes:
    start, end = _span(data, rng)
    piece = rng.choice(words if rng.random() < 0.7 else PIECES)
    return data[:start] + piece + data[rng.choice((start, end)) :]


def _renumber(data: bytes, others: Any, words: Any, rng: random.Random) -> bytes:
    found = list(_NUMBER.finditer(data))
    if not found:
        return data
    match = rng.choice(found)
    if rng.random() < 0.5:
        number = f"{rng.uniform(-400, 400):.{rng.randrange(4)}f}"
    else:
        number = rng.choice(NUMBERS)
    return data[: match.start()] + number.encode() + data[match.end() :]


def _retoken(
    data: bytes, others: Sequence[bytes], words: Sequence[bytes], rng: random.Random
) -> bytes:
    tokens = _TOKEN.findall(data)
    if not tokens:
        return rng.choice(words)
    place = rng.randrange(len(tokens))
    pool = _TOKEN.findall(rng.choice(others)) or [b""]
    tokens[place] = rng.choice((rng.choice(words), rng.choice(pool), rng.choice(tokens)))
    return b"".join(tokens)


def _reline(data: bytes, others: Sequence[bytes], words: Any, rng: random.Random) -> bytes:
    lines, more = data.split(b"\n"), rng.choice(others).split(b"\n")
    place = rng.randrange(len(lines))
    lines[place : place + rng.randrange(2)] = [rng.choice(more)]
    return b"\n".join(lines)


_CHANGES: tuple[_Change, ...] = (
    _drop,
    _repeat,
    _flip,
    _put,
    _renumber,
    _renumber,
    _retoken,
    _reline,
)


class Reached:
    """Which lines of some modules have been run, and whether the latest input ran new ones.

    Args:
        parts: What the names of the modules' files contain.
    """

    def __init__(self, parts: Sequence[str]) -> None:
        self._parts = tuple(parts)
        self.lines: set[tuple[str, int, int]] = set()

    def __enter__(self) -> Reached:
        if sys.version_info >= (3, 12):
            monitoring = sys.monitoring
            monitoring.use_tool_id(monitoring.COVERAGE_ID, "fuzz")
            monitoring.register_callback(monitoring.COVERAGE_ID, monitoring.events.LINE, self._line)
            monitoring.set_events(monitoring.COVERAGE_ID, monitoring.events.LINE)
        else:
            self._before = sys.gettrace()
            sys.settrace(self._call)
        return self

    def __exit__(self, *_: object) -> None:
        if sys.version_info >= (3, 12):
            monitoring = sys.monitoring
            monitoring.set_events(monitoring.COVERAGE_ID, 0)
            monitoring.free_tool_id(monitoring.COVERAGE_ID)
            monitoring.restart_events()
        else:
            sys.settrace(self._before)

    def _line(self, code: CodeType, line: int) -> Any:
        if any(part in code.co_filename for part in self._parts):
            self.lines.add((code.co_filename, 0, line))
        return sys.monitoring.DISABLE  # type: ignore[attr-defined,unused-ignore]

    def _call(self, frame: FrameType, event: str, argument: object) -> Any:
        name = frame.f_code.co_filename
        if not any(part in name for part in self._parts):
            return None
        before = 0

        def local(frame: FrameType, event: str, argument: object) -> Any:
            nonlocal before
            if event == "line":
                self.lines.add((name, before, frame.f_lineno))
                before = frame.f_lineno
            return local

        return local


@dataclass(frozen=True, slots=True)
class Target:
    """A reader to fuzz.

    Attributes:
        read: Reads an input, or raises a DuoglideError.
        seeds: Good inputs.
        words: What the format is made of.
        modules: What the file names of the modules contain whose lines count.
    """

    read: Callable[[bytes], object]
    seeds: Sequence[bytes]
    words: Sequence[bytes]
    modules: Sequence[str]


@dataclass(slots=True)
class Outcome:
    """What came of many inputs.

    Attributes:
        read: How many were read.
        refused: How many were refused by a DuoglideError.
        kept: Inputs that reached something new, the seeds before all.
        good: Those of them that were read.
        reached: How many lines, or steps from line to line, were reached.
        slowest: The longest time that one took [s].
        longest: Length of the longest message.
        escaped: Inputs that raised something else, and what.
    """

    read: int = 0
    refused: int = 0
    kept: list[bytes] = field(default_factory=list)
    good: list[bytes] = field(default_factory=list)
    reached: int = 0
    slowest: float = 0.0
    longest: int = 0
    escaped: list[tuple[bytes, Exception]] = field(default_factory=list)


def fuzz(target: Target, count: int, seed: int) -> Outcome:
    """Give a reader its seeds and ``count`` more inputs; go on from those that reach new lines."""
    rng, result = random.Random(seed), Outcome(kept=list(target.seeds))
    with Reached(target.modules) as reached:
        for data in target.seeds:
            _try(target, data, result)
            result.good.append(data)
        for _ in range(count):
            base = rng.choice(result.good if rng.random() < 0.6 else result.kept)
            data = mutated(base, result.kept, target.words, rng)
            known = len(reached.lines)
            was_read = _try(target, data, result)
            if len(reached.lines) > known:
                result.kept.append(data)
                if was_read:
                    result.good.append(data)
        result.reached = len(reached.lines)
    return result


def _try(target: Target, data: bytes, result: Outcome) -> bool:
    """Read one input, and count what came of it."""
    start = time.perf_counter()
    try:
        target.read(data)
        result.read += 1
        return True
    except DuoglideError as error:
        result.refused += 1
        result.longest = max(result.longest, len(str(error)))
    except Exception as error:
        result.escaped.append((data, error))
    finally:
        result.slowest = max(result.slowest, time.perf_counter() - start)
    return False
