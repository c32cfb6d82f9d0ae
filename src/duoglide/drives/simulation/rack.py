"""Several simulated drives on one bus, and their time.

The drives' clocks lock on to SYNC, as those of real drives do: from one SYNC to the next a whole
number of periods of 0x60C2 passes for them, however the host's scheduler shakes the frames. It is
one, and one more for each SYNC that the host has left out: for each whole period that the wall
clock has gone on and for which no SYNC waits behind this one. When SYNC stays away the wall clock
takes over, and with it the drives' own watchdogs.

A host may agree to move its schedule when the computer stands still (``standstill``). Then the
drives stand still with it: one period passes from each SYNC to the next, and the wall clock takes
over only after a longer silence, or once the host's connection is known to be gone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from duoglide.drives import pdo
from duoglide.drives.cia402 import State, decode
from duoglide.drives.simulation.firmware.homing import HomingAxis
from duoglide.drives.simulation.makers.axis import ForeignAxis
from duoglide.drives.simulation.makers.imitation import CONTRACT, Imitation
from duoglide.drives.simulation.node.node import DriveNode, Send
from duoglide.drives.simulation.plant import Plant, PlantParameters
from duoglide.drives.standstill import Standstill

if TYPE_CHECKING:
    from duoglide.drives.simulation.node.application import AxisApplication
    from duoglide.machine import DriveSettings

STANDSTILL = 0.1  # how long a shared computer may leave a process without a processor [s]
_NEGATIVE_SWITCH, _POSITIVE_SWITCH = 17, 18  # homing methods
_LATE = 2.5  # periods after which a SYNC counts as missing, not as late
_TARDY = 0.95  # of a period, up to which a SYNC is late and none has been left out
_LOCKING = 16  # SYNCs within which the drives' clock takes up most of a shift of SYNC
_UNLOCKED = 20.0  # periods after which nobody sends SYNC any more
_BUSY, _IDLE = 0.001, 0.005  # how often to look at the clock under power, and without [s]
_LONGEST_GAP = 1_000_000  # what a stopped process makes up for at most [us]


@dataclass(frozen=True, slots=True)
class DriveSnapshot:
    """What a simulated drive really does, seen from outside the bus.

    Attributes:
        position: Of its carriage [mm].
        velocity: Of its carriage [mm/s].
        state: Of its application.
        brake_released: Whether its brake is open.
        outputs: 0x60FE:1.
    """

    position: float
    velocity: float
    state: State
    brake_released: bool
    outputs: int


class DriveRack:
    """Drives that share a bus and a clock.

    Args:
        nodes: The drives.
        standstill: The one that these drives share.

    Attributes:
        nodes: The drives.
    """

    def __init__(self, nodes: Sequence[DriveNode], standstill: Standstill | None = None) -> None:
        self.nodes = tuple(nodes)
        self._standstill = standstill or Standstill()
        self._by_id = {node.node_id: node for node in nodes}
        self._wall: int | None = None  # the moment up to which time has passed [us]
        self._last_sync: int | None = None
        self._period = 1  # of SYNC, as the drives have it in 0x60C2 [us]
        self._since_sync = 0  # how much time has passed for the drives since then [us]

    def attach(self, send: Send) -> None:
        """Say where the drives' frames go."""
        for node in self.nodes:
            node.send = send

    @property
    def patience(self) -> float:
        """How long the bus may be silent before ``poll`` should be called [s]."""
        if self._last_sync is not None:  # as long as SYNC comes, nothing else need wake us
            return min(1.25e-6 * self._period, _IDLE)
        return _BUSY if any(node.axis.powered for node in self.nodes) else _IDLE

    def receive(self, can_id: int, data: bytes, now: int, behind: int = 0) -> None:
        """Take a frame at ``now`` [us]; so many SYNCs are known to wait ``behind`` it."""
        if can_id == pdo.SYNC:
            self._synchronise(now, behind)
        if pdo.TPDO1 <= can_id < pdo.HEARTBEAT:  # process data and SDO are for one node
            node = self._by_id.get(can_id & 0x7F)
            if node is not None:
                node.receive(can_id, data)
            return
        for node in self.nodes:
            node.receive(can_id, data)

    @property
    def _bearing(self) -> int:
        """For how long SYNC may stay away before time passes for the drives [us]."""
        return round(self._standstill.seconds * 1e6) if self._standstill.agreed else 0

    def poll(self, now: int) -> None:
        """Let the wall clock pass; call it once no frame is waiting."""
        if self._last_sync is not None:
            silence = now - self._last_sync
            if silence <= max(_LATE * self._period, self._bearing):
                return
            if silence > max(_UNLOCKED * self._period, self._bearing):
                self._last_sync = None
        self._pass_to(now)

    def abandon(self) -> None:
        """Whoever sent SYNC is gone: from now on it is the wall clock that counts."""
        self._last_sync = None
        self._standstill.agreed = False

    def _synchronise(self, now: int, behind: int) -> None:
        self._period = max([node.axis.period for node in self.nodes])
        if self._last_sync is None or self._wall is None or self._since_sync >= self._period:
            self._pass_to(now)
        elif self._bearing:
            self._pass(self._period - self._since_sync)
            self._wall = now
        else:
            gone = int((now - self._wall) / self._period + 1.0 - _TARDY)
            periods = max(gone - behind, 1)
            self._pass(periods * self._period - self._since_sync)
            self._wall += periods * self._period
            if not behind:
                self._wall += (now - self._wall) // _LOCKING
        self._last_sync = now
        self._since_sync = 0

    def _pass_to(self, now: int) -> None:
        if self._wall is None:
            self._wall = now
        elif now > self._wall:
            self._pass(min(now - self._wall, _LONGEST_GAP))
            self._wall = now

    def _pass(self, dt: int) -> None:
        self._since_sync += dt
        for node in self.nodes:
            node.advance(dt)

    def snapshot(self) -> tuple[DriveSnapshot, ...]:
        """Return what the drives really do."""
        return tuple(
            DriveSnapshot(
                position=node.plant.position,
                velocity=node.plant.velocity,
                state=decode(node.axis.statusword),
                brake_released=node.axis.brake_released,
                outputs=node.axis.read(0x60FE, 1),
            )
            for node in self.nodes
        )


