"""Everything that a connected machine holds: drives to talk to, the streamer, its reader."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from duoglide.arrays import AXES
from duoglide.control.channel.events import FIFO, Condition, Happening, Trip
from duoglide.control.channel.orders import Assignment, Policy, StreamSettings, TrailRule
from duoglide.control.host.background import Background
from duoglide.control.host.monitor import Monitor
from duoglide.control.host.process import StreamerProcess
from duoglide.drives import pdo
from duoglide.drives.axis.axis import Axis
from duoglide.drives.axis.configure import await_answer, no_answer
from duoglide.drives.axis.in_parallel import in_parallel
from duoglide.drives.bus.buses import BusKind, parse_bus
from duoglide.drives.bus.listen import quiet_time, require_alone
from duoglide.drives.bus.load import require_bus_load
from duoglide.drives.bus.network import open_network
from duoglide.drives.pdo import Nmt
from duoglide.drives.scale import Scale
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.errors import BusError, InputError
from duoglide.kinematics.home import home_carriages
from duoglide.machine import DriveSettings, Machine

if TYPE_CHECKING:
    from duoglide.control.channel.ring import EventEntry

HOST_PATIENCE = 1.0  # [s] that the streamer bears a host that does not read
_LISTENING_PATIENCE = 10.0  # [s] for a busy computer to do a tenth of a second of cycles
DEPARTURE = 0.2  # [mm] from which on a setpoint counts as lost


class Connection:
    """The drives' bus, the streamer and its reader; a resource: ``close`` it.

    Args:
        machine: Whose drives.
        bus: Name of the bus; ``virtual`` starts simulated drives at the machine's home.

    Raises:
        InputError: It is no machine.
        ConfigError: The bus cannot carry its cycle.
        BusError: The bus cannot be opened, or another host is on it.
    """

    def __init__(self, machine: Machine, bus: str) -> None:
        _require_machine(machine)
        require_bus_load(machine.drives)
        self._machine, self._closed = machine, False
        self._resources = ExitStack()
        self.simulated: SimulatedDrives | None = None
        if parse_bus(bus).kind is BusKind.VIRTUAL:
            start = home_carriages(machine).tolist()
            drives = SimulatedDrives(machine.drives, start)
            self.simulated = self._resources.enter_context(drives)
            bus = self.simulated.address
        else:
            require_alone(bus, machine.drives)
        self.bus = bus
        self.background = self._resources.enter_context(closing(Background()))
        self._start_stream()
        if self.simulated is None:
            self._require_company_of_none()

    def _require_company_of_none(self) -> None:
        """Refuse a bus on which another host has begun while this one listened.

        To start a streamer takes its time, so that it listens itself before its first SYNC. Two
        that begin in the same instant hear nobody; so each shows itself by its SYNC, without power,
        and listens once more before it writes to a drive: one of them, or both, give way.
        """
        try:
            self.monitor.wait_until(self._has_listened, _LISTENING_PATIENCE)
            if self._has_company():
                raise BusError(
                    f"bus {self.bus}: another host has begun at the same time. Two would pull at"
                    " the same carriages: end the other one, or begin again once it has given way"
                )
        except BaseException:
            self.close()
            raise

    def _has_listened(self) -> bool:
        latest = self.monitor.latest
        return self._has_company() or (latest is not None and latest.cycle > 2 * self._quiet)

    def _has_company(self) -> bool:
        return self.monitor.find(lambda event: event.kind == Happening.FOREIGN, 0) is not None

    def _start_stream(self) -> None:
        drives = self._machine.drives
        settings = describe_stream(self._machine)
        if self.simulated is None:
            settings = replace(settings, quiet=math.ceil(quiet_time(drives) / drives.cycle))
        self._quiet = settings.quiet
        assignment = Assignment(self.bus, drives.bit_rate, settings)
        try:
            self.process = StreamerProcess(assignment)
        except BaseException:
            self._resources.close()
            raise
        self.monitor = Monitor(self.process)

    def require_open(self) -> None:
        """Raise BusError once this has been closed."""
        if self._closed:
            raise BusError(
                f"the connection to bus {self.bus} is closed: Robot.connect() opens another"
            )

    @property
    def has_priority(self) -> bool:
        """Whether the kernel gives the streamer real-time priority, as it says when it is ready."""
        ready = self.monitor.find(lambda event: event.kind == Happening.READY, 0)
        return ready is not None and bool(ready.code & FIFO)

    @property
    def failed(self) -> bool:
        """Whether the streamer is gone or has lost the bus for good."""
        return not self.process.alive or self.monitor.find(_is_bus_failure, 0) is not None

    def restart(self) -> None:
        """Begin anew with another streamer, on the bus opened again.

        Raises:
            BusError: The bus cannot be opened.
        """
        self._stop_stream()
        self._start_stream()

    def _stop_stream(self) -> None:
        self.monitor.close()
        self.process.close(hopeless=self.monitor.streamer_is_gone)

    @contextmanager
    def axes(self) -> Iterator[tuple[Axis, ...]]:
        """Open the host's own connection, for objects; the streamer needs none of it."""
        self.require_open()
        with open_axes(self._machine, self.bus) as axes:
            yield axes

    def close(self) -> None:
        """End the streamer and the simulated drives; for good."""
        self._closed = True
        self._stop_stream()
        self._resources.close()


