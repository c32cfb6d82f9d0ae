"""The last seconds of a machine, and what has happened to it, for whoever watches.

Bounded however long it is watched: a row stands for a few cycles, old rows and events go.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

from duoglide.control.channel.events import RunState
from duoglide.control.channel.scale import IntTriple, Scales, Triple
from duoglide.control.host.run.happenings import describe_event

if TYPE_CHECKING:
    from duoglide.control.channel.ring import CycleEntry, EventEntry
    from duoglide.machine import DriveSettings

ROW = 0.01  # [s] that a row stands for
KEPT = 10.0  # [s] of rows
_ROW_NS = round(ROW * 1e9)
_EVENTS = 500
_STANDING = (RunState.NONE, RunState.STOPPED, RunState.FINISHED)


class TraceRow(NamedTuple):
    """What a machine did for ``ROW`` seconds.

    Attributes:
        number: Rises from row to row, over a connection that is opened again, too.
        time: When its last cycle began, monotonic [s].
        carriages: Where they were then [mm].
        following_error: The worst of each carriage, with its sign [mm].
        lateness: The worst [us].
        moving: Whether a run was in progress.
    """

    number: int
    time: float
    carriages: Triple
    following_error: Triple
    lateness: float
    moving: bool


class TraceEvent(NamedTuple):
    """Something that happened.

    Attributes:
        number: Counts events.
        time: When, monotonic [s].
        kind: An ``EventKind``, in lower case.
        text: What, in words.
    """

    number: int
    time: float
    kind: str
    text: str


class _Counts(NamedTuple):
    """A row as it is counted, in increments and nanoseconds."""

    number: int
    time: int
    actual: IntTriple
    following: IntTriple
    lateness: int
    moving: bool


class Trace:
    """Listens to every record of a monitor; others ask it from threads of their own.

    Args:
        drives: Of the machine.
    """

    def __init__(self, drives: DriveSettings) -> None:
        self._scales = Scales.of(drives)
        self._lock = threading.Lock()
        self._rows: deque[_Counts] = deque(maxlen=round(KEPT / ROW))
        self._open: _Counts | None = None
        self._events: deque[TraceEvent] = deque(maxlen=_EVENTS)
        self._told = 0

    def add_cycle(self, entry: CycleEntry) -> None:
        """Put a cycle into its row."""
        moving = entry.state not in _STANDING
        number = entry.time // _ROW_NS
        new = _Counts(number, entry.time, entry.actual, entry.following, entry.lateness, moving)
        row = self._open
        if row is not None and row.number == number:
            self._open = _join(row, new)
            return
        with self._lock:
            if row is not None:
                self._rows.append(row)
            self._open = new

    def add_event(self, event: EventEntry) -> None:
        """Keep an event."""
        record = describe_event(event)
        with self._lock:
            self._told += 1
            self._events.append(
                TraceEvent(self._told, event.time * 1e-9, str(record.kind), record.text)
            )

    @property
    def silence(self) -> float:
        """For how long no cycle has been heard of [s]; 0 before the first."""
        newest = self._open
        return time.monotonic() - newest.time * 1e-9 if newest is not None else 0.0

    def rows(self, after: int) -> list[TraceRow]:
        """Return the rows that are whole and newer than one of that number, the oldest first."""
        with self._lock:
            found = [row for row in self._rows if row.number > after]
        mm = self._scales.mm
        return [
            TraceRow(
                number=row.number,
                time=row.time * 1e-9,
                carriages=mm(row.actual),
                following_error=mm(row.following),
                lateness=row.lateness * 1e-3,
                moving=row.moving,
            )
            for row in found
        ]

    def events(self, after: int) -> list[TraceEvent]:
        """Return the events that are newer than one of that number, the oldest first."""
        with self._lock:
            return [event for event in self._events if event.number > after]


def _join(row: _Counts, new: _Counts) -> _Counts:
    """Return a row with one more cycle in it."""
    (a, b, c), (x, y, z) = row.following, new.following
    worst = (
        a if abs(a) > abs(x) else x,
        b if abs(b) > abs(y) else y,
        c if abs(c) > abs(z) else z,
    )
    late = max(row.lateness, new.lateness)
    return _Counts(row.number, new.time, new.actual, worst, late, row.moving or new.moving)
