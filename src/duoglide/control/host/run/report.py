"""What a run was like, and what it raises where it went wrong."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from duoglide.arrays import AXES
from duoglide.control.channel.events import Condition, Happening, Reaction, Trip
from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.control.channel.scale import Scales
from duoglide.control.host.run.conduct import ConductTally, DriveConduct
from duoglide.control.host.run.happenings import describe_event, describe_stop
from duoglide.control.host.run.history import History, HistoryTally
from duoglide.errors import BusError, DriveError, DriveFault, DriveTimeout, FollowingError
from duoglide.storage.records import EventKind, EventRecord, Phase

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from duoglide.control.channel.scale import Triple
    from duoglide.control.host.run.fitness import LimitUse
    from duoglide.machine import DriveSettings

_MARKED = (EventKind.FAULT, EventKind.EMERGENCY, EventKind.TIMEOUT, EventKind.QUICK_STOP)
_FOLLOWING = 0x8611  # emergency code: following error too large
_ERRORS: dict[Condition, type[DriveError]] = {
    Condition.FOLLOWING_ERROR: FollowingError,
    Condition.NOT_FOLLOWING: FollowingError,
    Condition.SILENT: DriveTimeout,
    Condition.HEARTBEAT: DriveTimeout,
    Condition.EMERGENCY: DriveFault,
    Condition.FAULT: DriveFault,
}
_MOST_EVENTS = 10_000
_QUANTILES = (0.5, 0.99, 0.999, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lateness:
    """How long after their deadlines the cycles began [us]."""

    median: float
    p99: float
    p999: float
    worst: float

    @classmethod
    def of(cls, counts: Mapping[int, int]) -> Lateness:
        """Summarise how many cycles were how late, by whole [us]; zeros where there are none."""
        late = np.array(sorted(counts) or [0])
        below = np.cumsum([counts[value] for value in sorted(counts)] or [1])
        rows = np.searchsorted(below, np.array(_QUANTILES) * below[-1])
        median, p99, p999, worst = (float(late[row]) for row in rows)
        return cls(median=median, p99=p99, p999=p999, worst=worst)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramReport:
    """How a program went that was planned while it ran.

    Attributes:
        parts: Trajectories that were moved along, each planned by itself.
        paths: Paths of the program whose last part was begun.
        waits: How often the motion rested because the next part had not come.
        waited: For how long, in all [s].
        ended: Why it ended before its end, in words; empty where it did not.
    """

    parts: int
    paths: int
    waits: int = 0
    waited: float = 0.0
    ended: str = ""

    @property
    def remarks(self) -> list[str]:
        """What is not as it should be, in words."""
        times = f"{self.waits} time{'s' * (self.waits > 1)}"
        said = [f"waited for the planner: {times}, {self.waited:.2f} s"] if self.waits else []
        return said + ([f"the program has ended early: {self.ended}"] if self.ended else [])


class TimedEvent(NamedTuple):
    """Something that happened, with its time on the monotonic clock [s]."""

    time: float
    event: EventRecord


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RunReport:
    """What a run was like.

    Attributes:
        completed: Whether it came to the end of its trajectory, and all carriages came there within
            ``drives.settling_time``.
        cycles: Cycles streamed, approach and stop included.
        duration: From its first cycle to its last [s].
        path_time: How far it came along the trajectory, or along the approach where it ended there
            [s].
        lateness: Of its cycles.
        skipped: Cycles left out because the one before was late.
        lost: Frames that were lost: feedback that did not come, and setpoints that did not act, as
            far as it shows in where the carriages were (``drives``).
        following_error: Worst distance of each carriage from its setpoint, each compared with the
            setpoint that was due [mm].
        limit_use: Worst use of each carriage's velocity, acceleration and jerk limit by the
            trajectory at full rate; 1.0 is at the limit.
        faults: What made it stop, in the order in which it was seen.
        events: What happened, with its time on the monotonic clock [s]; the newest ten thousand.
        dropped: Records that the host was too slow to take; they are missing in the log.
        log: Where the log is; None if none was asked for.
        history: How following error and lateness went.
        approaching: Whether it ended on its way to the start.
        drives: How each of them followed its setpoints.
        remarks: What about that is not as it should be, in words.
        program: How a program went; None for a trajectory.
    """

    completed: bool
    cycles: int
    duration: float
    path_time: float
    lateness: Lateness
    skipped: int
    lost: int
    following_error: Triple
    limit_use: LimitUse
    faults: tuple[Trip, ...]
    events: tuple[TimedEvent, ...]
    dropped: int = 0
    log: Path | None = None
    history: History = field(default_factory=History, compare=False)
    approaching: bool = False
    drives: tuple[DriveConduct, ...] = ()
    remarks: tuple[str, ...] = ()
    program: ProgramReport | None = None

    @property
    def ending(self) -> str:
        """How it ended, and where, in words."""
        if self.completed:
            return "completed"
        quick = any(trip.reaction is Reaction.QUICK_STOP for trip in self.faults)
        return describe_stop(self.approaching, quick, self.path_time)

    def plot(self) -> Figure:
        """Draw the worst following error and lateness over the time of the run.

        Returns:
            A matplotlib figure; a notebook shows it, ``savefig`` writes it.
        """
        return self._draw((7.0, 4.2))

    def _draw(self, size: tuple[float, float]) -> Figure:
        marks = [timed.time for timed in self.events if timed.event.kind in _MARKED]
        return self.history.draw(marks, size)

    def _repr_html_(self) -> str:
        from duoglide.drawing.notebook import notebook_html

        late = self.lateness
        head = [
            ("end", self.ending),
            ("duration", f"{self.duration:.3f} s"),
            ("cycles", f"{self.cycles}, {self.skipped} left out"),
            (
                "lateness",
                f"median {late.median:.0f} µs, 99 % {late.p99:.0f} µs, worst {late.worst:.0f} µs",
            ),
            ("late or lost", f"{self.lost} frames"),
            *(("remark", remark) for remark in self.remarks),
            *(("fault", trip.words) for trip in self.faults),
            ("log", str(self.log) if self.log is not None else "none"),
        ]
        names = ("velocity", "acceleration", "jerk")
        axes = [
            ("carriage", "1", "2", "3"),
            ("worst following error", *(f"{value:.3f} mm" for value in self.following_error)),
            *(
                (f"plan's use of {name}", *(f"{100.0 * share:.1f} %" for share in row))
                for name, row in zip(names, self.limit_use, strict=True)
            ),
        ]
        figure = self._draw((5.4, 3.2)) if len(self.history.times) else None
        return notebook_html("Run", [head, axes], figure)

    def __repr__(self) -> str:
        faults = "".join(f", {trip.words}" for trip in self.faults)
        worst = ", ".join(f"{error:.3f}" for error in self.following_error)
        return (
            f"RunReport({self.ending} in {self.duration:.3f} s, {self.cycles} cycles,"
            f" {self.skipped} skipped, lateness median {self.lateness.median:.0f} us, worst"
            f" {self.lateness.worst:.0f} us, following error {worst} mm{faults})"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, for a log or JSON."""
        return {
            "completed": self.completed,
            "cycles": self.cycles,
            "duration": self.duration,
            "path_time": self.path_time,
            "approaching": self.approaching,
            "lateness_us": {
                "median": self.lateness.median,
                "p99": self.lateness.p99,
                "p999": self.lateness.p999,
                "worst": self.lateness.worst,
            },
            "skipped": self.skipped,
            "lost": self.lost,
            "following_error": list(self.following_error),
            "limit_use": [list(row) for row in self.limit_use],
            "faults": [trip.words for trip in self.faults],
            "drives": [drive.to_dict() for drive in self.drives],
            "remarks": list(self.remarks),
            "dropped": self.dropped,
        } | ({"program": asdict(self.program)} if self.program is not None else {})


