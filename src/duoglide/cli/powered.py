"""What ``stream``, ``replay`` and ``demo`` share: a machine under power that pages may join."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from duoglide.cli.console import complain, working
from duoglide.errors import BusError

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot
    from duoglide.machine import Machine
    from duoglide.planning.trajectory import Trajectory

View: TypeAlias = Annotated[
    int | None,
    typer.Option("--view", metavar="PORT", min=0, max=65535, help="Serve the live page there."),
]

_NO_PRIORITY = "warning: no real-time priority, cycles may be late: see duoglide doctor"


def require_page(port: int | None) -> None:
    """Refuse a page that could not be served, before anything gets power.

    Raises:
        BusError: The port is taken.
        ImportError: The extra is not installed.
    """
    if port is None:
        return
    # All that it needs loads here, without power; it says which extra is missing.
    import viser  # noqa: F401

    import duoglide.viewer.page  # noqa: F401
    from duoglide.viewer.address import require_address

    require_address("127.0.0.1", port)


@contextmanager
def under_power(
    machine: Machine,
    bus: str,
    doing: str = "homing",
    home_here: bool = False,
    run: tuple[Trajectory, bool] | None = None,
) -> Iterator[Robot]:
    """Connect a machine, enable and home it, and let ``duoglide view --join`` in.

    Args:
        machine: The machine.
        bus: Name of the bus.
        doing: What stderr says meanwhile.
        home_here: Whether somebody has seen the machine stand in its home pose.
        run: What will run, and whether it goes to the start first; prepared before there is power.

    Raises:
        DuoglideError: It does not come up.
    """
    from duoglide.control.host.robot import Robot
    from duoglide.viewer.share import share

    with ExitStack() as resources:
        with working(doing):
            robot = resources.enter_context(Robot.connect(machine, bus=bus))
            if not robot.has_priority:
                complain(_NO_PRIORITY, 0)
            robot.require_reference(confirm=home_here)
            if run is not None:
                robot.prepare(*run)
            robot.enable()
            robot.home(confirm=home_here)
        try:  # let other processes join; where that cannot be, the run goes on without
            resources.enter_context(share(robot))
        except BusError as error:
            complain(f"warning: {error}", 0)
        yield robot


@contextmanager
def page_beside(robot: Robot, file: Path, port: int | None) -> Iterator[None]:
    """Serve the live page beside a run, if it is asked for.

    Args:
        robot: The machine.
        file: The plan or run that the page opens with.
        port: Where; None for no page.
    """
    if port is None:
        yield
        return
    from duoglide.viewer.page import Page

    with Page(robot.machine, file=file, drives=robot, port=port) as page:
        print(page.address, file=sys.stderr, flush=True)
        yield