def build_rack(
    settings: DriveSettings,
    positions: Sequence[float],
    plants: Sequence[PlantParameters] | None = None,
    make_axis: Callable[[], AxisApplication] = HomingAxis,
    standstill: float = STANDSTILL,
    *,
    imitations: Sequence[Imitation] = (CONTRACT, CONTRACT, CONTRACT),
) -> DriveRack:
    """Build the three drives of a machine, switched on and not homed.

    Args:
        settings: Node numbers, scale and direction.
        positions: Where the carriages stand [mm], three values.
        plants: What hangs on each drive; three, or None for the default.
        make_axis: Makes the firmware's application of one drive.
        standstill: For how long they stand still with a host that agrees to it, and as long as
            they wait for setpoints at the least; 0 for never [s].
        imitations: In what each drive differs from the contract; those have an application of
            their own.
    """
    shared = Standstill(max(standstill, settings.setpoint_patience) if standstill else 0.0)
    nodes = []
    for i, node_id in enumerate(settings.node_ids):
        scale = settings.direction[i] * settings.increments_per_mm[i]
        parameters = plants[i] if plants is not None else PlantParameters()
        plant = Plant(_with_switch(parameters, settings, i))
        plant.position = float(positions[i])
        imitation = imitations[i]
        make = make_axis if imitation == CONTRACT else partial(ForeignAxis, imitation)
        nodes.append(DriveNode(node_id, make, plant, scale, shared, imitation=imitation))
    return DriveRack(nodes, shared)


def _with_switch(parameters: PlantParameters, settings: DriveSettings, i: int) -> PlantParameters:
    """Put the limit switch that homing searches where the machine file says that it is."""
    method, place = settings.homing.method[i], settings.homing.switch_position[i]
    if method not in (_NEGATIVE_SWITCH, _POSITIVE_SWITCH):
        return parameters
    low, high = parameters.limit_switches
    at_low = (method == _NEGATIVE_SWITCH) == (settings.direction[i] > 0)
    return replace(parameters, limit_switches=(place, high) if at_low else (low, place))
