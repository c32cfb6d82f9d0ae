"""What an operator sees of a machine at a glance, and what can be done with it now."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

from duoglide.control.channel.events import RunState
from duoglide.drives.cia402 import State

if TYPE_CHECKING:
    from duoglide.viewer.look import Look

_FAULTY = (State.FAULT, State.FAULT_REACTION_ACTIVE)


class Level(StrEnum):
    """How the banner is coloured."""

    IDLE = "idle"
    READY = "ready"
    MOVING = "moving"
    WAITING = "waiting"
    FAULT = "fault"


class Banner(NamedTuple):
    """What stands above the page.

    Attributes:
        word: What the machine is, in one or two words.
        level: Its colour.
        detail: More of it: the fault in words, the speed of a run.
        advice: The one thing to do next; empty where there is none.
        lamps: Connected, homed, powered; None where it is not known.
    """

    word: str
    level: Level
    detail: str
    advice: str
    lamps: tuple[bool | None, bool | None, bool | None]


class Allowed(NamedTuple):
    """Which buttons can act now."""

    connect: bool = False
    bring_up: bool = False
    reset: bool = False
    disable: bool = False
    run: bool = False
    small_moves: bool = False
    hold: bool = False
    resume: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """What a page knows of its machine.

    Attributes:
        own: Whether the machine is this process's; another one owns it otherwise.
        look: The last one; None before there is a connection.
        blind: Why there is none although there should be, in words.
        busy: What a command of this page is doing; empty where there is none.
        loaded: Whether a trajectory is ready to run.
        ended: How the last run ended before its end, in words; empty where it did not.
    """

    own: bool
    look: Look | None = None
    blind: str = ""
    busy: str = ""
    loaded: bool = False
    ended: str = ""

    @property
    def allowed(self) -> Allowed:
        """Which buttons can act."""
        look = self.look
        free = self.own and not self.busy
        if look is None or self.blind:
            return Allowed(connect=free and not self.blind, reset=free and bool(self.blind))
        state = look.run.state if look.run is not None else RunState.NONE
        hold = state in (RunState.RUNNING, RunState.WAITING)
        resume = state in (RunState.HOLDING, RunState.HELD)
        if not free or look.run is not None:
            return Allowed(hold=hold, resume=resume)
        faulty = self._faulty(look)
        ready = look.enabled and look.homed and not faulty
        return Allowed(
            bring_up=not faulty and not ready,
            reset=faulty,
            disable=look.enabled,
            run=ready and self.loaded,
            small_moves=ready,
        )

    @property
    def banner(self) -> Banner:
        """What stands above the page."""
        look = self.look
        if self.blind:
            return Banner("No answer", Level.FAULT, self.blind, self._wake(), (None, None, None))
        if look is None:
            advice = "" if self.busy else "Press Connect in the Machine tab"
            return Banner(self.busy or "Not connected", Level.IDLE, "", advice, (False, None, None))
        word, level, detail, advice = self._state(look)
        return Banner(word, level, detail, advice, (True, look.homed, look.enabled))

    def _wake(self) -> str:
        return "Mend the cause, then press Reset fault" if self.own else "Look at its owner"

    def _state(self, look: Look) -> tuple[str, Level, str, str]:
        if self._faulty(look):
            return self._fault(look)
        if look.run is not None:
            speed = f"speed {round(100.0 * look.run.rate)} %"
            word, level, advice = _RUNS[look.run.state]
            return word, level, speed, advice
        if self.busy:
            return self.busy, Level.MOVING, "", ""
        if not look.enabled or not look.homed:
            word = "No power" if not look.enabled else "Not homed"
            detail = "" if look.homed else f"position not known: {look.why_not_homed}"
            return word, Level.IDLE, detail, self._advise("Press Enable and home")
        advice = "Press Run" if self.loaded else "Plan a pick, or open a plan, in the Motion tab"
        if self.ended:
            return "Stopped", Level.WAITING, self.ended, self._advise(advice)
        return "Ready", Level.READY, "", self._advise(advice)

    def _fault(self, look: Look) -> tuple[str, Level, str, str]:
        faulty = [i for i, state in enumerate(look.states, start=1) if state in _FAULTY]
        drives = ", ".join(f"axis {number} is in fault" for number in faulty)
        detail = "; ".join(look.latched) or drives
        moving = look.run is not None and look.run.state not in (RunState.NONE, RunState.STOPPED)
        advice = "" if moving else self._advise("Mend the cause, then press Reset fault")
        return "Faulted", Level.FAULT, detail, advice

    def _advise(self, advice: str) -> str:
        return advice if self.own else "Its owner, another process, gives the orders"

    def _faulty(self, look: Look) -> bool:
        return bool(look.latched) or any(state in _FAULTY for state in look.states)


_RUNS = {
    RunState.NONE: ("Starting", Level.MOVING, ""),
    RunState.RUNNING: ("Running", Level.MOVING, ""),
    RunState.WAITING: ("Waiting for an input", Level.WAITING, ""),
    RunState.HOLDING: ("Coming to a hold", Level.WAITING, ""),
    RunState.HELD: ("Held", Level.WAITING, "Press Resume to go on, or Stop to end"),
    RunState.STOPPING: ("Stopping", Level.WAITING, ""),
    RunState.STOPPED: ("Stopped", Level.WAITING, ""),
    RunState.FINISHED: ("Finishing", Level.MOVING, ""),
}
