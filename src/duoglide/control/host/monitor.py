"""The host's reader of the ring: a thread that takes records and hands them on."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol

from duoglide.control.channel.events import Happening, RunState
from duoglide.control.channel.orders import Command, Power
from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.control.host.interrupt import Ultimatum
from duoglide.errors import BusError, DuoglideError

if TYPE_CHECKING:
    from duoglide.control.host.process import StreamerProcess

_COMMON = (Happening.PART, Happening.AWAITED, Happening.OUTPUT, Happening.INPUT)
"""Events without an end, which nobody waits for: they are handed on, and not kept."""
_PERIOD = 0.005  # [s] between two looks into the ring
_SILENCE = 3.0  # [s] without a record after which a streamer that exists counts as hung
_DEATH_WATCH = 0.1  # [s] between two looks at the process


class Listener(Protocol):
    """Somebody who wants the records of a run."""

    def add_cycle(self, entry: CycleEntry) -> None:
        """Take a cycle."""
        ...

    def add_event(self, event: EventEntry) -> None:
        """Take an event."""
        ...


class Monitor:
    """Reads the ring on a thread of its own; a resource: ``close`` it.

    Args:
        process: The streamer.

    Attributes:
        witnesses: Who get every record, whether anything runs or not; must not fail.
    """

    def __init__(self, process: StreamerProcess) -> None:
        self._process = process
        self._news = threading.Condition()
        self._latest: CycleEntry | None = None
        self._events: list[EventEntry] = []
        self._listeners: tuple[Listener, ...] = ()
        self.witnesses: tuple[Listener, ...] = ()
        self._failure: DuoglideError | None = None
        self._gone: DuoglideError | None = None
        self._closing = False
        self._ultimatum = Ultimatum()
        self._thread = threading.Thread(target=self._read, name="duoglide-monitor", daemon=True)
        self._thread.start()

    @property
    def latest(self) -> CycleEntry | None:
        """The newest cycle; None before the first."""
        return self._latest

    @property
    def mark(self) -> int:
        """How many events have come so far: where to begin to wait from."""
        return len(self._events)

    @property
    def failed(self) -> bool:
        """Whether the streamer is gone, or a listener has failed: waiting would raise why."""
        return (self._failure or self._gone) is not None

    @property
    def streamer_is_gone(self) -> bool:
        """Whether the streamer has ended, or has not spoken for so long that it will not."""
        return self._gone is not None

    def wait_for(self, found: Callable[[CycleEntry], bool], timeout: float) -> bool:
        """Wait until a cycle that begins after this call is as wanted.

        Returns:
            Whether it came in time.

        Raises:
            DuoglideError: The streamer is gone, or a listener has failed.
        """
        before = self._latest.cycle if self._latest else 0
        return self._wait(
            lambda: (
                self._latest is not None and self._latest.cycle > before and found(self._latest)
            ),
            timeout,
        )

    def events(self, mark: int) -> list[EventEntry]:
        """Return the events that have come after ``mark``."""
        return self._events[mark:]

    def find(self, wanted: Callable[[EventEntry], bool], mark: int) -> EventEntry | None:
        """Return the first event after ``mark`` that is wanted; None if none has come."""
        return next((event for event in self._events[mark:] if wanted(event)), None)

    def wait_until(self, come: Callable[[], bool], timeout: float | None) -> bool:
        """Wait for something that a listener notices; look again whenever records have come.

        Raises:
            DuoglideError: The streamer is gone, or a listener has failed.
        """
        return self._wait(come, float("inf") if timeout is None else timeout)

    def attach(self, *listeners: Listener) -> None:
        """Hand every record from now on to these, and to nobody else."""
        with self._news:
            self._listeners, self._failure = listeners, None

    def detach(self) -> None:
        """Hand records to nobody; when this returns no listener is being called."""
        self.attach()

    def close(self) -> None:
        """End the thread, after everything that is in the ring has been taken."""
        self._closing = True
        self._thread.join()

    def _wait(self, come: Callable[[], bool], timeout: float) -> bool:
        deadline = time.monotonic() + timeout
        with self._news:
            while not come():
                failure = self._failure or self._gone
                if failure is not None:
                    raise failure
                left = deadline - time.monotonic()
                if left <= 0.0:
                    return False
                self._news.wait(min(left, _DEATH_WATCH))
        return True

    def _read(self) -> None:
        """Read until the end; what goes wrong here is said to whoever waits, for nobody else is."""
        try:
            self._watch()
        except Exception as error:  # whatever it is: a host that waits for a dead thread never ends
            with self._news:
                self._gone = DuoglideError(f"the records cannot be read on: {_words(error)}")
                self._gone.__cause__ = error
                self._news.notify_all()

    def _watch(self) -> None:
        heard = next_look = time.monotonic()
        while not self._closing:
            time.sleep(_PERIOD)
            now = time.monotonic()
            gone = now > next_look and not self._process.alive
            if now > next_look:
                next_look = now + _DEATH_WATCH
            if self._take():
                heard = now
            self._insist_on_the_end(now)
            if gone or now - heard > _SILENCE:
                self._give_up("is gone" if gone else "does not answer")
            if gone and not self._ultimatum.waits:
                return
        self._take()

    def _insist_on_the_end(self, now: float) -> None:
        """Stop the machine of a process that was told to end, and is stuck; then end it."""
        ring, endings = self._process.ring, self._process.endings
        ring.fatal_signals = endings.fatal
        orders = ring.orders
        entry = self._latest
        powered = entry is not None and entry.power not in (Power.SILENT, Power.OFF)
        moving = entry is not None and entry.state != RunState.NONE
        for ending in endings.take():
            self._ultimatum.begin(ending, now, orders, moving=moving, powered=powered)
        if self._ultimatum.is_over(now, orders, powered):
            with suppress(BusError):  # the streamer may have gone, and the drives with it
                self._process.order(Command.CLOSE)
            _say("has not begun to; the machine is stopped along its path and switched off")
        if number := self._ultimatum.unheard(now):
            _say(f"does not hear it (signal {number}): it is ended")
            os._exit(128 + number)

    def _give_up(self, what: str) -> None:
        with self._news:
            self._gone = BusError(
                f"the streamer process {self._process.pid} {what}; the drives stop by themselves"
            )
            self._news.notify_all()

    def _take(self) -> bool:
        """Hand on what is in the ring; return whether there was anything."""
        ring, found = self._process.ring, False
        ring.show_life()
        with self._news:
            for entry in ring.drain():
                found = True
                self._hand_on(entry)
            if found:
                self._gone = None
            self._news.notify_all()
        return found

    def _hand_on(self, entry: CycleEntry | EventEntry) -> None:
        if isinstance(entry, CycleEntry):
            self._latest = entry
            for witness in self.witnesses:
                witness.add_cycle(entry)
        else:
            if entry.kind not in _COMMON:
                self._events.append(entry)
            for witness in self.witnesses:
                witness.add_event(entry)
        try:
            for listener in self._listeners:
                if isinstance(entry, CycleEntry):
                    listener.add_cycle(entry)
                else:
                    listener.add_event(entry)
        except DuoglideError as error:
            self._failure, self._listeners = error, ()
        except Exception as error:  # of whatever kind: the run is stopped, and the others read on
            name = type(listener).__name__
            self._failure = DuoglideError(f"{name} could not take a record: {_words(error)}")
            self._failure.__cause__, self._listeners = error, ()


def _say(what: str) -> None:
    print(f"duoglide: told to end, this process {what}", file=sys.stderr, flush=True)


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
