"""When and how to stop: a pure policy, from what one cycle saw to what must happen.

The streamer fills an ``Observation`` every cycle and asks ``assess``. Nothing here knows a bus, a
clock or a process, so every row of the table can be tested by itself.

Two stops exist. A *stop on the path* slows the path time down: all three carriages come to rest
together on the planned curve. It needs three drives that follow setpoints. Where one does not, a
*quick stop* tells every drive to brake by itself at its own 0x6085; a brake-safe plan has proved
that clearance is kept while they do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum, IntEnum

from duoglide.arrays import AXES
from duoglide.drives.cia402 import State, Status, emergency_words
from duoglide.drives.pdo import NmtState


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


@dataclass(frozen=True, slots=True)
class Policy:
    """How much is bridged before it counts.

    Attributes:
        missing: Feedbacks missing in a row, of one drive while another answers; or cycles in a
            row in which it bounds what it is asked for.
        silence: Feedbacks missing in a row, of all drives.
        late: Late cycles in a row.
        unsent: Cycles in a row whose frames could not be sent.
        heartbeat: Age of a drive's last heartbeat [cycles].
        following: Following error per axis [increments].
        host: Age of the parent's last sign of life [cycles].
    """

    heartbeat: int
    following: tuple[int, int, int]
    host: int
    missing: int = 3
    silence: int = 3
    late: int = 3
    unsent: int = 3


@dataclass(slots=True)
class AxisView:
    """What a cycle saw of one drive; written anew every cycle, never kept."""

    state: State | None = State.SWITCH_ON_DISABLED
    statusword: int = 0
    emergency: int = 0
    following: int = 0
    missing: int = 0
    alone: int = 0  # of those missing, while another drive answered
    heartbeat: int = 0
    limited: int = 0  # cycles in a row with bit 11
    nmt: int = NmtState.OPERATIONAL
    booted: bool = False


@dataclass(slots=True)
class Observation:
    """What a cycle saw; written anew every cycle, never kept.

    Attributes:
        axes: The three drives.
        enabled: All three have been enabled by this streamer, and not told otherwise.
        moving: A trajectory is running.
        late: Late cycles in a row.
        unsent: Cycles in a row whose frames could not be sent.
        bus_failed: The link is dead, or the controller is bus-off or error-passive.
        host_gone: The host process has ended.
        host: Age of its last sign of life [cycles].
        refused: Axis whose setpoint broke a rule, 1 to 3; 0 for none.
        pressed: Quick stop was commanded.
        foreign: Somebody else has sent SYNC, a setpoint, or a heartbeat as this host.
    """

    axes: tuple[AxisView, ...] = field(default_factory=lambda: tuple(AxisView() for _ in range(3)))
    enabled: bool = False
    moving: bool = False
    late: int = 0
    unsent: int = 0
    bus_failed: bool = False
    host_gone: bool = False
    host: int = 0
    refused: int = 0
    pressed: bool = False
    foreign: bool = False


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

    @property
    def words(self) -> str:
        """Say it: axis, condition, code in words."""
        where = f"axis {self.axis}: " if self.axis else ""
        code = f" 0x{self.code:04X}: {emergency_words(self.code)}" if self.code else ""
        return f"{where}{self.condition.value}{code}"


_FOLLOWING_ERROR = int(Status.FOLLOWING_ERROR)  # plain numbers: an IntFlag's & costs 1.5 us
_FOLLOWS = int(Status.FOLLOWS_COMMAND)


def assess(seen: Observation, policy: Policy) -> Iterator[Trip]:
    """Yield every condition that this cycle met, with the reaction that it asks for.

    While nothing is enabled only what concerns the bus, the host and lost references is reported:
    a drive that is switched off may be in fault, silent or absent without anybody stopping.
    """
    yield from _of_the_host(seen, policy)
    for index in range(AXES):
        yield from _of_an_axis(index, seen, policy)


def _of_the_host(seen: Observation, policy: Policy) -> Iterator[Trip]:
    if seen.host_gone:
        yield Trip(Condition.HOST_GONE, Reaction.STOP_AND_DISABLE)
    if seen.pressed:
        yield Trip(Condition.PRESSED, Reaction.QUICK_STOP)
    if seen.bus_failed:
        yield Trip(Condition.BUS, Reaction.QUICK_STOP)
    if not seen.enabled:
        return
    if seen.foreign:
        yield Trip(Condition.FOREIGN, Reaction.QUICK_STOP)
    if seen.refused:
        yield Trip(Condition.REFUSED, Reaction.QUICK_STOP, seen.refused)
    if seen.unsent >= policy.unsent:
        yield Trip(Condition.UNSENT, Reaction.STOP_ON_PATH)
    if seen.moving and seen.late >= policy.late:
        yield Trip(Condition.LATE, Reaction.STOP_ON_PATH)
    if seen.moving and seen.host >= policy.host:
        yield Trip(Condition.HOST_SILENT, Reaction.STOP_ON_PATH)


def _of_an_axis(index: int, seen: Observation, policy: Policy) -> Iterator[Trip]:
    """Yield what one drive shows; the reaction depends on whether it still follows setpoints."""
    axis, number = seen.axes[index], index + 1
    if axis.booted:
        yield Trip(Condition.BOOT_UP, Reaction.QUICK_STOP, number)
    if not seen.enabled:
        return
    follows = axis.state is State.OPERATION_ENABLED
    stop = Reaction.STOP_ON_PATH if follows else Reaction.QUICK_STOP
    if axis.emergency:
        yield Trip(Condition.EMERGENCY, stop, number, axis.emergency)
    if not follows:
        yield Trip(_NOT_ENABLED.get(axis.state, Condition.NOT_ENABLED), stop, number)
        return
    if axis.statusword & _FOLLOWING_ERROR or axis.following > policy.following[index]:
        yield Trip(Condition.FOLLOWING_ERROR, stop, number)
    if axis.limited >= policy.missing:  # for less, it caught up with setpoints that were lost
        yield Trip(Condition.LIMIT, stop, number)
    if axis.alone >= policy.missing or axis.missing >= policy.silence:
        yield Trip(Condition.SILENT, stop, number)
    if axis.heartbeat >= policy.heartbeat:
        yield Trip(Condition.HEARTBEAT, stop, number)
    if axis.nmt != NmtState.OPERATIONAL:
        yield Trip(Condition.NMT, Reaction.QUICK_STOP, number)
    if seen.moving and not axis.statusword & _FOLLOWS:
        yield Trip(Condition.NOT_FOLLOWING, Reaction.QUICK_STOP, number)


_NOT_ENABLED: dict[State | None, Condition] = {
    None: Condition.UNDEFINED,
    State.FAULT: Condition.FAULT,
    State.FAULT_REACTION_ACTIVE: Condition.FAULT,
}
