"""Three drives as one machine: power, reference, runs."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from duoglide.arrays import FloatArray, read_only
from duoglide.control.connection import Connection, bring_up
from duoglide.control.fitness import require_fit
from duoglide.control.handle import RunHandle, RunPlan, require_override
from duoglide.control.happenings import trip_of
from duoglide.control.orders import Command, Happening
from duoglide.control.power import Power
from duoglide.control.program import prepare
from duoglide.control.report import RunReport
from duoglide.control.run_log import RunLog
from duoglide.control.scale import Scales
from duoglide.control.supervise import Condition
from duoglide.control.verdict import require_success
from duoglide.drives.cia402 import Mode, State, decode
from duoglide.errors import DriveError, DriveTimeout, DuoglideError, NotHomedError, PathError
from duoglide.kinematics.home import home_carriages
from duoglide.kinematics.model import forward
from duoglide.storage.records import Phase

if TYPE_CHECKING:
    from duoglide.control.ring import CycleEntry, EventEntry
    from duoglide.drives.simulated import SimulatedDrives
    from duoglide.machine import Machine
    from duoglide.motion.trajectory import Trajectory

START_TOLERANCE = 0.05  # [mm] that a carriage may be away from the start of a run
_PATIENCE = 5.0  # [s] for a change of power
_STOP_PATIENCE = 10.0  # [s] for a stop on the path, at any override


class Robot:
    """A connected machine; a resource: use ``with Robot.connect(...) as robot``.

    Args:
        machine: Its description.
        connection: To its drives; brought up.
    """

    def __init__(self, machine: Machine, connection: Connection) -> None:
        self.machine = machine
        self._connection = connection
        self._scales = Scales.of(machine.drives)
        self._homed = False
        self._homed_at = 0
        self._run: RunHandle | None = None
        self._number = 0

    @classmethod
    def connect(cls, machine: Machine, bus: str = "virtual") -> Robot:
        """Open a bus, identify and configure the three drives, and start the stream of SYNC.

        Nothing gets power. On ``virtual`` three simulated drives are started, and the address of
        their bus is printed, so that others can watch.

        Args:
            machine: The machine; its drives are on the bus.
            bus: ``virtual``, ``socketcand:HOST:PORT``, ``udp:GROUP:PORT`` or ``socketcan:IFACE``.

        Raises:
            BusError: The bus cannot be opened.
            DriveError: A drive is missing, or not what the machine file says.
        """
        connection = Connection(machine, bus)
        try:
            if connection.simulated is not None:
                print(f"virtual bus: {connection.bus}", file=sys.stderr)
            robot = cls(machine, connection)
            robot._bring_up()
        except BaseException:
            connection.close()
            raise
        return robot

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Stop what moves, take the power off in order, and let go of the bus."""
        try:
            self._end_run()
            if self._connection.process.alive:
                self.disable()
        except DuoglideError as error:
            print(f"while closing: {error}", file=sys.stderr)
        finally:
            self._connection.close()

    # What it is

    @property
    def bus(self) -> str:
        """Name of the bus, as others can open it."""
        return self._connection.bus

    @property
    def simulated(self) -> SimulatedDrives | None:
        """The simulated drives of a ``virtual`` bus; None where they are somebody else's."""
        return self._connection.simulated

    @property
    def homed(self) -> bool:
        """Whether the drives' position reference is known."""
        return self._homed

    @property
    def enabled(self) -> bool:
        """Whether all three drives are under power and follow setpoints."""
        entry = self._connection.monitor.latest
        return entry is not None and entry.power == Power.ON and _all_enabled(entry)

    @property
    def carriages(self) -> FloatArray:
        """Where the drives say that the carriages are [mm], shape (3,)."""
        return read_only(np.array(self._scales.mm(self._latest().actual)))

    @property
    def position(self) -> FloatArray:
        """Platform centre O' in the base frame, from the carriages [mm], shape (3,).

        Raises:
            NotHomedError: The reference is not known.
        """
        self._require_homed()
        return forward(self.machine.geometry, self.carriages)

    @property
    def states(self) -> tuple[State, State, State]:
        """The CiA 402 states of the drives.

        Raises:
            DriveError: A statusword matches no state.
        """
        first, second, third = map(decode, self._latest().statusword)
        return first, second, third

    # Power and reference

    def enable(self) -> None:
        """Bring all three drives under power, holding where they stand.

        Raises:
            DriveFault: A drive is in fault; ``reset_fault`` is asked for on purpose.
            DriveError: Safe torque off, or a stop is still latched.
            DriveTimeout: A drive does not get there.
        """
        with self._connection.axes() as axes:
            for axis in axes:
                if axis.safe_torque_off():
                    raise axis.error("safe torque off is active; close its circuit first", 0x5441)
                if axis.read_state() is State.FAULT:
                    raise axis.fault()
                axis.set_mode(Mode.CYCLIC_SYNCHRONOUS_POSITION)
            self._power(Power.ON, State.OPERATION_ENABLED)

    def disable(self) -> None:
        """Take the power off, step by step. Unpowered legs sink toward legs-flat.

        Raises:
            DriveTimeout: A drive does not get there.
        """
        self._end_run()
        entry = self._connection.monitor.latest
        if entry is not None and entry.power != Power.SILENT:
            self._power(Power.OFF, None)

    def home(self, *, again: bool = False) -> None:
        """Find the position reference of all three drives together.

        With method 37, the default, the machine has to stand in its home pose: the drives are
        told that this is where they are. Drives that remember their reference are left alone.

        Args:
            again: Whether to home drives that remember their reference.

        Raises:
            DriveError: Not enabled, or homing has failed.
        """
        with self._connection.axes() as axes:
            if not again and all(axis.read_homed() for axis in axes):
                self._set_homed(True)
                return
            if not self.enabled:
                raise DriveError("homing needs power: enable the drives first")
            self._homed = False
            homing = self.machine.drives.homing
            switches = zip(
                homing.method, homing.switch_position, home_carriages(self.machine), strict=True
            )
            goals = [float(here) if method == 37 else at for method, at, here in switches]
            self._power(Power.HOMING, State.OPERATION_ENABLED)
            for axis, goal in zip(axes, goals, strict=True):
                axis.start_homing(goal)
            deadline = time.monotonic() + homing.timeout
            while not all(axis.homing_done() for axis in axes):
                if time.monotonic() > deadline:
                    raise DriveTimeout(f"homing is not over after {homing.timeout:g} s")
            self._await_setpoints([axis.read(0x6064) for axis in axes])
            self._power(Power.ON, State.OPERATION_ENABLED)
            for axis, goal in zip(axes, goals, strict=True):
                axis.end_homing(goal)
        self._set_homed(True)

    def reset_fault(self) -> None:
        """Acknowledge faults and latched stops, on purpose; the power stays off.

        Drives that have rebooted are configured again and have lost their reference.

        Raises:
            DriveFault: The cause persists.
        """
        self._end_run()
        order = self._connection.process.order
        order(Command.POWER, Power.OFF)
        with self._connection.axes() as axes:
            for axis in axes:
                axis.wait_for_boot()
            order(Command.FORGET)
            order(Command.POWER, Power.RESET)
            if not self._connection.monitor.wait_for(_no_fault, _PATIENCE):
                raise next(axis.fault() for axis in axes if axis.read_state() is State.FAULT)
            order(Command.POWER, Power.SILENT)
            bring_up(self.machine, axes)
            self._set_homed(all(axis.read_homed() for axis in axes))

    # Runs

    def run(
        self,
        trajectory: Trajectory,
        log: str | Path | None = None,
        approach: bool = False,
        override: float = 1.0,
    ) -> RunReport:
        """Run a trajectory to its end; Ctrl-C stops along the path.

        Args:
            trajectory: What to run.
            log: Where to record it (.mcap).
            approach: Whether to go to the start first, by a planned and checked motion.
            override: Share of the planned speed, above 0 to 1.

        Raises:
            NotHomedError: The reference is not known.
            PathError: The machine is not at the start, and no approach was asked for.
            DriveError: A drive has failed; the machine has been stopped and the log is whole.
        """
        handle = self.start(trajectory, log, approach, override)
        try:
            report = handle.wait()
        except KeyboardInterrupt:
            handle.stop()
            handle.wait(_STOP_PATIENCE)
            raise
        require_success(report)
        return report

    def start(
        self,
        trajectory: Trajectory,
        log: str | Path | None = None,
        approach: bool = False,
        override: float = 1.0,
    ) -> RunHandle:
        """Begin a run and return its handle; takes and raises what ``run`` does."""
        override = require_override(override)
        self._require_homed()
        if self._run is not None and not self._run.done:
            raise DriveError("a run is in progress; wait for it or stop it first")
        self._end_run()
        if not self.enabled:
            raise DriveError("a run needs power: enable the drives first")
        use = require_fit(trajectory, self.machine)
        way = self._way_to(trajectory, approach)
        run_log = None
        if log is not None:
            run_log = RunLog(Path(log), self.machine, trajectory, way, self.bus)
        first = None
        if way is not None:
            first = prepare(way, self.machine, self._next_number(), Phase.APPROACH)
            self._connection.process.load(first)
        program = prepare(trajectory, self.machine, self._next_number(), Phase.PROGRAM)
        self._connection.process.load(program)
        plan = RunPlan(first, program, override, self._scales, use)
        self._run = RunHandle(plan, self._connection.process, self._connection.monitor, run_log)
        return self._run

    def _way_to(self, trajectory: Trajectory, approach: bool) -> Trajectory | None:
        """Return the approach to a trajectory's start; None where the machine is there."""
        held = np.array(self._scales.mm(self._latest().setpoint))
        away = np.abs(held - trajectory.at(0.0).carriages)
        if away.max() <= START_TOLERANCE:
            return None
        start = trajectory.position_at(0.0)
        here = forward(self.machine.geometry, held)
        if not approach:
            axis = int(np.argmax(away)) + 1
            where, there = (", ".join(f"{v:.3f}" for v in place) for place in (here, start))
            raise PathError(
                f"the machine is not at the start: carriage {axis} is {away.max():.3f} mm away"
                f" (platform at ({where}), start at ({there}) mm); ask for an approach"
                " (approach=True, --approach)",
                position=tuple(here.tolist()),
                quantity="start",
                amount=float(away.max()),
            )
        from duoglide.planning.transfer import transfer

        return transfer(self.machine, here, start)

    # Inside

    def _bring_up(self) -> None:
        with self._connection.axes() as axes:
            bring_up(self.machine, axes)
            self._set_homed(all(axis.read_homed() for axis in axes))
        monitor = self._connection.monitor
        if not monitor.wait_for(lambda entry: not entry.missing, _PATIENCE):
            raise DriveTimeout("the drives are operational but do not answer SYNC with feedback")

    def _await_setpoints(self, positions: list[int]) -> None:
        """Wait until the streamer holds the drives where they now count that they are."""
        window = self.machine.drives.following_error_window

        def there(entry: CycleEntry) -> bool:
            held = self._scales.mm(entry.setpoint)
            first, second, third = positions
            says = self._scales.mm((first, second, third))
            return all(abs(a - b) < window for a, b in zip(held, says, strict=True))

        if not self._connection.monitor.wait_for(there, _PATIENCE):
            raise DriveTimeout(
                "the drives' feedback does not show the position that they were homed to"
            )

    def _next_number(self) -> int:
        self._number += 1
        return self._number

    def _latest(self) -> CycleEntry:
        entry = self._connection.monitor.latest
        if entry is None:
            raise DriveError("nothing has been heard of the drives yet")
        return entry

    def _set_homed(self, homed: bool) -> None:
        self._homed, self._homed_at = homed, self._connection.monitor.mark

    def _require_homed(self) -> None:
        rebooted = self._connection.monitor.find(_is_boot_up, self._homed_at)
        if not self._homed or rebooted is not None:
            raise NotHomedError("the position reference is not known: home the machine first")

    def _power(self, power: Power, goal: State | None) -> None:
        """Give an order and wait until every drive is where it leads; None: without power."""
        monitor = self._connection.monitor
        mark = monitor.mark
        self._connection.process.order(Command.POWER, power)

        def reached(entry: CycleEntry) -> bool:
            states = [decode(word) for word in entry.statusword]
            right = all(s is goal if goal else s in _OFF for s in states)
            return entry.power == power and right

        if monitor.wait_for(reached, _PATIENCE):
            return
        refused = monitor.find(lambda e: e.kind == Happening.REFUSED, mark)
        if refused is not None:
            raise DriveError("a stop is still latched; reset_fault() acknowledges it on purpose")
        words = [f"axis {i}: {decode(w).words}" for i, w in enumerate(self._latest().statusword, 1)]
        raise DriveTimeout(f"power {power.name.lower()} is not reached: {'; '.join(words)}")

    def _end_run(self) -> None:
        """Stop the run that is in progress, if any, and close its log."""
        run, self._run = self._run, None
        if run is None:
            return
        if not run.done:
            run.stop()
        run.wait(_STOP_PATIENCE)


def _all_enabled(entry: CycleEntry) -> bool:
    return all(decode(word) is State.OPERATION_ENABLED for word in entry.statusword)


_OFF = (State.SWITCH_ON_DISABLED, State.FAULT, State.NOT_READY_TO_SWITCH_ON)


def _no_fault(entry: CycleEntry) -> bool:
    states = [decode(word) for word in entry.statusword]
    return not any(state in (State.FAULT, State.FAULT_REACTION_ACTIVE) for state in states)


def _is_boot_up(event: EventEntry) -> bool:
    return event.kind == Happening.TRIP and trip_of(event).condition is Condition.BOOT_UP
