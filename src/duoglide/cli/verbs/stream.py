"""``duoglide stream``: move the machine along a plan."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from duoglide.cli.console import complain, working
from duoglide.cli.motion import finish, run_with_progress
from duoglide.cli.options import (
    Approach,
    Bus,
    Json,
    MachineFile,
    Override,
    load_machine,
    override_factor,
)
from duoglide.cli.outputs import require_place
from duoglide.errors import BusError, LogError

if TYPE_CHECKING:
    from duoglide.control.robot import Robot

_EXAMPLE = """\
Examples:

duoglide stream plan.mcap --approach --log run.mcap

duoglide stream plan.mcap --bus socketcan:can0 --approach --override 20

duoglide stream plan.mcap --approach --override 5 --view 8080
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("stream", epilog=_EXAMPLE)(stream)


def stream(
    plan: Annotated[Path, typer.Argument(help="A plan (.mcap).")],
    *,
    bus: Bus = "virtual",
    log: Annotated[
        Path | None, typer.Option("--log", metavar="FILE", help="Record the run there.")
    ] = None,
    override: Override = "100",
    approach: Approach = False,
    view: Annotated[
        int | None,
        typer.Option("--view", metavar="PORT", min=0, max=65535, help="Serve the live page there."),
    ] = None,
    machine: MachineFile = None,
    as_json: Json = False,
) -> None:
    """Bring up the drives of a bus and stream a plan to them.

    Ctrl-C and SIGTERM stop along the path, close the log and switch off.
    """
    factor = override_factor(override)
    require_place(log)
    from duoglide.motion.trajectory import Trajectory

    trajectory = Trajectory.load(plan)
    described = load_machine(machine) if machine is not None else trajectory.machine
    from duoglide.control.robot import Robot

    if log is not None and log.resolve() == plan.resolve():
        raise LogError(f"{log}: the log must not take the place of the plan")
    with Robot.connect(described, bus=bus) as robot:
        with working("homing"):
            robot.enable()
            robot.home()
        with _shared(robot), _page(robot, plan, view):
            report = run_with_progress(
                robot, trajectory, log=log, approach=approach, override=factor
            )
    finish(report, log, as_json)


@contextmanager
def _shared(robot: Robot) -> Iterator[None]:
    """Let ``duoglide view --join`` in; where that cannot be, the run goes on without."""
    from duoglide.viewer.share import share

    with ExitStack() as resources:
        try:
            resources.enter_context(share(robot))
        except BusError as error:
            complain(f"warning: {error}", 0)
        yield


@contextmanager
def _page(robot: Robot, plan: Path, port: int | None) -> Iterator[None]:
    """Serve the live page beside the run, if it is asked for."""
    if port is None:
        yield
        return
    from duoglide.viewer.page import Page

    with Page(robot.machine, file=plan, drives=robot, port=port) as page:
        print(page.address, file=sys.stderr, flush=True)
        yield
