"""A run in progress, as its operator holds it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from duoglide.control.channel.events import Happening, RunState
from duoglide.control.channel.orders import Command
from duoglide.control.channel.scale import Scales
from duoglide.control.host.interrupt import endings_interrupt, undisturbed
from duoglide.control.host.run.happenings import describe_event
from duoglide.control.host.run.report import RunReport, Tally, require_success
from duoglide.errors import BusError, DriveError, DriveTimeout, DuoglideError
from duoglide.motion.path_clock import require_override
from duoglide.storage.records import Phase

if TYPE_CHECKING:
    from duoglide.control.channel.ring import CycleEntry, EventEntry
    from duoglide.control.channel.scale import Triple
    from duoglide.control.channel.setpoints import PreparedSetpoints
    from duoglide.control.host.monitor import Monitor
    from duoglide.control.host.process import StreamerProcess
    from duoglide.control.host.run.feed import PartFeed
    from duoglide.control.host.run.fitness import LimitUse
    from duoglide.control.host.run.parts import PlannedPart
    from duoglide.control.host.run.run_log import RunLog
    from duoglide.machine import DriveSettings

_SETTLING_CYCLES = 10  # recorded after the end, so that the log shows the carriages arrive
_SETTLING_PATIENCE = 2.0  # [s]
_AT_REST = (RunState.NONE, RunState.STOPPED, RunState.FINISHED)
STOP_PATIENCE = 10.0  # [s] for a stop on the path, at any override


@dataclass(frozen=True, slots=True)
class RunStatus:
    """Where a run is now.

    Attributes:
        state: What it is doing.
        path_time: Along the trajectory, or along the approach [s].
        rate: Path time per time.
        carriages: Where they are [mm].
        following_error: Of each carriage [mm].
        lateness: How long after its deadline the newest cycle began [us].
        override: The rate that is asked for, 0 to 1, whoever has asked last.
    """

    state: RunState
    path_time: float
    rate: float
    carriages: Triple
    following_error: Triple
    lateness: float
    override: float


@dataclass(frozen=True, slots=True)
class RunPlan:
    """What a run needs beside its streamer.

    Attributes:
        chain: What it runs, one after the other; an approach is the first of them.
        override: Rate to begin with.
        drives: Of the machine.
        limit_use: Of the trajectory, for the report; of a program its first part's.
        feed: What comes after the chain; None: nothing.
        paths: Of a program: how many are done when the chain is.
    """

    chain: tuple[PreparedSetpoints, ...]
    override: float
    drives: DriveSettings
    limit_use: LimitUse
    feed: PartFeed | None = None
    paths: int = 0


class RunHandle:
    """A run in progress. Made by ``Robot.start``; ``wait`` ends it and closes its log.

    Args:
        plan: What runs.
        process: The streamer.
        monitor: Its reader.
        log: Where records go; entered by this, None for no log.
    """

    def __init__(
        self, plan: RunPlan, process: StreamerProcess, monitor: Monitor, log: RunLog | None
    ) -> None:
        self._plan, self._process, self._monitor, self._log = plan, process, monitor, log
        first, last = plan.chain[0].number, plan.chain[-1].number
        self._tally = Tally(last, limit_use=plan.limit_use)
        self._over = threading.Event()
        self._resources = ExitStack()
        self._report: RunReport | None = None
        self._approaching = plan.chain[0].phase is Phase.APPROACH
        self._override = plan.override
        self._refusal = ""
        self._failure: DuoglideError | None = None
        listeners = (self, self._tally)
        if log is not None:
            self._resources.enter_context(log)
            monitor.attach(*listeners, log)
        else:
            monitor.attach(*listeners)
        process.order(Command.RUN, first, plan.override)
        if plan.feed is None:
            process.order(Command.END, last)
        else:
            self._resources.callback(plan.feed.close)
            self._tally.plan_paths(last, plan.paths)
            plan.feed.feed(process, last, self._take_part)

    def _take_part(self, number: int, part: PlannedPart) -> None:
        """Keep what the report and the log need of a part, before the streamer has it."""
        self._tally.plan_paths(number, part.paths)
        self._tally.limit_use = self._tally.limit_use.worst(part.limit_use)
        if self._log is not None:
            self._log.add_part(number, part.document)

    # What the monitor's thread calls

    def add_cycle(self, entry: CycleEntry) -> None:
        """Nothing to do: the tally counts."""

    def add_event(self, event: EventEntry) -> None:
        """Notice where the run is, and its end."""
        if event.kind == Happening.REFUSED and event.detail == Command.RUN:
            self._refusal = describe_event(event).text
            self._over.set()
        elif event.kind == Happening.STOPPED:
            self._over.set()
        elif event.kind == Happening.FINISHED and event.detail != Phase.APPROACH:
            self._tally.completed = self.failure is None
            self._over.set()
        elif event.kind in (Happening.STARTED, Happening.PART):
            self._approaching = event.kind == Happening.STARTED and event.detail == Phase.APPROACH
            if self._plan.feed is not None:
                self._plan.feed.pass_on(int(event.value))

    # What the operator calls

    def hold(self) -> None:
        """Come to rest on the path; ``resume`` goes on."""
        self._process.order(Command.HOLD)

    def resume(self) -> None:
        """Go on after a hold."""
        self._process.order(Command.RESUME)

    def set_override(self, override: float) -> None:
        """Run at this rate, 0 to 1.

        Raises:
            InputError: Not a number from 0 to 1.
        """
        self._override = require_override(override)
        self._process.order(Command.OVERRIDE, 0, self._override)

    def stop(self) -> None:
        """Come to rest on the path and end the run; the drives stay on."""
        self._process.order(Command.STOP)

    def quick_stop(self) -> None:
        """Let every drive brake by itself, now; latched until ``Robot.reset_fault``."""
        self._process.order(Command.QUICK_STOP)

    @property
    def approaching(self) -> bool:
        """Whether the run itself has yet to begin; path times are then along the approach."""
        return self._approaching

    @property
    def failure(self) -> DuoglideError | None:
        """Why a program has ended before its end; None: it has not, or this is none."""
        return None if self._plan.feed is None else self._plan.feed.failure

    @property
    def done(self) -> bool:
        """Whether there is nothing to wait for: the run is over, or ``wait`` will say why not."""
        return self._over.is_set() or self._monitor.failed

    @property
    def settled(self) -> bool:
        """Whether ``wait`` has already reported, or raised what has gone wrong."""
        return self._report is not None or self._failure is not None

    @property
    def reported(self) -> bool:
        """Whether ``wait`` has a report to return at once."""
        return self._report is not None

    @property
    def status(self) -> RunStatus:
        """Where the run is now.

        Raises:
            BusError: Nothing has been heard of the streamer.
        """
        entry = self._monitor.latest
        if entry is None:
            raise BusError("the streamer has not reported a cycle yet")
        scales = Scales.of(self._plan.drives)
        return RunStatus(
            state=RunState(entry.state),
            path_time=entry.path_time,
            rate=entry.rate,
            carriages=scales.mm(entry.actual),
            following_error=scales.mm(entry.following),
            lateness=entry.lateness * 1e-3,
            override=self._override,
        )

    def wait(self, timeout: float | None = None) -> RunReport:
        """Wait for the end, close the log, and report.

        Raises:
            DriveError: The streamer has refused to begin; says why.
            DriveTimeout: The run is not over after ``timeout`` seconds; it goes on.
            DuoglideError: The streamer is gone, or the log cannot be written; then the run has
                been stopped.
        """
        if self._report is not None:
            return self._report
        if self._failure is not None:
            raise self._failure
        try:
            over = self._monitor.wait_until(self._over.is_set, timeout)
            if not over:
                raise DriveTimeout(f"the run is not over after {timeout:g} s")
        except DriveTimeout:
            raise
        except DuoglideError as error:
            self._failure = error
            self._abandon()
            raise
        report = self._finish()
        if self._refusal:
            raise DriveError(self._refusal)
        return report

    def _finish(self) -> RunReport:
        last = self._monitor.latest
        end = (last.cycle if last else 0) + _SETTLING_CYCLES
        self._monitor.wait_for(lambda entry: entry.cycle >= end, _SETTLING_PATIENCE)
        self._monitor.detach()
        dropped = self._process.ring.dropped
        path = self._log.path if self._log else None
        plan = self._plan
        failure = self.failure
        if plan.feed is not None:
            self._tally.program_ended = "" if failure is None else str(failure)
        self._report = self._tally.report(plan.drives, dropped, path)
        with self._resources:  # a log that cannot take the report is closed all the same
            if self._log is not None:
                self._log.add_report(self._report)
        return self._report

    def _abandon(self) -> None:
        """Stop what can be stopped, wait until it stands, and keep what has been logged."""
        self._monitor.detach()
        with suppress(DuoglideError):  # the streamer may be gone, and its watchdogs stop the drives
            self._process.order(Command.STOP)
            last = self._monitor.latest
            obeyed = (last.cycle if last else 0) + _SETTLING_CYCLES
            self._monitor.wait_for(
                lambda entry: entry.cycle >= obeyed and entry.state in _AT_REST, STOP_PATIENCE
            )
        self._over.set()
        self._resources.close()


@contextmanager
def stop_on_interrupt(handle: RunHandle) -> Iterator[None]:
    """Let Ctrl-C, SIGTERM and SIGHUP stop a run along its path, before they go on their way.

    The KeyboardInterrupt then says where the machine has stopped, and where the log is. More of
    them change nothing until it stands.
    """
    with endings_interrupt():
        try:
            yield
        except KeyboardInterrupt as interrupt:
            with undisturbed():
                interrupt.args = (_stop(handle),)
            raise


def _stop(handle: RunHandle) -> str:
    """Stop a run that is interrupted and say how it ended; nothing may take the interrupt's place.

    What goes wrong meanwhile is said instead: the drives are then stopped by whatever is left.
    """
    try:
        handle.stop()
        report = handle.wait(STOP_PATIENCE)
    except DuoglideError as error:
        return str(error)
    faults = "".join(f"{trip.words}; " for trip in report.faults)
    return f"{faults}{report.ending}{f'; log: {report.log}' if report.log else ''}"


def wait_to_the_end(handle: RunHandle) -> RunReport:
    """Wait for a run; Ctrl-C stops it along its path.

    Raises:
        DriveError: It has been stopped by what ``require_success`` names.
        BusError: The bus has failed, or the streamer is gone.
        KeyboardInterrupt: Ctrl-C, SIGTERM or SIGHUP has come; the machine has been stopped on its
            path, and the log is whole.
        DuoglideError: A program could not be planned, or read, to its end; the machine has come to
            rest before that.
    """
    with stop_on_interrupt(handle):
        report = handle.wait()
    require_success(report)
    if handle.failure is not None:
        raise handle.failure
    return report
