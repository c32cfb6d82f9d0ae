"""What ``stream``, ``replay`` and ``demo`` share: a run under way, and its report."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from duoglide.cli.console import Failed, Stopped, progress, say, say_facts, say_json, triple
from duoglide.errors import DriveError, DuoglideError

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot
    from duoglide.control.host.run.handle import RunHandle
    from duoglide.control.host.run.report import RunReport
    from duoglide.planning.trajectory import Trajectory

_LOOK = 0.1  # [s] between two looks how far it is


def run_with_progress(
    robot: Robot, trajectory: Trajectory, *, log: Path | None, approach: bool, override: float
) -> RunReport:
    """Run a trajectory while stderr shows how far it is; Ctrl-C stops along the path.

    Raises:
        DuoglideError: It cannot be run.
        Failed: It did not come to its end.
        Stopped: It was interrupted, and stands.
    """
    handle = robot.start(trajectory, log=log, approach=approach, override=override)
    first = "approaching" if handle.approaching else ""
    with progress("streaming", trajectory.duration, first) as done:
        return see_to_the_end(
            handle, log, lambda: done(0.0 if handle.approaching else handle.status.path_time)
        )


def see_to_the_end(
    handle: RunHandle, log: Path | None, show: Callable[[], None] = lambda: None
) -> RunReport:
    """Wait for a run; Ctrl-C stops along the path.

    Args:
        handle: The run.
        log: Where it is recorded.
        show: Called now and then, to show how far it is.

    Raises:
        DuoglideError: It cannot be run.
        Failed: It did not come to its end.
        Stopped: It was interrupted, and stands.
    """
    from duoglide.control.host.run.handle import stop_on_interrupt
    from duoglide.control.host.run.report import require_success

    try:
        with stop_on_interrupt(handle):
            while not handle.done:
                show()
                time.sleep(_LOOK)
            report = handle.wait()
    except KeyboardInterrupt as interrupt:
        facts = run_numbers(handle.wait(), log) if handle.reported else {}
        raise Stopped(str(interrupt), facts) from None
    try:
        require_success(report)
        if handle.failure is not None:
            raise handle.failure
        _require_end(report)
    except DuoglideError as error:
        raise Failed(error, run_numbers(report, log)) from error
    return report


def finish(verb: str, report: RunReport, log: Path | None, as_json: bool) -> None:
    """Print a run's report."""
    if as_json:
        say_json(verb, run_numbers(report, log))
    else:
        say(f"{report.cycles} cycles in {report.duration:.3f} s")
        say_facts(run_facts(report))
        if log is not None:
            say(f"log: {log}")


def run_numbers(report: RunReport, log: Path | None) -> dict[str, object]:
    """Return what a script wants to know of a run."""
    return {**report.to_dict(), "log": None if log is None else str(log)}


def _require_end(report: RunReport) -> None:
    if not report.completed:
        log = f"; log: {report.log}" if report.log is not None else ""
        raise DriveError(f"{report.ending}{log}")


def run_facts(report: RunReport) -> list[tuple[str, str]]:
    """Return what a person wants to know of a run."""
    late = report.lateness
    rows = [
        (
            "lateness",
            f"median {late.median:.0f}, 99 % {late.p99:.0f}, worst {late.worst:.0f} us"
            f"; {report.skipped} cycles left out",
        ),
        ("following error", f"worst {triple(report.following_error, 3)} mm"),
        ("late or lost", f"{report.lost} frames"),
    ]
    rows += [("remark", remark) for remark in report.remarks]
    return rows + [("fault", trip.words) for trip in report.faults]
