"""What the streamer tells the host: what has happened, and why it stops or refuses an order."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

from duoglide.control.channel.ring import EventEntry
from duoglide.drives.cia402 import emergency_words

FIFO = 1
"""Bit of the code of ``Happening.READY``: the stream has real-time priority."""


class Happening(IntEnum):
    """What the streamer tells beside its cycles; fields of ``EventEntry`` in brackets."""

    READY = 1  # [code: bits of Privileges]
    POWER = 3  # the goal has changed [detail: Power; value 1: and has been reached]
    STARTED = 4  # [detail: Phase; value: number of the prepared setpoints]
    FINISHED = 5  # [detail: Phase; value: path time]
    STOPPED = 6  # [detail: Phase; code 1: the drives stop by themselves; value: path time]
    ORDER = 7  # an order was carried out [detail: Command; value]
    REFUSED = 8  # an order was not [detail: Command; axis; code: Refusal]
    TRIP = 9  # see Trip
    EMERGENCY = 10  # [axis, code]
    OUTPUT = 11  # [axis, code: the word]
    INPUT = 12  # a wait has ended [axis, detail: bit, value: seconds waited]
    INPUT_TIMEOUT = 13  # [axis, detail: bit, value: seconds waited]
    LATE = 14  # cycles were skipped [value: how many]
    FOREIGN = 16  # another host is on the bus, while this one has no power yet
    LOST = 15  # setpoints did not act [axis, code: how many; value: how far off at worst, mm]
    PART = 17  # the next setpoints have taken over [code 1: in motion; value: their number]
    AWAITED = 18  # the next setpoints came late [value: for how long the motion rested, s]


class RunState(IntEnum):
    """What a run is doing."""

    NONE = 0
    RUNNING = 1
    WAITING = 2
    HOLDING = 3
    HELD = 4
    STOPPING = 5
    STOPPED = 6
    FINISHED = 7


class Refusal(IntEnum):
    """Why an order was not carried out."""

    NOT_LOADED = 1
    NOT_ENABLED = 2
    LATCHED = 3
    BUSY = 4
    ELSEWHERE = 5
    MOVING = 6

    @property
    def words(self) -> str:
        """Say it."""
        return _REFUSALS[self]


_REFUSALS = {
    Refusal.NOT_LOADED: "its setpoints have not been handed over",
    Refusal.NOT_ENABLED: "the drives are not enabled",
    Refusal.LATCHED: "a stop is latched",
    Refusal.BUSY: "a run is in progress",
    Refusal.ELSEWHERE: "the setpoint held is not where the run begins",
    Refusal.MOVING: "its setpoints begin in motion",
}


class Reaction(IntEnum):
    """What to do, the milder first; a reaction under way only ever gets stronger."""

    NONE = 0
    STOP_ON_PATH = 1
    STOP_AND_DISABLE = 2  # stop on the path, then take the power off in order
    QUICK_STOP = 3


class Condition(Enum):
    """What can go wrong; the value says it in words."""

    EMERGENCY = "emergency message"
    FAULT = "drive in fault"
    UNDEFINED = "statusword matches no state"
    NOT_ENABLED = "drive has left operation enabled by itself"
    FOLLOWING_ERROR = "following error"
    NOT_FOLLOWING = "drive does not follow its setpoints"
    LIMIT = "drive's internal limit is active"
    SILENT = "no feedback"
    HEARTBEAT = "no heartbeat"
    NMT = "drive is not operational"
    BOOT_UP = "drive has rebooted; its position reference is lost"
    LATE = "late cycles in a row"
    UNSENT = "frames could not be sent"
    BUS = "bus has failed"
    HOST_GONE = "host process is gone"
    HOST_SILENT = "host process does not answer"
    REFUSED = "setpoint outside travel or step limit"
    PRESSED = "quick stop was commanded"
    FOREIGN = "another host commands the drives"
    LASTING = "carriage stays away from where its setpoints lead"
    LOST = "setpoints do not act, or something holds the carriage"
    ASTRAY = "carriage has not arrived at the last setpoint"
    UNLED = "drive that brakes by itself cannot be followed along the path any more"

    @property
    def concerns_bus(self) -> bool:
        """Whether it is the bus that has failed, and not a drive."""
        return self in (Condition.BUS, Condition.UNSENT, Condition.FOREIGN)


_CONDITIONS = tuple(Condition)
_INDICES = {condition: index for index, condition in enumerate(_CONDITIONS)}


@dataclass(frozen=True, slots=True)
class Trip:
    """A condition that was met, and the reaction to it.

    Attributes:
        condition: What.
        reaction: What follows.
        axis: Which carriage, 1 to 3; 0 for all.
        code: CiA 301 emergency error code, 0 for none.
    """

    condition: Condition
    reaction: Reaction
    axis: int = 0
    code: int = 0

    @classmethod
    def from_event(cls, event: EventEntry) -> Trip:
        """Read a trip back from its event."""
        return cls(_CONDITIONS[event.detail], Reaction(int(event.value)), event.axis, event.code)

    def to_fields(self) -> tuple[int, int, int, float]:
        """Return what its event carries: ``axis``, ``detail``, ``code`` and ``value``."""
        return self.axis, _INDICES[self.condition], self.code, float(self.reaction)

    @property
    def words(self) -> str:
        """Say it: axis, condition, code in words."""
        where = f"axis {self.axis}: " if self.axis else ""
        code = f" 0x{self.code:04X}: {emergency_words(self.code)}" if self.code else ""
        return f"{where}{self.condition.value}{code}"
