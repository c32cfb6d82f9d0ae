"""Power and position reference of the three drives."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import AXES
from duoglide.control.channel.events import Happening, Refusal, Trip
from duoglide.control.channel.orders import Command, Power
from duoglide.control.channel.scale import Scales
from duoglide.control.host.connection import Connection, bring_up, travel_of
from duoglide.control.host.reference import PositionReference, look_at
from duoglide.control.host.trace import Trace
from duoglide.drives.axis.axis import Axis, growing_pauses
from duoglide.drives.axis.in_parallel import in_parallel
from duoglide.drives.cia402 import METHODS_HERE, Mode, State, Status, decode
from duoglide.errors import BusError, DriveError, DriveTimeout, NotHomedError
from duoglide.kinematics.home import home_carriages

if TYPE_CHECKING:
    from duoglide.arrays import FloatArray
    from duoglide.control.channel.ring import CycleEntry, EventEntry
    from duoglide.machine import Machine

_PATIENCE = 5.0  # [s] for a change of power
_SAYING = 1.0  # [s] for a drive under power to say that it follows
_OFF = (State.SWITCH_ON_DISABLED, State.FAULT, State.NOT_READY_TO_SWITCH_ON)
_FAULTY = (State.FAULT, State.FAULT_REACTION_ACTIVE)


class Drivetrain:
    """Three drives that are switched, homed and reset as one.

    Args:
        machine: Whose drives.
        connection: To them.

    Attributes:
        trace: What they did in the last seconds.
    """

    def __init__(self, machine: Machine, connection: Connection) -> None:
        self.machine = machine
        self.scales = Scales.of(machine.drives)
        self._connection = connection
        self._reference = PositionReference(
            machine, connection.bus, kept=connection.simulated is None
        )
        self.trace = Trace(machine.drives)
        self._reset_at = 0
        self._listen()

    # What it is

    @property
    def latest(self) -> CycleEntry:
        """The newest cycle.

        Raises:
            BusError: The connection is closed.
            DriveError: None has come yet.
        """
        self._connection.require_open()
        entry = self._connection.monitor.latest
        if entry is None:
            raise DriveError("nothing has been heard of the drives yet")
        return entry

    @property
    def enabled(self) -> bool:
        """Whether all three drives are under power and follow setpoints."""
        entry = self._connection.monitor.latest
        return (
            entry is not None
            and entry.power == Power.ON
            and all(decode(word) is State.OPERATION_ENABLED for word in entry.statusword)
        )

    @property
    def latched(self) -> tuple[Trip, ...]:
        """What has tripped since the last reset."""
        events = self._connection.monitor.events(self._reset_at)
        return tuple(Trip.from_event(event) for event in events if _is_trip(event))

    @property
    def homed(self) -> bool:
        """Whether the position reference is known; a drive that reboots loses it."""
        return self._reference.known

    @property
    def why_not_homed(self) -> str:
        """Why the position reference is not known; empty where it is."""
        return self._reference.why

    def require_homed(self) -> None:
        """Raise NotHomedError unless the position reference is known; BusError once closed."""
        self._connection.require_open()
        if not self.homed:
            raise NotHomedError(
                f"the position reference is not known, {self._reference.why}: home the machine"
                " first"
            )

    def require_reference(self, confirm: bool) -> None:
        """Raise NotHomedError where somebody has to look at the machine before it is homed.

        Args:
            confirm: Whether somebody has.
        """
        if confirm or self.homed or self._reference.simulated:
            return
        raise NotHomedError(
            f"the position reference is not known, {self._reference.why}; {self._ask_to_look()}"
        )

    def _ask_to_look(self) -> str:
        """Say what homing takes for granted, and how to confirm it."""
        methods = self.machine.drives.homing.method
        goals = ", ".join(f"{goal:.3f}" for goal in self._goals())
        if not METHODS_HERE.issuperset(methods):
            return (
                f"homing by methods {list(methods)} moves the carriages: home on purpose, with"
                " robot.home(confirm=True) or --home-here"
            )
        return (
            f"homing by method {methods[0]} takes the place where the machine stands for its home"
            f" pose, carriages at {goals} mm: see that it stands there, then confirm it with"
            " robot.home(confirm=True) or --home-here"
        )

    def require_power(self, what: str) -> None:
        """Raise DriveError unless the drives are enabled and no stop is latched; say which."""
        if why := "; ".join(trip.words for trip in self.latched):
            raise DriveError(f"{what} needs power: reset_fault() and enable() after {why}")
        if not self.enabled:
            raise DriveError(f"{what} needs power: enable() the drives first")

    @property
    def carriages(self) -> FloatArray:
        """Where the drives say that the carriages are [mm], shape (3,)."""
        return np.array(self.scales.mm(self.latest.actual))

    @property
    def held(self) -> FloatArray:
        """Where the setpoints hold the carriages [mm], shape (3,)."""
        return np.array(self.scales.mm(self.latest.setpoint))

    @property
    def expected(self) -> FloatArray | None:
        """Where setpoints will hold the carriages once the drives have power and are homed [mm].

        None where homing moves them and finds out.
        """
        if self.homed:
            return self.held if self.enabled else self.carriages
        if METHODS_HERE.issuperset(self.machine.drives.homing.method):
            return np.array(self._goals())
        return None

    def axes(self) -> AbstractContextManager[tuple[Axis, ...]]:
        """Open a connection for the drives' objects."""
        return self._connection.axes()

    # Bring-up and power

    def bring_up(self) -> None:
        """Identify and configure the drives, and start their cyclic frames; power stays off."""
        with self.axes() as axes:
            self._bring_up(axes)
        if not self._connection.monitor.wait_for(lambda entry: not entry.missing, _PATIENCE):
            raise self._unanswered(self.latest.missing)
        self._reset_at = self._connection.monitor.mark  # drives may have booted meanwhile

    def _listen(self) -> None:
        self._reference.begin()
        self._connection.monitor.witnesses = (self._reference, self.trace)

    def _bring_up(self, axes: tuple[Axis, ...], heard: bool = False) -> None:
        in_parallel(axes, Axis.wait_for_boot)
        seen = in_parallel(axes, look_at)
        bring_up(self.machine, axes)
        standstill = min(axis.ask_standstill() for axis in axes)
        self._connection.process.order(Command.STANDSTILL, 0, standstill)
        self._reference.judge(seen, [axis.read(0x1017) for axis in axes], heard)

    def _unanswered(self, missing: int) -> DriveTimeout:
        """Make the error for drives that do not answer SYNC; bit i of ``missing`` is axis i + 1."""
        nodes = enumerate(self.machine.drives.node_ids, start=1)
        silent = [(axis, node) for axis, node in nodes if missing >> (axis - 1) & 1]
        names = ", ".join(f"axis {axis} (node {node})" for axis, node in silent)
        return DriveTimeout(
            f"{names}: operational, but SYNC is not answered with feedback (TPDO1)",
            axis=silent[0][0] if len(silent) == 1 else 0,
        )

    def enable(self) -> None:
        """Bring all three drives under power, holding where they stand."""
        with self.axes() as axes:
            for axis in axes:
                if axis.safe_torque_off():
                    said = axis.quirks.interlock
                    raise axis.error(
                        f"safe torque off is active, bit 3 of 0x60FD is {said}; close its circuit"
                        f' first. If it is closed, drives.quirks interlock = "{said.other}", or'
                        ' "none", says what that bit means',
                        0x5441,
                    )
                if axis.read_state() is State.FAULT:
                    raise axis.fault()
                axis.set_mode(Mode.CYCLIC_SYNCHRONOUS_POSITION)
            self._reference.note_power(True, self.latest.actual)
            self._switch(Power.ON, (State.OPERATION_ENABLED,))
            self._require_following(axes)

    def _require_following(self, axes: tuple[Axis, ...]) -> None:
        """Take the power off again from a drive that does not say that it follows its setpoints."""

        def ignoring() -> list[Axis]:
            words = self.latest.statusword
            told = (axis for axis in axes if axis.quirks.follows_bit)
            return [axis for axis in told if not words[axis.number - 1] & Status.FOLLOWS_COMMAND]

        if self._connection.monitor.wait_for(lambda _: not ignoring(), _SAYING):
            return
        silent = ignoring()
        if self.latched:
            self.require_power("to be enabled")
        self.disable()
        raise silent[0].error(
            "is enabled, and bit 12 of its statusword does not say that it follows its setpoints."
            " Where the drive does not have that bit, drives.quirks follows_bit = false goes"
            " without: then only the following error shows a drive that ignores its setpoints"
        )

    def disable(self) -> None:
        """Take the power off, step by step."""
        entry = self._connection.monitor.latest
        if entry is not None and entry.power != Power.SILENT:
            self._switch(Power.OFF, _OFF)
            self._reference.note_power(False, self.latest.actual)

    def set_brakes(self, closed: bool) -> None:
        """Close or release the holding brakes, through bit 0 of 0x60FE:1."""
        with self.axes() as axes:
            for axis in axes:
                if not axis.has(0x60FE):
                    raise axis.error(
                        "has no digital outputs, 0x60FE is in its drives.quirks absent: its brake"
                        " cannot be set from here"
                    )
            for index, axis in enumerate(axes):
                word = axis.read(0x60FE, 1) & ~1 | int(closed)
                self._connection.process.order(Command.OUTPUTS, index, float(word))

    def reset_fault(self) -> None:
        """Acknowledge faults and latched stops, and configure the drives again; power stays off."""
        self._connection.require_open()
        heard = not self._connection.failed
        if not heard:
            self._connection.restart()
            self._listen()
        order = self._connection.process.order
        with self.axes() as axes:
            in_parallel(axes, Axis.wait_for_boot)
            self._reset_at = self._connection.monitor.mark
            order(Command.FORGET)
            order(Command.POWER, Power.RESET)
            if not self._connection.monitor.wait_for(_no_fault, _PATIENCE):
                raise next(axis.fault() for axis in axes if axis.read_state() in _FAULTY)
            order(Command.POWER, Power.SILENT)
            self._bring_up(axes, heard)

    # Reference

    def home(self, again: bool, confirm: bool) -> None:
        """Home all three drives together, unless the reference is known and not ``again``.

        Everything is said to every drive, and read back, before bit 4 rises for the first of them.
        """
        self._connection.require_open()
        if self.homed and not again:
            return
        here = METHODS_HERE.intersection(self.machine.drives.homing.method)
        if here and not confirm and not self._reference.simulated:
            raise NotHomedError(self._ask_to_look())
        self.require_power("homing")
        self._reference.lose("homing has begun and has not ended")
        goals = self._goals()
        with self.axes() as axes, self._stopping_on_error():
            self._switch(Power.HOMING, (State.OPERATION_ENABLED,))
            for axis, goal in zip(axes, goals, strict=True):
                axis.prepare_homing(goal)
            self._switch(Power.HOMING_START, (State.OPERATION_ENABLED,))
            self._await_homing(axes)
            positions = [axis.read(0x6064) for axis in axes]
            self._await_setpoints(positions)
            self._switch(Power.ON, (State.OPERATION_ENABLED,))
            for axis, goal in zip(axes, goals, strict=True):
                axis.end_homing(goal)
                axis.limit_travel(travel_of(self.machine))
        self._reference.find(positions)

    @contextmanager
    def _stopping_on_error(self) -> Iterator[None]:
        """Stop all drives, and latch that, if one of them cannot go on: they move as one."""
        try:
            yield
        except BaseException:
            with suppress(BusError):  # then they stop by themselves
                self._connection.process.order(Command.QUICK_STOP)
            raise

    def _goals(self) -> list[float]:
        """Return where each carriage is once it is homed [mm]."""
        homing = self.machine.drives.homing
        here = home_carriages(self.machine).tolist()
        rows = zip(homing.method, homing.switch_position, here, strict=True)
        return [place if method in METHODS_HERE else switch for method, switch, place in rows]

    def _await_homing(self, axes: tuple[Axis, ...]) -> None:
        deadline = time.monotonic() + self.machine.drives.homing.timeout
        pauses = growing_pauses()
        while not all(axis.homing_done() for axis in axes):
            time.sleep(next(pauses))
            if time.monotonic() > deadline:
                raise DriveTimeout(
                    f"homing is not over after {self.machine.drives.homing.timeout:g} s"
                )

    def _await_setpoints(self, positions: list[int]) -> None:
        """Wait until the streamer holds the drives where they now count that they are."""
        window = self.machine.drives.following_error_window
        first, second, third = positions
        says = np.array(self.scales.mm((first, second, third)))

        def there(entry: CycleEntry) -> bool:
            return bool(np.all(np.abs(self.scales.mm(entry.setpoint) - says) < window))

        if not self._connection.monitor.wait_for(there, _PATIENCE):
            raise DriveTimeout("the feedback does not show the position that was homed to")

    # Inside

    def _switch(self, power: Power, goals: tuple[State, ...]) -> None:
        """Give an order and wait until every drive is where it leads.

        A drive that has fallen silent cannot be switched off; it is not waited for.
        """
        monitor = self._connection.monitor
        mark = monitor.mark
        heard = [self.latest.cycle] * AXES
        patience = self.machine.drives.heartbeat_timeout / self.machine.drives.cycle
        self._connection.process.order(Command.POWER, power)

        def reached(entry: CycleEntry) -> bool:
            states = [decode(word) for word in entry.statusword]
            for i in range(AXES):  # one late answer is no silence
                heard[i] = heard[i] if entry.missing >> i & 1 else entry.cycle
            silent = [power is Power.OFF and entry.cycle - last > patience for last in heard]
            arrived = [s in goals or gone for s, gone in zip(states, silent, strict=True)]
            return entry.power == power and all(arrived)

        def refused() -> bool:
            return monitor.find(_is_latched, mark) is not None

        arrived = monitor.wait_for(lambda entry: refused() or reached(entry), _PATIENCE)
        if refused():
            raise DriveError(
                f"a stop is latched ({'; '.join(trip.words for trip in self.latched)});"
                " reset_fault() acknowledges it on purpose"
            )
        if arrived:
            return
        words = [f"axis {i}: {decode(w).words}" for i, w in enumerate(self.latest.statusword, 1)]
        raise DriveTimeout(f"power {power.name.lower()} is not reached: {'; '.join(words)}")


def _no_fault(entry: CycleEntry) -> bool:
    return not any(decode(word) in _FAULTY for word in entry.statusword)


def _is_latched(event: EventEntry) -> bool:
    return event.kind == Happening.REFUSED and event.code == Refusal.LATCHED


def _is_trip(event: EventEntry) -> bool:
    return event.kind == Happening.TRIP
