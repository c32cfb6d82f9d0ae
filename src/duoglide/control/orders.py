"""What passes between the host process and the streamer: orders one way, records the other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from duoglide.control.program import Program
    from duoglide.control.ring import CycleEntry, EventEntry
    from duoglide.control.supervise import Policy


class Command(IntEnum):
    """What the host asks of the streamer."""

    POWER = 1  # argument: Power
    RUN = 2  # argument: number of the program; value: override
    HOLD = 3
    RESUME = 4
    OVERRIDE = 5  # value: 0 to 1
    STOP = 6
    QUICK_STOP = 7
    FORGET = 8  # the latched trips, on purpose
    OUTPUTS = 9  # argument: axis index; value: 0x60FE:1 as a whole number
    CLOSE = 10  # whatever moves stops along its path first, and the power goes off
    STANDSTILL = 11  # value: for how long simulated drives stand still with this computer [s]


class Refusal(IntEnum):
    """Why an order was not carried out."""

    NOT_LOADED = 1
    NOT_ENABLED = 2
    LATCHED = 3
    BUSY = 4
    ELSEWHERE = 5

    @property
    def words(self) -> str:
        """Say it."""
        return _REFUSALS[self]


_REFUSALS = {
    Refusal.NOT_LOADED: "the program has not been handed over",
    Refusal.NOT_ENABLED: "the drives are not enabled",
    Refusal.LATCHED: "a stop is latched",
    Refusal.BUSY: "a motion is in progress",
    Refusal.ELSEWHERE: "the setpoint held is not where the motion begins",
}


class Happening(IntEnum):
    """What the streamer tells beside its cycles; fields of ``EventEntry`` in brackets."""

    READY = 1  # [code: bits of Granted]
    POWER = 3  # the goal has changed [detail: Power; value 1: and has been reached]
    STARTED = 4  # [detail: Phase; value: number of the program]
    FINISHED = 5  # [detail: Phase; value: path time]
    STOPPED = 6  # [detail: Phase; code 1: the drives brake by themselves; value: path time]
    ORDER = 7  # an order was carried out [detail: Command; value]
    REFUSED = 8  # an order was not [detail: Command; axis; code: Refusal]
    TRIP = 9  # [axis, detail: index of the Condition, code: of the emergency, value: Reaction]
    EMERGENCY = 10  # [axis, code]
    OUTPUT = 11  # [axis, code: the word]
    INPUT = 12  # a wait has ended [axis, detail: bit, value: seconds waited]
    INPUT_TIMEOUT = 13  # [axis, detail: bit, value: seconds waited]
    LATE = 14  # cycles were skipped [value: how many]


Order = tuple[int, int, float]  # command, argument, value


class Inbox(Protocol):
    """Where the host's orders come from."""

    def orders(self) -> Sequence[Order]:
        """Return the orders that have come, without waiting."""
        ...

    def program(self, number: int) -> Program | None:
        """Return a program that has been handed over; None if it has not."""
        ...

    @property
    def host_gone(self) -> bool:
        """Whether the host process has ended."""
        ...


class Outbox(Protocol):
    """Where records go: a ``Ring``, or a list in tests."""

    def put_cycle(self, entry: CycleEntry) -> None:
        """Keep the record of a cycle."""
        ...

    def put_event(self, entry: EventEntry) -> None:
        """Keep the record of an event."""
        ...

    @property
    def signs_of_life(self) -> int:
        """A number that changes while somebody reads."""
        ...


@dataclass(frozen=True, slots=True)
class StreamSettings:
    """What the streamer has to know of the machine.

    Attributes:
        node_ids: Of the drives, in the order of the carriages.
        cycle: Period [ns].
        host_node: Node number that the host's heartbeat carries.
        heartbeat_every: Cycles between two heartbeats of the host.
        policy: What is bridged, and for how long.
    """

    node_ids: tuple[int, int, int]
    cycle: int
    host_node: int
    heartbeat_every: int
    policy: Policy

    def policy_standing_still(self, seconds: float) -> Policy:
        """Return the policy for drives that stand still with this computer, for so long.

        Silence of all drives at once then means that a process was not given a processor: the run
        survives what with real drives it would have to stop for.
        """
        silence = max(self.policy.silence, math.ceil(seconds * 1e9 / self.cycle))
        return replace(self.policy, silence=silence)