@dataclass(slots=True)
class Tally:
    """Counts while a run goes on; the monitor's thread feeds it, ``report`` sums up.

    Attributes:
        number: Of the setpoints in progress, those of an approach or of the run itself.
        limit_use: Worst of what runs.
        program_ended: Of a program: why it ended early, or nothing; None where this is none.
    """

    number: int
    limit_use: LimitUse
    cycles: int = 0
    lateness: Counter[int] = field(default_factory=Counter)
    worst: list[int] = field(default_factory=lambda: [0] * AXES)
    skipped: int = 0
    lost: int = 0
    path_time: float = 0.0
    first: int = 0
    last: int = 0
    completed: bool = False
    approaching: bool = False
    faults: list[Trip] = field(default_factory=list)
    events: deque[TimedEvent] = field(default_factory=lambda: deque(maxlen=_MOST_EVENTS))
    history: HistoryTally = field(default_factory=HistoryTally)
    conduct: ConductTally = field(default_factory=ConductTally)
    program_ended: str | None = None
    parts: int = 0
    waits: int = 0
    waited: float = 0.0
    paths: int = 0
    _paths: dict[int, int] = field(default_factory=dict)

    def plan_paths(self, number: int, paths: int) -> None:
        """Take it that so many paths of a program are done with the setpoints of a number."""
        self._paths[number] = paths

    def add_cycle(self, entry: CycleEntry) -> None:
        """Count a cycle."""
        self.cycles += 1
        self.lateness[entry.lateness // 1000] += 1
        self.skipped += entry.skipped
        self.lost += entry.missing.bit_count()
        self.first = self.first or entry.time
        self.last = entry.time
        self.conduct.add(entry)
        self.history.add(entry.time, entry.following, entry.lateness)
        for axis, error in enumerate(entry.following):
            self.worst[axis] = max(self.worst[axis], abs(error))
        if entry.run == self.number and entry.phase != Phase.HOLD:
            self.path_time = entry.path_time

    def add_event(self, event: EventEntry) -> None:
        """Keep an event; that one part of a program follows another is counted."""
        if event.kind == Happening.PART:
            self._begin_part(int(event.value))
            return
        self.events.append(TimedEvent(event.time * 1e-9, describe_event(event)))
        if event.kind == Happening.TRIP:
            self.faults.append(Trip.from_event(event))
        elif event.kind == Happening.LOST:
            self.lost += event.code
            self.conduct.lose(event.axis, event.code)
        elif event.kind == Happening.STARTED:
            self.approaching = event.detail == Phase.APPROACH
            self._begin_part(int(event.value))
        elif event.kind == Happening.AWAITED:
            self.waits, self.waited = self.waits + 1, self.waited + event.value
        elif event.kind in (Happening.STOPPED, Happening.FINISHED):
            self.path_time = event.value

    def _begin_part(self, number: int) -> None:
        self.number, self.path_time = number, 0.0
        self.parts += not self.approaching
        self.paths = self._paths.pop(number, self.paths)

    def _report_program(self) -> ProgramReport | None:
        if self.program_ended is None:
            return None
        return ProgramReport(
            parts=self.parts,
            paths=self.paths,
            waits=self.waits,
            waited=self.waited,
            ended=self.program_ended,
        )

    def report(self, drives: DriveSettings, dropped: int, log: Path | None) -> RunReport:
        """Sum up."""
        scales = Scales.of(drives)
        conduct = self.conduct.conduct(scales.mm((1, 1, 1)), drives.lag, drives.cycle)
        program = self._report_program()
        remarks = [] if program is None else program.remarks
        for axis, drive in enumerate(conduct, start=1):
            remarks += drive.remarks(axis, drives.cycle)
        first, second, third = scales.mm((self.worst[0], self.worst[1], self.worst[2]))
        return RunReport(
            completed=self.completed,
            cycles=self.cycles,
            duration=(self.last - self.first) * 1e-9,
            path_time=self.path_time,
            lateness=Lateness.of(self.lateness),
            skipped=self.skipped,
            lost=self.lost,
            following_error=(abs(first), abs(second), abs(third)),
            limit_use=self.limit_use,
            faults=tuple(self.faults),
            events=tuple(self.events),
            dropped=dropped,
            log=log,
            history=self.history.history(np.abs(scales.mm((1, 1, 1)))),
            approaching=self.approaching,
            drives=conduct,
            remarks=tuple(remarks),
            program=program,
        )


def require_success(report: RunReport) -> None:
    """Raise what made a run stop; a run that its operator has stopped is no error.

    Raises:
        DriveError: A drive has failed, or the streamer could not go on; names the axis, the code
            in words, and where the log is.
        BusError: The bus has failed.
    """
    log = f"; log: {report.log}" if report.log else ""
    for trip in report.faults:
        if trip.condition is not Condition.PRESSED:
            raise _error(trip, f"{report.ending}{log}")
    for _, event in report.events:
        if event.kind is EventKind.TIMEOUT:
            raise DriveTimeout(f"{event.text}{log}", axis=event.axis)


def _error(trip: Trip, rest: str) -> DriveError | BusError:
    message = f"{trip.words}; {rest}"
    if trip.condition.concerns_bus:
        return BusError(message)
    following = trip.code == _FOLLOWING
    kind = FollowingError if following else _ERRORS.get(trip.condition, DriveError)
    return kind(message, axis=trip.axis, code=trip.code)
