"""Three drives as one machine: power, reference, runs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self, TypeVar

import numpy as np

from duoglide.arrays import FloatArray, as_number, as_triples, read_only
from duoglide.control.channel.setpoints import Fence, PreparedSetpoints
from duoglide.control.host.background import load_planning
from duoglide.control.host.connection import Connection
from duoglide.control.host.drivetrain import Drivetrain
from duoglide.control.host.interrupt import undisturbed
from duoglide.control.host.run.by_hand import STEP, JogHandle, JogSource
from duoglide.control.host.run.feed import PartFeed, PlannerProcess, Source
from duoglide.control.host.run.fitness import (
    LimitUse,
    measure_limit_use,
    require_chain,
    require_fit,
)
from duoglide.control.host.run.handle import (
    STOP_PATIENCE,
    RunHandle,
    RunPlan,
    wait_to_the_end,
)
from duoglide.control.host.run.parts import ProgramOrder
from duoglide.control.host.run.prepare import (
    START_TOLERANCE,
    plan_approach,
    prepare,
    prepare_part,
)
from duoglide.control.host.run.report import RunReport
from duoglide.control.host.run.run_log import RunLog
from duoglide.drives.cia402 import State, decode
from duoglide.errors import DriveError, DuoglideError, InputError
from duoglide.kinematics.home import home_position
from duoglide.kinematics.model import forward
from duoglide.motion.path.path import as_timing
from duoglide.motion.path_clock import require_override
from duoglide.storage.paths import as_path
from duoglide.storage.records import Phase

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from duoglide.control.channel.events import Trip
    from duoglide.control.host.trace import Trace
    from duoglide.drives.simulation.simulated import SimulatedDrives
    from duoglide.machine import Machine, Timing
    from duoglide.motion.path.path import Path as MotionPath
    from duoglide.planning.trajectory import Trajectory
    from duoglide.planning.transfer.jog import JogLimits

T = TypeVar("T")


class _Ready(NamedTuple):
    """A run whose setpoints the streamer has.

    Attributes:
        given: The trajectory that was asked for.
        use: Of the machine's limits.
        way: To its start; None where the machine stands there.
        chain: Setpoints of that way, if there is one, and of the run.
        here: Where the way begins [mm], shape (3,).
    """

    given: Trajectory
    use: LimitUse
    way: Trajectory | None
    chain: tuple[PreparedSetpoints, ...]
    here: FloatArray


class Robot:
    """A connected machine; a resource: use ``with Robot.connect(...) as robot``.

    Args:
        machine: Its description.
        connection: To its drives; brought up.
    """

    def __init__(self, machine: Machine, connection: Connection) -> None:
        self.machine = machine
        self._connection = connection
        self._drives = Drivetrain(machine, connection)
        self._run: RunHandle | None = None
        self._ready: _Ready | None = None
        self._numbers = count(1)  # of setpoints
        self._stops = self._stops_before = 0  # calls of stop(); how many before a run was asked for

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
            robot._drives.bring_up()
        except BaseException:
            connection.close()
            raise
        return robot

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop what moves, take the power off in order, and let go of the bus.

        Ctrl-C and its like wait until that is done.
        """
        with undisturbed():
            try:
                self._end_run()
                if self._connection.process.alive:
                    self.disable()
            except DuoglideError as error:
                print(f"while closing: {error}", file=sys.stderr)
            finally:
                self._connection.close()

    # What it says

    @property
    def bus(self) -> str:
        """Name of the bus, as others can open it."""
        return self._connection.bus

    @property
    def simulated(self) -> SimulatedDrives | None:
        """The simulated drives of a ``virtual`` bus; None where they are somebody else's."""
        return self._connection.simulated

    @property
    def has_priority(self) -> bool:
        """Whether the kernel gives the stream real-time priority (SCHED_FIFO)."""
        return self._connection.has_priority

    @property
    def homed(self) -> bool:
        """Whether the drives' position reference is known."""
        return self._drives.homed

    @property
    def why_not_homed(self) -> str:
        """Why the drives' position reference is not known; empty where it is."""
        return self._drives.why_not_homed

    @property
    def enabled(self) -> bool:
        """Whether all three drives are under power and follow setpoints."""
        return self._drives.enabled

    @property
    def latched(self) -> tuple[Trip, ...]:
        """What has made the machine stop since the last ``reset_fault``, in order."""
        return self._drives.latched

    @property
    def states(self) -> tuple[State, State, State]:
        """The CiA 402 states of the drives.

        Raises:
            DriveError: A statusword matches no state.
        """
        first, second, third = map(decode, self._drives.latest.statusword)
        return first, second, third

    @property
    def carriages(self) -> FloatArray:
        """Where the drives say that the carriages are [mm], shape (3,)."""
        return read_only(self._drives.carriages)

    @property
    def held(self) -> FloatArray:
        """Where the setpoints hold the carriages [mm], shape (3,)."""
        return read_only(self._drives.held)

    @property
    def position(self) -> FloatArray:
        """Platform centre O' in the base frame, from the carriages [mm], shape (3,).

        Raises:
            NotHomedError: The reference is not known.
        """
        self._drives.require_homed()
        return forward(self.machine.geometry, self.carriages)

    @property
    def trace(self) -> Trace:
        """What the machine did in the last ten seconds, and what has happened to it."""
        return self._drives.trace

    # Power and reference

    def enable(self) -> None:
        """Bring all three drives under power, holding where they stand.

        All that motions are planned with is loaded first: with power on nothing loads any more.

        Raises:
            DriveFault: A drive is in fault; ``reset_fault`` is asked for on purpose.
            DriveError: Safe torque off is active, or a stop is latched.
            DriveTimeout: A drive does not get there.
        """
        self._connection.background.do(load_planning)
        self._drives.enable()

    def disable(self) -> None:
        """Take the power off, step by step. Unpowered legs sink toward legs-flat: park first.

        Raises:
            DriveTimeout: A drive does not get there.
        """
        self._end_run()
        self._drives.disable()

    def home(self, *, again: bool = False, confirm: bool = False) -> None:
        """Find the position reference of all three drives together.

        With method 37, the default, the machine has to stand in its home pose: the drives are
        told that this is where they are. Where the reference is known, nothing happens.

        Args:
            again: Whether to home although the reference is known.
            confirm: That somebody has seen the machine stand in its home pose; simulated drives
                need none.

        Raises:
            NotHomedError: Method 37, or 35, without that confirmation.
            DriveError: Not enabled, or homing has failed; then the drives have been stopped, and
                ``reset_fault`` acknowledges it.
        """
        self._end_run()
        self._drives.home(again, confirm)

    def require_reference(self, *, confirm: bool = False) -> None:
        """Refuse a machine that somebody has to look at, before it gets power and is homed.

        Args:
            confirm: Whether somebody has.

        Raises:
            NotHomedError: The reference is not known, and the drives are not simulated.
        """
        self._drives.require_reference(confirm)

    def reset_fault(self) -> None:
        """Acknowledge faults and latched stops, on purpose; the power stays off.

        After a bus failure the bus is opened again. Drives that have rebooted are configured
        again; they have lost their reference.

        Raises:
            DriveFault: The cause persists.
        """
        self._end_run()
        self._ready = None  # the streamer may be another one afterwards
        self._drives.reset_fault()

    def set_brakes(self, closed: bool) -> None:
        """Close or release the holding brakes, through bit 0 of 0x60FE:1.

        Drives open them by themselves when they get power and close them when they lose it; this
        closes them under power, for a machine that stands for long.
        """
        self._drives.set_brakes(closed)

    # Runs

    def prepare(self, trajectory: Trajectory, approach: bool = False) -> None:
        """Certify a run, plan its approach and hand its setpoints over, before there is power.

        ``run`` and ``start`` of the same trajectory then begin at once. Where the machine's place
        is only known once it is homed, or turns out to be another one, they plan the approach.

        Args:
            trajectory: What will run.
            approach: Whether to go to the start first.

        Raises:
            PathError: The machine is not at the start, and no approach was asked for; or what
                ``run`` raises of a trajectory.
        """
        self._ready = None
        here = self._drives.expected
        if here is not None:
            self._ready = self._do(lambda: self._get_ready(trajectory, here, approach))
        else:
            self._do(lambda: require_fit(trajectory, self.machine))

    def _get_ready(self, trajectory: Trajectory, here: FloatArray, approach: bool) -> _Ready:
        """Certify, plan and load a run that begins where the carriages are [mm]."""
        fit, use = require_fit(trajectory, self.machine)
        way = plan_approach(self.machine, here, fit, approach)
        prepared = prepare_part(fit, Fence.of(self.machine), 1)
        return _Ready(trajectory, use, way, self._load_after(way, prepared), here)

    def _do(self, task: Callable[[], T]) -> T:
        """Do what takes long below the streamer in priority, and hear signals meanwhile."""
        return self._connection.background.do(task)

    def run(
        self,
        trajectory: Trajectory,
        log: str | Path | None = None,
        approach: bool = False,
        override: float = 1.0,
    ) -> RunReport:
        """Run a trajectory to its end; Ctrl-C, SIGTERM and SIGHUP stop along the path.

        Args:
            trajectory: What to run.
            log: Where to record it (.mcap).
            approach: Whether to go to the start first, by a planned and checked motion.
            override: Share of the planned speed, above 0 to 1.

        Raises:
            NotHomedError: The reference is not known.
            PathError: The machine is not at the start, and no approach was asked for.
            DriveError: A drive has failed; the machine has been stopped and the log is whole.
            KeyboardInterrupt: Says where the machine has been stopped, and where the log is.
        """
        return wait_to_the_end(self.start(trajectory, log, approach, override))

    def start(
        self,
        trajectory: Trajectory,
        log: str | Path | None = None,
        approach: bool = False,
        override: float = 1.0,
    ) -> RunHandle:
        """Begin a run and return its handle; takes and raises what ``run`` does."""
        override = _require_first_override(override)
        self._require_ready()
        ready, self._ready, held = self._ready, None, self._drives.held
        if ready is None or not _still_holds(ready, trajectory, held, approach):
            ready = self._do(lambda: self._get_ready(trajectory, held, approach))
        run_log = None
        if log is not None:
            fit = ready.chain[-1].trajectory
            run_log = RunLog(log, self.machine, fit.to_document(), ready.way, self.bus)
        plan = RunPlan(ready.chain, override, self.machine.drives, ready.use)
        return self._begin(plan, run_log)

    def run_program(
        self,
        paths: Iterable[MotionPath],
        tolerance: float = 0.0,
        brake_safe: bool = True,
        timing: Timing | str | None = None,
        *,
        log: str | Path | None = None,
        approach: bool = False,
        override: float = 1.0,
    ) -> RunReport:
        """Run a program to its end; takes and raises what ``start_program`` does, and ``run``.

        Raises:
            PathError: A path cannot be followed; the machine has come to rest before it.
            DuoglideError: What made the paths has failed, or the planner's process has ended; the
                machine has come to rest at the end of what had been planned.
        """
        return wait_to_the_end(
            self.start_program(
                paths, tolerance, brake_safe, timing, log=log, approach=approach, override=override
            )
        )

    def start_program(
        self,
        paths: Iterable[MotionPath],
        tolerance: float = 0.0,
        brake_safe: bool = True,
        timing: Timing | str | None = None,
        *,
        log: str | Path | None = None,
        approach: bool = False,
        override: float = 1.0,
    ) -> RunHandle:
        """Begin a program that is planned while it runs, and return its handle.

        It is planned in a process of its own, some parts ahead of the motion, which begins once the
        first part is planned. Where the next one is late, the machine comes to rest on its path
        and goes on when it is there; the report counts that.

        Args:
            paths: Any iterable of paths, each from where the one before ends; it may have no end.
                A thread of its own asks for them, a few paths ahead of the motion.
            tolerance: See ``plan_program``.
            brake_safe: See ``plan``.
            timing: See ``plan``.
            log: Where to record it (.mcap); it goes on in ``NAME_0002.mcap`` when that is full.
            approach: Whether to go to the start first, by a planned and checked motion.
            override: Share of the planned speed, above 0 to 1.

        Raises:
            InputError: No iterable of paths, none in it, or a value out of its range.
            NotHomedError: The reference is not known.
            PathError: The first path cannot be followed; or the machine is not at the start, and no
                approach was asked for.
            DriveError: No power, or a run is in progress.
        """
        override = _require_first_override(override)
        log = None if log is None else as_path(log, "log")
        if as_number(tolerance, "tolerance [mm]") < 0.0:
            raise InputError(f"tolerance = {tolerance:g} mm: must be 0 or above")
        method = None if timing is None else as_timing(timing)
        self._require_ready()
        order = ProgramOrder(self.machine, tolerance, brake_safe, method)
        return self._start_feed(PlannerProcess(order, paths), log, approach, override)

    def run_parts(
        self,
        parts: Sequence[Trajectory],
        *,
        log: str | Path | None = None,
        approach: bool = False,
        override: float = 1.0,
    ) -> RunReport:
        """Run parts that have been planned to their end; see ``start_parts``."""
        return wait_to_the_end(
            self.start_parts(parts, log=log, approach=approach, override=override)
        )

    def start_parts(
        self,
        parts: Sequence[Trajectory],
        *,
        log: str | Path | None = None,
        approach: bool = False,
        override: float = 1.0,
    ) -> RunHandle:
        """Begin to run the parts of a program that ``plan_program`` has yielded.

        Args:
            parts: For this machine; each takes over where the one before ends, and the last one
                ends at rest.
            log: See ``run``.
            approach: See ``run``.
            override: See ``run``.

        Raises:
            InputError: There are none.
            DuoglideError: What ``run`` raises.
        """
        override = _require_first_override(override)
        log = None if log is None else as_path(log, "log")
        if not parts:
            raise InputError("there is no part to run")
        parts = self._do(lambda: require_chain(parts, self.machine))
        self._require_ready()
        order = ProgramOrder(self.machine, planned=True)
        return self._start_feed(PlannerProcess(order, parts), log, approach, override)

    def start_jog(self, velocity: ArrayLike, limits: JogLimits | None = None) -> JogHandle:
        """Begin to move the platform by hand, at a velocity, and return the handle.

        The handle has to be asked again and again, or the platform stops: see ``JogHandle.aim``.
        Every step is looked at with its way to rest before it is taken; the platform stops before
        it comes to where it may not be.

        Args:
            velocity: Of the platform [mm/s], shape (3,).
            limits: What the platform may do; None: 100 mm/s.

        Raises:
            InputError: Not three finite numbers, or no velocity at all.
            NotHomedError: The reference is not known.
            PathError: The machine stands where it may not, or may not go that way; see ``recover``.
            DriveError: No power, or a run is in progress.
        """
        from duoglide.planning.transfer.jog import Jog

        self._require_ready()
        jog = self._do(lambda: Jog(self.machine, self._drives.held, limits, period=STEP))
        monitor = self._connection.monitor
        source = JogSource(self.machine, jog, lambda: monitor.latest)
        source.aim(velocity)
        return JogHandle(self._start_feed(source, None, approach=False, override=1.0), source)

    def _start_feed(
        self, source: Source, log: Path | None, approach: bool, override: float
    ) -> RunHandle:
        """Begin a run of what a source has."""
        feed = PartFeed(source, self._numbers)
        with ExitStack() as failed:
            failed.callback(feed.close)
            plan, run_log = self._do(lambda: self._get_program_ready(feed, log, approach, override))
            handle = self._begin(plan, run_log)
            failed.pop_all()
        return handle

    def _get_program_ready(
        self, feed: PartFeed, log: Path | None, approach: bool, override: float
    ) -> tuple[RunPlan, RunLog | None]:
        """Wait for the first part of a program, and hand it over."""
        part = feed.first()
        whole = part.prepared.trajectory
        way = plan_approach(self.machine, self._drives.held, whole, approach)
        chain = self._load_after(way, part.prepared)
        run_log = None
        if log is not None:
            number = chain[-1].number
            run_log = RunLog(log, self.machine, part.document, way, self.bus, number=number)
        drives = self.machine.drives
        return RunPlan(chain, override, drives, part.limit_use, feed, part.paths), run_log

    def _require_ready(self) -> None:
        """Refuse to move what is not ready for it, and end what is over."""
        self._drives.require_homed()
        if self._run is not None and not self._run.done:
            raise DriveError("a run is in progress; wait for it or stop it first")
        self._end_run()
        self._drives.require_power("a run")
        self._stops_before = self._stops

    def _begin(self, plan: RunPlan, run_log: RunLog | None) -> RunHandle:
        self._drives.require_power("a run")  # planning takes its time, and much may have happened
        self._require_no_stop()
        self._run = RunHandle(plan, self._connection.process, self._connection.monitor, run_log)
        if self._stops != self._stops_before:  # by another thread, before it could see the run
            self._run.stop()
        return self._run

    def _require_no_stop(self) -> None:
        if self._stops != self._stops_before:
            raise DriveError("stop was commanded before the run began")

    @property
    def current_run(self) -> RunHandle | None:
        """The run in progress; None while nothing runs."""
        run = self._run
        return None if run is None or run.done else run

    def stop(self) -> None:
        """Stop whatever runs, along its path; from any thread, at any time, as often as wanted.

        A run that is still being prepared does not begin.
        """
        self._stops += 1
        if (run := self.current_run) is not None:
            run.stop()

    # Small moves

    def move_to(self, position: ArrayLike, override: float = 0.25) -> RunReport:
        """Go to a platform position by a planned and checked motion, slowly unless told.

        Args:
            position: Platform centre O' in the base frame [mm], shape (3,).
            override: Share of the planned speed, above 0 to 1.

        Raises:
            PathError: There is no safe way; what ``run`` raises.
        """
        from duoglide.planning.transfer.transfer import transfer

        self._require_ready()
        here = forward(self.machine.geometry, self._drives.held)
        way = self._do(lambda: transfer(self.machine, here, position))
        self._require_no_stop()
        return self.run(way, override=override)

    def jog(self, displacement: ArrayLike, override: float = 0.1) -> RunReport:
        """Move the platform by ``displacement`` [mm], shape (3,), at creep speed unless told."""
        self._drives.require_homed()
        here = forward(self.machine.geometry, self._drives.held)
        return self.move_to(here + as_triples(displacement, "displacement"), override)

    def park(self) -> RunReport:
        """Go home, to the pose with the most room, where the power may go off."""
        return self.move_to(home_position(self.machine))

    def recover(self) -> RunReport:
        """Back out of where the machine must not stand, at creep speed.

        After a fault a carriage may stand past its travel, two of them too close, or the platform
        too near a singular surface for any run to begin. On the way out nothing that is too small
        gets smaller. Where nothing is wrong, nothing moves.

        Raises:
            NotHomedError: The reference is not known.
            PathError: Where the platform is cannot be told, or there is no way out.
            DriveError: No power, or a drive has failed.
        """
        from duoglide.planning.transfer.recover import recover

        self._require_ready()
        held = self._drives.held
        fence = Fence.of(self.machine).extend_to(held)

        def get_ready() -> RunPlan:
            way = recover(self.machine, held)
            prepared = self._load(prepare(way, fence, 1, Phase.PROGRAM))
            use = measure_limit_use(way, self.machine)
            return RunPlan((prepared,), 1.0, self.machine.drives, use)

        return wait_to_the_end(self._begin(self._do(get_ready), None))

    # Inside

    def _load(self, prepared: PreparedSetpoints, after: int = 0) -> PreparedSetpoints:
        """Hand setpoints to the streamer, under the next number."""
        numbered = replace(prepared, number=next(self._numbers), after=after)
        self._connection.process.load(numbered)
        return numbered

    def _load_after(
        self, way: Trajectory | None, prepared: PreparedSetpoints
    ) -> tuple[PreparedSetpoints, ...]:
        """Hand over the setpoints of a run, after those of the way to its start if it needs one."""
        if way is None:
            return (self._load(prepared),)
        fence = Fence.of(self.machine)
        first = replace(prepare_part(way, fence, 1), phase=Phase.APPROACH)
        first = self._load(first)
        return first, self._load(prepared, first.number)

    def _end_run(self) -> None:
        """Stop the run that is in progress, if any, and close its log."""
        run, self._run = self._run, None
        if run is not None and not run.settled:
            if not run.done:
                run.stop()
            run.wait(STOP_PATIENCE)


def _still_holds(ready: _Ready, trajectory: Trajectory, held: FloatArray, approach: bool) -> bool:
    """Whether what was prepared is this run, from where the machine stands."""
    begins_here = bool(np.abs(ready.here - held).max() <= START_TOLERANCE)
    return ready.given is trajectory and begins_here and (approach or ready.way is None)


def _require_first_override(override: object) -> float:
    """Return what a run may begin with, above 0 to 1; at 0 it would never end.

    Raises:
        InputError: It is not.
    """
    value = require_override(override)
    if value == 0.0:
        raise InputError(
            "override = 0: the run would never end; begin above 0, to 1 (the planned speed)."
            " set_override(0) and hold() halt a run that has begun"
        )
    return value
