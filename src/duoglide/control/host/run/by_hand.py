"""The platform moved by hand: short parts of a program, each with its way to rest behind it.

Every part is one step of ``Jog``, made just before the streamer comes to the end of the one before.
What the operator asks for counts for a short while only: a part that is not made is not missed,
as the way to rest of the last one is followed then.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from duoglide.control.channel.events import RunState
from duoglide.control.channel.setpoints import Fence
from duoglide.control.host.run.parts import PlannedPart, prepare_planned
from duoglide.errors import DuoglideError, InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from duoglide.control.channel.ring import CycleEntry
    from duoglide.control.host.run.handle import RunHandle
    from duoglide.control.host.run.report import RunReport
    from duoglide.machine import Machine
    from duoglide.planning.trajectory import Trajectory
    from duoglide.planning.transfer.jog import Jog

STEP = 0.06  # [s] that a part lasts
DEAD_MAN = 0.15  # [s] after an order the platform begins to stop, at the latest
_AHEAD = 0.04  # [s] before the end of a part the next one is made
_LATEST = 0.008  # [s] before the end of a part the next one must be there
_FRESH = DEAD_MAN - STEP - _AHEAD  # [s] for which an order counts
_LOOK = 0.002  # [s]


class JogSource:
    """Makes a part whenever one is due; see ``feed.Source``.

    Args:
        machine: That moves.
        jog: From where it stands.
        latest: Returns the newest cycle of the streamer.
        now: Returns the time [s]; tests bring another clock.

    Attributes:
        failure: Why no more parts come; None: nothing has gone wrong.
    """

    def __init__(
        self,
        machine: Machine,
        jog: Jog,
        latest: Callable[[], CycleEntry | None],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.failure: DuoglideError | None = None
        self._jog, self._latest, self._now = jog, latest, now
        self._asking = threading.Lock()
        self._wish: tuple[float, float, float] = (0.0, 0.0, 0.0)
        self._until = 0.0
        self._closed = False
        self._fence = Fence.of(machine)
        self._made: list[Trajectory] = []  # the newest part
        self._told = 0  # number of the setpoints before it
        self._take_back: Callable[[], None] = lambda: None

    @property
    def blocked(self) -> str:
        """What keeps the wish from being followed; empty while nothing does."""
        return self._jog.blocked

    def aim(self, velocity: ArrayLike) -> None:
        """Ask for a velocity of the platform [mm/s], shape (3,); it counts for a short while.

        Raises:
            InputError: Not three finite numbers.
        """
        with self._asking:
            self._jog.aim(velocity)
            self._until = self._now() + _FRESH

    def take(self) -> PlannedPart | None:
        """Wait until a part is due, and return it; None once this is closed."""
        while not self._closed:
            part = self.make_if_due()
            if part is not None:
                return part
            time.sleep(_LOOK)
        return None

    def close(self) -> None:
        """Make no more parts."""
        self._closed = True

    def make_if_due(self) -> PlannedPart | None:
        """Make the next part where it is wished, and where it is time for it."""
        entry = self._latest()
        if not self._made:
            return self._make(None, None)
        if entry is None or not entry.run:
            return None
        if entry.state == RunState.WAITING:
            if entry.run == self._told:  # the newest part came too late, and is none
                self._take_back()
            self._jog.rest()
            return self._make(None, entry.run)
        left = STEP - entry.path_time
        if entry.run == self._told or not _LATEST < left <= _AHEAD:
            return None
        part = self._make(self._made[-1], entry.run)
        now = self._latest()
        if part is None or (now is not None and STEP - now.path_time > _LATEST):
            return part
        self._take_back()
        return None

    def _make(self, before: Trajectory | None, after: int | None) -> PlannedPart | None:
        """Make the next part; None where none is wished, or may be made."""
        with self._asking:
            self._take_back = self._jog.keep()
            step = self._jog.move() if self._now() < self._until else None
        if step is None:
            return None
        part = prepare_planned(step, self._fence, 1, before)
        self._made, self._told = [step], after or 0
        return replace(part, after=after, prepared=replace(part.prepared, passing=True))


class JogHandle:
    """A machine that is moved by hand. Made by ``Robot.start_jog``.

    Args:
        run: The run.
        source: Of its parts.
    """

    def __init__(self, run: RunHandle, source: JogSource) -> None:
        self.run, self._source = run, source

    def aim(self, velocity: ArrayLike) -> None:
        """Go on at this velocity of the platform [mm/s], shape (3,), from any thread.

        Whoever does not ask again within 50 ms lets go: then the platform begins to stop, 150 ms
        after the last order at the latest. It is shortened to the limit of speed, and followed as
        far as the machine may go: see ``blocked``.

        Raises:
            InputError: Not three finite numbers.
            DuoglideError: It has ended.
        """
        if self.run.done:
            raise InputError("the machine is not moved by hand any more: start_jog() begins again")
        self._source.aim(velocity)

    @property
    def blocked(self) -> str:
        """What keeps the order from being followed, as ``travel``; empty while nothing does."""
        return self._source.blocked

    @property
    def moving(self) -> bool:
        """Whether the platform moves."""
        return self.run.status.state is RunState.RUNNING

    def stop(self) -> RunReport:
        """Let go, wait until the platform rests, and end it; the drives stay on."""
        self.run.stop()
        return self.run.wait()
