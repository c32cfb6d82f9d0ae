"""A recorded run once more."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from duoglide.arrays import as_number
from duoglide.control.host.run.fitness import machine_that_moves, require_chain
from duoglide.errors import InputError, LogError
from duoglide.playback.pace import slowed
from duoglide.playback.rebuild import is_program, rebuild, rebuild_parts
from duoglide.playback.recheck import recheck
from duoglide.storage import Document, read_log
from duoglide.storage.paths import as_path

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot
    from duoglide.control.host.run.report import RunReport
    from duoglide.machine import Machine
    from duoglide.planning.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Rerun:
    """A recorded run, checked again and ready to be streamed.

    Attributes:
        machine: Who shall follow it.
        trajectory: What; of a program, its first part.
        approach: Whether it may move to the start first.
        parts: Of a program, all of them.
        override: Share of their speed, above 0 to 1.
    """

    machine: Machine
    trajectory: Trajectory
    approach: bool
    parts: tuple[Trajectory, ...] = ()
    override: float = 1.0

    def run(self, robot: Robot, log: str | Path | None) -> RunReport:
        """Stream it on a machine that is ready."""
        if self.parts:
            return robot.run_parts(
                self.parts, log=log, approach=self.approach, override=self.override
            )
        return robot.run(self.trajectory, log=log, approach=self.approach)


def replay(
    run: str | Path,
    machine: Machine | None = None,
    *,
    bus: str = "virtual",
    log: str | Path | None = None,
    approach: bool = False,
    override: float | None = None,
    home_here: bool = False,
) -> RunReport:
    """Stream a recorded run again, with the same setpoints, after checking it again.

    Args:
        run: The run's log.
        machine: Who shall follow it; left out, the machine of the log on the virtual bus, and the
            default machine on any other.
        bus: Name of the bus.
        log: Where to record the new run; None: nowhere.
        approach: Whether to make a planned, checked approach where the machine is not at the
            start; a run that began with an approach always makes one again.
        override: Speed as a share of the plan's, above 0 to 1; None: the pace that was recorded. A
            program is run at an even pace, of its plans where none is given.
        home_here: That somebody has seen the machine stand in its home pose, should it have to be
            homed; simulated drives need nobody.

    Raises:
        InputError: An override that is no such share, or no path for a log.
        ConfigError: No machine is given for a bus with drives of somebody else, and the log is of
            another one than the default machine.
        LogError: The log cannot be read, or does not hold a run that can be replayed.
        PathError: The machine cannot follow the path; says where, what and by how much.
        LimitError: The motion is too quick for the machine; says what would do.
        BusError: No such bus.
        DriveError: A drive refuses; also where the machine is not at the start of the run.
    """
    again = prepare(run, machine, bus=bus, log=log, approach=approach, override=override)
    from duoglide.control.host.robot import Robot

    with Robot.connect(again.machine, bus=bus) as robot:
        robot.require_reference(confirm=home_here)
        if not again.parts:
            robot.prepare(again.trajectory, again.approach)
        robot.enable()
        robot.home(confirm=home_here)
        return again.run(robot, log)


def prepare(
    run: str | Path,
    machine: Machine | None = None,
    *,
    bus: str = "virtual",
    log: str | Path | None = None,
    approach: bool = False,
    override: float | None = None,
) -> Rerun:
    """Rebuild a recorded run and check it again.

    Takes what ``replay`` does, and raises what that raises before it connects.
    """
    source = as_path(run, "run")
    if log is not None and as_path(log, "log").resolve() == source.resolve():
        raise LogError(f"{source}: the new log must not take the place of the run that is replayed")
    recording = read_log(source)
    approach = approach or Document.APPROACH in recording.documents
    if is_program(recording):
        parts = rebuild_parts(recording)
        described = machine_that_moves(machine, parts[0].machine, bus)
        parts = require_chain(parts, described)
        share = 1.0 if override is None else require_share(override)
        return Rerun(described, parts[0], approach, tuple(parts), share)
    recorded = rebuild(recording)
    described = machine_that_moves(machine, recorded.plan.machine, bus)
    share = 1.0 if override is None else require_share(override)
    motion = recorded.motion if override is None else slowed(recorded.plan, share)
    if motion.pace is not None:  # of this run, or of one that it replayed
        trajectory, _ = motion.certified_for(described)
    else:
        trajectory = recheck(described, motion, share)
    return Rerun(described, trajectory, approach)


def require_share(override: float) -> float:
    """Return a speed override as a float.

    Raises:
        InputError: Not a number above 0 and up to 1.
    """
    share = as_number(override, "override")
    if not 0.0 < share <= 1.0:
        raise InputError(f"override = {share:g}: must be above 0 and at most 1")
    return share
