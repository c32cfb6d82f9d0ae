"""What a log says, in a few numbers."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from duoglide.arrays import AXES
from duoglide.playback.run_data import RunData, read_run
from duoglide.storage import EventRecord, Log, LogKind, Topic

LATENESS_EDGES = (50, 100, 200, 500, 1000, 2000, 5000)  # [us]


@dataclass(frozen=True, slots=True, kw_only=True)
class Lateness:
    """How late the cycles began.

    Attributes:
        median: [us].
        p99: [us].
        worst: [us].
        histogram: (up to [us], cycles), the last one without a bound (0).
    """

    median: float
    p99: float
    worst: float
    histogram: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary:
    """A run in a few numbers.

    Attributes:
        cycles: How many were streamed.
        duration: From the first to the last cycle [s].
        period: Median time between two cycles [s].
        skipped: Cycles that were left out because the one before was late.
        path_time: Path time that was reached [s].
        following_error: Worst of each carriage [mm].
        missing: Answers of each drive that did not come.
        lateness: How late the cycles began.
    """

    cycles: int
    duration: float
    period: float
    skipped: int
    path_time: float
    following_error: tuple[float, ...]
    missing: tuple[int, ...]
    lateness: Lateness


@dataclass(frozen=True, slots=True, kw_only=True)
class LogSummary:
    """A log in a few numbers.

    Attributes:
        file: Its name.
        kind: Plan or run.
        recorded: When, UTC, ISO 8601.
        metadata: Versions and hashes.
        documents: Names of the documents in it.
        missing: What of it is missing, in words.
        events: (time from the first message [s], record).
        run: Of a run, its numbers.
    """

    file: str
    kind: LogKind
    recorded: str
    metadata: dict[str, str]
    documents: tuple[str, ...]
    missing: str
    events: tuple[tuple[float, EventRecord], ...]
    run: RunSummary | None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def summarise(log: Log) -> LogSummary:
    """Return a log's numbers.

    Raises:
        LogError: A run without its machine, or a message that cannot be read.
    """
    recorded = datetime.fromtimestamp(log.anchor.wall_ns * 1e-9, UTC)
    start = log.anchor.monotonic
    return LogSummary(
        file=str(log.path),
        kind=log.kind,
        recorded=recorded.isoformat(timespec="seconds"),
        metadata=dict(log.metadata),
        documents=tuple(log.documents),
        missing=log.missing,
        events=tuple((t - start, record) for t, record in log.records(Topic.EVENT)),
        run=summarise_run(read_run(log)) if log.kind is LogKind.RUN else None,
    )


def summarise_run(data: RunData) -> RunSummary:
    """Return a run's numbers."""
    some = len(data) > 1
    steps = np.diff(data.cycle)
    error = np.abs(data.following_error)
    return RunSummary(
        cycles=len(data),
        duration=float(data.time[-1]) if some else 0.0,
        period=float(np.median(np.diff(data.time))) if some else 0.0,
        skipped=int(np.maximum(steps - 1, 0).sum()),
        path_time=float(data.path_time[data.on_plan].max(initial=0.0)),
        following_error=tuple(float(np.nanmax(column, initial=0.0)) for column in error.T),
        missing=tuple(int(((data.missing >> axis) & 1).sum()) for axis in range(AXES)),
        lateness=_lateness(data),
    )


def _lateness(data: RunData) -> Lateness:
    late = data.lateness
    if len(late) == 0:
        return Lateness(median=0.0, p99=0.0, worst=0.0, histogram=())
    bins = np.searchsorted(LATENESS_EDGES, late, side="left")
    counts = np.bincount(bins, minlength=len(LATENESS_EDGES) + 1)
    edges = (*LATENESS_EDGES, 0)
    return Lateness(
        median=float(np.median(late)),
        p99=float(np.percentile(late, 99)),
        worst=float(late.max()),
        histogram=tuple((edge, int(n)) for edge, n in zip(edges, counts, strict=True)),
    )
