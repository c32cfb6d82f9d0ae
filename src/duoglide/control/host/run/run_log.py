"""The log of a run: documents first, then one message a cycle, and events as they come."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Self

from duoglide.control.channel.events import Happening
from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.control.host.run.happenings import describe_event
from duoglide.drives.linear_axis import eds_sha256
from duoglide.storage import CycleRecord, Document, LogKind, LogWriter, Topic
from duoglide.storage.paths import as_path
from duoglide.storage.records import Phase, part_name

if TYPE_CHECKING:
    from duoglide.control.host.run.report import RunReport
    from duoglide.machine import Machine
    from duoglide.planning.trajectory import Trajectory

FULL = 64 * 1024 * 1024
_PHASES = {int(phase): phase for phase in Phase}


class RunLog:
    """A run's log file; a resource: opens in ``with``.

    The log of a program goes on in another file whenever one is full: ``shift.mcap`` in
    ``shift_0002.mcap``. Each holds the machine and the plan of every part in it, so that it opens
    by itself.

    Args:
        path: Where to write.
        machine: That runs.
        plan: What it runs; of a program, its first part: values, or their JSON.
        approach: How it gets to the start first; None where it is there.
        bus: Name of the bus.
        number: Of the setpoints of ``plan``.
        full: Size from which on the next part begins another file [byte].

    Raises:
        InputError: It is no path.
        LogError: The file cannot be written.
    """

    def __init__(
        self,
        path: str | Path,
        machine: Machine,
        plan: object,
        approach: Trajectory | None,
        bus: str,
        *,
        number: int = 0,
        full: int = FULL,
    ) -> None:
        self.path = as_path(path, "log")
        self._bus, self._full, self._files = bus, full, 1
        self._first, self._part, self._cycles = number, 0, 0
        self._machine = machine.to_dict()
        self._parts: dict[int, bytes] = {}  # those that are still to begin; two threads use it
        self._writer = self._open(self.path)
        self._documents: dict[str, object] = {
            Document.MACHINE: self._machine,
            Document.TRAJECTORY: plan,
        }
        if approach is not None:
            self._documents[Document.APPROACH] = approach.to_document()

    def _open(self, path: Path) -> LogWriter:
        told = {"eds_sha256": eds_sha256(), "bus": self._bus}
        if self._files > 1:
            told |= {"file": str(self._files), "first_part": str(self._part)}
        return LogWriter(path, LogKind.RUN, told)

    def __enter__(self) -> Self:
        with ExitStack() as failed:  # a log that fails at its head leaves nothing behind
            failed.enter_context(self._writer)
            for name, document in self._documents.items():
                self._writer.attach(name, document)
            failed.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._writer.__exit__(kind)

    def add_part(self, number: int, document: bytes) -> None:
        """Keep the plan of a part of a program until it begins.

        Args:
            number: Of its setpoints.
            document: Of its trajectory: JSON.
        """
        self._parts[number] = document

    def _begin_part(self, number: int) -> None:
        """Write the plan of the part that begins, into another file where this one is full."""
        document = self._parts.pop(number, None)
        if document is None:
            return
        self._part = number - self._first
        if self._writer.size < self._full:
            self._writer.attach(part_name(self._part), document)
            return
        self._files += 1
        full, self._cycles = self._writer, 0
        following = self.path.with_name(f"{self.path.stem}_{self._files:04d}{self.path.suffix}")
        self._writer = self._open(following)
        self._writer.__enter__()
        self._writer.attach(Document.MACHINE, self._machine)
        self._writer.attach(Document.TRAJECTORY, document)
        # to wait for the disk here would hold up whoever reads the streamer's records
        threading.Thread(target=full.__exit__, args=(None, None, None), name="duoglide-log").start()

    def add_cycle(self, entry: CycleEntry) -> None:
        """Write a cycle."""
        self._cycles += 1
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
            part=self._part if self._files > 1 or entry.run > self._first else 0,
        )
        self._writer.write(Topic.CYCLE, entry.time * 1e-9, record)

    def add_event(self, event: EventEntry) -> None:
        """Write an event; it is on disk soon, for it may be the last."""
        if event.kind == Happening.PART:
            self._begin_part(int(event.value))
            return
        self._writer.write(Topic.EVENT, event.time * 1e-9, describe_event(event))
        self._writer.flush()

    def add_report(self, report: RunReport) -> None:
        """Write the summary."""
        told = report.to_dict()
        if self._files > 1:
            told["cycles_in_file"] = self._cycles
        self._writer.attach(Document.REPORT, told)
