"""What ``stream``, ``replay`` and ``demo`` share: a run under way, and its report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from duoglide.cli.console import say, say_json, working

if TYPE_CHECKING:
    from duoglide.control.report import RunReport
    from duoglide.control.robot import Robot
    from duoglide.motion.trajectory import Trajectory


def run_with_progress(
    robot: Robot, trajectory: Trajectory, *, log: Path | None, approach: bool, override: float
) -> RunReport:
    """Run a trajectory while stderr shows that it runs."""
    with working("streaming"):
        return robot.run(trajectory, log=log, approach=approach, override=override)


def finish(report: RunReport, log: Path | None, as_json: bool) -> None:
    """Print a run's report."""
    if as_json:
        say_json(report.to_dict())
        return
    say(str(report))
    if log is not None:
        say(f"log: {log}")
