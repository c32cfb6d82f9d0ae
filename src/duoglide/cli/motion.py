"""What ``stream``, ``replay`` and ``demo`` share: a run under way, and its report."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from duoglide.cli.console import progress, say, say_facts, say_json, triple
from duoglide.errors import DriveError

if TYPE_CHECKING:
    from duoglide.control.host.report import RunReport
    from duoglide.control.host.robot import Robot
    from duoglide.motion.trajectory import Trajectory

_LOOK = 0.1  # [s] between two looks how far it is


def run_with_progress(
    robot: Robot, trajectory: Trajectory, *, log: Path | None, approach: bool, override: float
) -> RunReport:
    """Run a trajectory while stderr shows how far it is; Ctrl-C stops along the path.

    Raises:
        DuoglideError: It cannot be run, or did not come to its end.
    """
    from duoglide.control.host.handle import stop_on_interrupt
    from duoglide.control.host.report import require_success

    handle = robot.start(trajectory, log=log, approach=approach, override=override)
    with stop_on_interrupt(handle):
        with progress("streaming", trajectory.duration) as done:
            while not handle.done:
                done(handle.status.path_time)
                time.sleep(_LOOK)
        report = handle.wait()
    require_success(report)
    _require_end(report)
    return report


def finish(report: RunReport, log: Path | None, as_json: bool) -> None:
    """Print a run's report.

    Raises:
        DriveError: The run did not come to its end.
    """
    if as_json:
        say_json(report.to_dict())
    else:
        say(f"{report.cycles} cycles in {report.duration:.3f} s")
        say_facts(run_facts(report))
        if log is not None:
            say(f"log: {log}")
    _require_end(report)


def _require_end(report: RunReport) -> None:
    if not report.completed:
        last = f": {report.events[-1][1].text}" if report.events else ""
        raise DriveError(f"the run ended at path time {report.path_time:.4f} s{last}")


def run_facts(report: RunReport) -> list[tuple[str, str]]:
    """Return what a person wants to know of a run."""
    late = report.lateness
    rows = [
        (
            "lateness",
            f"median {late.median:.0f}, 99 % {late.p99:.0f}, worst {late.worst:.0f} us"
            f" after the deadline; {report.skipped} cycles left out",
        ),
        ("following error", f"worst {triple(report.following_error, 3)} mm"),
        ("feedback late or lost", f"{report.lost} frames"),
    ]
    return rows + [("fault", trip.words) for trip in report.faults]