def _require_machine(value: object) -> None:
    if not isinstance(value, Machine):
        raise InputError(
            f"machine must be a duoglide.Machine, got {value!r:.80}; Machine.load(FILE) reads one"
        )


@contextmanager
def open_axes(machine: Machine, bus: str) -> Iterator[tuple[Axis, ...]]:
    """Open a CANopen connection to the three drives, and close it again.

    Raises:
        BusError: The bus cannot be opened, or has failed since.
    """
    with open_network(bus, machine.drives.bit_rate) as network:
        yield tuple(Axis(network, machine.drives, number) for number in range(1, AXES + 1))


def _is_bus_failure(event: EventEntry) -> bool:
    return event.kind == Happening.TRIP and Trip.from_event(event).condition is Condition.BUS


def travel_of(machine: Machine) -> tuple[float, float]:
    """Return how far carriages may go, which is what 0x607D is told [mm]."""
    end = machine.geometry.rail_half_length
    return -end, end


def bring_up(machine: Machine, axes: tuple[Axis, ...]) -> None:
    """Identify every drive, then configure every drive, then start them; power stays off.

    The drives are dealt with at the same time: a slow one does not keep the others waiting.

    Raises:
        DriveError: Drives are not what the machine file says, or do not keep what is written.
        DriveTimeout: A drive does not answer.
    """
    travel = travel_of(machine)
    speeds = machine.stop_limits.velocity.tolist()
    for axis, answers in zip(axes, in_parallel(axes, await_answer), strict=True):
        if not answers:
            raise no_answer(axis)
    in_parallel(axes, Axis.identify)
    in_parallel(axes, lambda axis: axis.configure(travel, speeds[axis.number - 1]))
    for axis in axes:
        axis.command(Nmt.START)


def describe_stream(machine: Machine) -> StreamSettings:
    """Return what the streamer has to know of a machine."""
    drives = machine.drives
    first, second, third = (_trail_rule(machine, index) for index in range(AXES))
    policy = Policy(
        heartbeat=math.ceil(drives.heartbeat_timeout / drives.cycle),
        host=math.ceil(HOST_PATIENCE / drives.cycle),
        missing=drives.missing_frames + 1,
        silence=drives.missing_frames + 1,
        late=drives.late_cycles + 1,
    )
    return StreamSettings(
        node_ids=drives.node_ids,
        cycle=round(drives.cycle * 1e9),
        host_node=drives.host_id,
        heartbeat_every=max(1, int(drives.heartbeat_period / drives.cycle)),
        policy=policy,
        inputs=_has_all(drives, pdo.TPDO2_MAPPING),
        outputs=_has_all(drives, pdo.RPDO2_MAPPING),
        trails=(first, second, third),
        settling=math.ceil(drives.settling_time / drives.cycle),
    )


def _trail_rule(machine: Machine, index: int) -> TrailRule:
    """Return how one carriage trails its setpoints, and how far it may be off."""
    drives = machine.drives
    scale = Scale.of(drives, index + 1)
    window = scale.magnitude(drives.following_error_window)
    step = float(machine.limits.velocity[index]) * drives.cycle  # in a cycle at full speed [mm]
    return TrailRule(
        lag=drives.lag[index] / drives.cycle,
        bend=drives.acceleration_lag[index] / drives.cycle**2,
        at_rest=scale.magnitude(drives.following_error_at_rest),
        growth=window / abs(step * scale.increments_per_mm),
        window=window,
        lasting=scale.magnitude(drives.lasting_error),
        departure=scale.magnitude(DEPARTURE),
        goal=scale.magnitude(drives.goal_tolerance),
        mm=abs(scale.to_mm(1)),
        tells=drives.quirks[index].follows_bit,
    )


def _has_all(
    drives: DriveSettings, mapping: tuple[tuple[int, int, int], ...]
) -> tuple[bool, bool, bool]:
    """Return of each drive whether it has all objects of a PDO, which is not mapped otherwise."""
    first, second, third = (
        all(quirks.has(index) for index, _, _ in mapping) for quirks in drives.quirks
    )
    return first, second, third
