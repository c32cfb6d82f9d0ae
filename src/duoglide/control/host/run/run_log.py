"""The log of a run: documents first, then one message a cycle, and events as they come."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Self

from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.control.host.run.happenings import describe_event
from duoglide.drives.linear_axis import eds_sha256
from duoglide.storage import CycleRecord, Document, LogKind, LogWriter, Topic
from duoglide.storage.paths import as_path
from duoglide.storage.records import Phase

if TYPE_CHECKING:
    from duoglide.control.host.run.report import RunReport
    from duoglide.machine import Machine
    from duoglide.planning.trajectory import Trajectory

_PHASES = {int(phase): phase for phase in Phase}


class RunLog:
    """A run's log file; a resource: opens in ``with``.

    Args:
        path: Where to write.
        machine: That runs.
        trajectory: What it runs.
        approach: How it gets to the start first; None where it is there.
        bus: Name of the bus.

    Raises:
        InputError: It is no path.
        LogError: The file cannot be written.
    """

    def __init__(
        self,
        path: str | Path,
        machine: Machine,
        trajectory: Trajectory,
        approach: Trajectory | None,
        bus: str,
    ) -> None:
        self.path = as_path(path, "log")
        self._writer = LogWriter(self.path, LogKind.RUN, {"eds_sha256": eds_sha256(), "bus": bus})
        self._documents = {
            Document.MACHINE: machine.to_dict(),
            Document.TRAJECTORY: trajectory.to_document(),
        }
        if approach is not None:
            self._documents[Document.APPROACH] = approach.to_document()

    def __enter__(self) -> Self:
        with ExitStack() as failed:  # a log that fails at its head leaves nothing behind
            failed.enter_context(self._writer)
            for name, document in self._documents.items():
                self._writer.attach(name, document)
            failed.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._writer.__exit__(kind)

    def add_cycle(self, entry: CycleEntry) -> None:
        """Write a cycle."""
        record = CycleRecord(
            cycle=entry.cycle,
            phase=_PHASES[entry.phase],
            path_time=entry.path_time,
            rate=entry.rate,
            setpoint=entry.setpoint,
            actual=entry.actual,
            controlword=entry.controlword,
            statusword=entry.statusword,
            lateness=entry.lateness // 1000,
            missing=entry.missing,
        )
        self._writer.write(Topic.CYCLE, entry.time * 1e-9, record)

    def add_event(self, event: EventEntry) -> None:
        """Write an event; it is on disk soon, for it may be the last."""
        self._writer.write(Topic.EVENT, event.time * 1e-9, describe_event(event))
        self._writer.flush()

    def add_report(self, report: RunReport) -> None:
        """Write the summary."""
        self._writer.attach(Document.REPORT, report.to_dict())
