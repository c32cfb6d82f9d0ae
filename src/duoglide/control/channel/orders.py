"""What the host tells the streamer: orders on one socket, whole objects on another."""

from __future__ import annotations

import math
import pickle
import socket
from dataclasses import dataclass, replace
from enum import IntEnum
from struct import Struct
from typing import NamedTuple


class Command(IntEnum):
    """What the host asks of the streamer."""

    POWER = 1  # argument: Power
    RUN = 2  # argument: number of the prepared setpoints; value: override
    HOLD = 3
    RESUME = 4
    OVERRIDE = 5  # value: 0 to 1
    STOP = 6
    QUICK_STOP = 7
    FORGET = 8  # the latched trips, on purpose
    OUTPUTS = 9  # argument: axis index; value: 0x60FE:1 as a whole number
    CLOSE = 10  # whatever moves stops along its path first, and the power goes off
    STANDSTILL = 11  # value: for how long simulated drives stand still with this computer [s]
    END = 12  # argument: number of the prepared setpoints after which nothing comes


class Power(IntEnum):
    """What the streamer wants of the drives' power."""

    SILENT = 0  # no setpoints are sent; somebody else may write controlwords
    OFF = 1
    ON = 2
    HOMING = 3  # on, while homing is prepared: bit 4 stays low
    QUICK_STOP = 4
    RESET = 5  # rising edges of bit 7 to whoever is in fault
    HOMING_START = 6  # on, with bit 4: whoever is in homing mode begins

    @property
    def homes(self) -> bool:
        """Whether the drives are in homing mode, or on their way there or back."""
        return self in (Power.HOMING, Power.HOMING_START)


class Order(NamedTuple):
    """One order; what ``argument`` and ``value`` mean depends on the ``Command``."""

    command: int
    argument: int = 0
    value: float = 0.0


ORDER = Struct("<IId")  # an Order on its socket


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
        host: Age of the host's last sign of life [cycles].
    """

    heartbeat: int
    host: int
    missing: int = 3
    silence: int = 3
    late: int = 3
    unsent: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class TrailRule:
    """How one carriage trails its setpoints, and how far it may be from where that puts it.

    Attributes:
        lag: By how many cycles of speed it trails.
        bend: By how many squared cycles of acceleration.
        at_rest: Distance that is allowed while the setpoints stand [increments].
        growth: Distance that is allowed more for each increment per cycle of speed [cycles].
        window: Distance that is allowed at most [increments].
        lasting: Distance that may stay, on an average [increments].
        departure: Distance from which on setpoints count as lost [increments].
        goal: Distance from the last setpoint at which a run has arrived [increments].
        mm: Size of an increment [mm].
        tells: Whether bit 12 of the statusword says that the drive follows.
    """

    lag: float = 0.0
    bend: float = 0.0
    at_rest: float = 1000.0
    growth: float = 2.0
    window: float = 15_000.0
    lasting: float = 700.0
    departure: float = 200.0
    goal: float = 300.0
    mm: float = 0.001
    tells: bool = True


@dataclass(frozen=True, slots=True)
class StreamSettings:
    """What the streamer has to know of the machine.

    Attributes:
        node_ids: Of the drives, in the order of the carriages.
        cycle: Period [ns].
        host_node: Node number that the host's heartbeat carries.
        heartbeat_every: Cycles between two heartbeats of the host.
        policy: What is bridged, and for how long.
        inputs: Whether each drive's TPDO2 is mapped as the contract has it; others are not read.
        outputs: Whether each drive's RPDO2 is; others are not written.
        trails: Of the carriages.
        quiet: Cycles at first in which only the bus is listened to; it stays so if another host is
            heard in them.
        settling: Cycles after the last setpoint within which all carriages have to arrive.
    """

    node_ids: tuple[int, int, int]
    cycle: int
    host_node: int
    heartbeat_every: int
    policy: Policy
    inputs: tuple[bool, bool, bool] = (True, True, True)
    outputs: tuple[bool, bool, bool] = (True, True, True)
    trails: tuple[TrailRule, TrailRule, TrailRule] = (TrailRule(), TrailRule(), TrailRule())
    settling: int = 250
    quiet: int = 0

    def allow_standstill(self, seconds: float) -> Policy:
        """Return the policy for drives that stand still with this computer, for so long.

        Silence of all drives at once then means that a process was not given a processor: the run
        survives what with real drives it would have to stop for.
        """
        silence = max(self.policy.silence, math.ceil(seconds * 1e9 / self.cycle))
        return replace(self.policy, silence=silence)


@dataclass(frozen=True, slots=True)
class Assignment:
    """What the streamer is told when it starts.

    Attributes:
        bus: Name of the bus.
        bit_rate: [bit/s].
        settings: Of the machine.
    """

    bus: str
    bit_rate: int
    settings: StreamSettings


_LENGTH = Struct("<Q")


def pack_object(thing: object) -> bytes:
    """Return what to send for an object: its length, then its pickle."""
    data = pickle.dumps(thing, pickle.HIGHEST_PROTOCOL)
    return _LENGTH.pack(len(data)) + data


def receive_object(end: socket.socket) -> object:
    """Read one object that ``pack_object`` has packed.

    Raises:
        EOFError: The other side is gone.
        OSError: The socket has failed, or its patience is over.
    """
    (length,) = _LENGTH.unpack(_receive(end, _LENGTH.size))
    return pickle.loads(_receive(end, length))


def _receive(end: socket.socket, size: int) -> bytes:
    parts = bytearray()
    while len(parts) < size:
        part = end.recv(min(size - len(parts), 1 << 20))
        if not part:
            raise EOFError("the other side is gone")
        parts += part
    return bytes(parts)
