"""``duoglide stream``: move the machine along a plan."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from duoglide.cli.motion import finish, run_with_progress
from duoglide.cli.options import (
    Approach,
    Bus,
    HomeHere,
    Json,
    MachineFile,
    Override,
    load_machine,
    override_factor,
)
from duoglide.cli.outputs import Force, require_log
from duoglide.cli.powered import View, page_beside, require_page, under_power

_HELP = """\
Bring up the drives of a bus and stream a plan to them.

The plan is certified again from its curve and its profile, for the machine of --machine. Without
one, simulated drives are made after the machine in the plan, and any other bus has the default
machine: a plan for another one is refused there.

Where the drives do not know where they are, --home-here says that the machine stands in its home
pose; simulated drives need nobody to look. Ctrl-C and SIGTERM stop along the path, close the log
and switch off. A run that is there already is kept unless --force is given.
"""
_EXAMPLE = """\
Examples:

duoglide stream plan.mcap --approach --log run.mcap

duoglide stream plan.mcap --bus socketcan:can0 --approach --override 20

duoglide stream plan.mcap --approach --override 5 --view 8080
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("stream", help=_HELP, epilog=_EXAMPLE)(stream)


def stream(
    plan: Annotated[Path, typer.Argument(help="A plan (.mcap).")],
    *,
    bus: Bus = "virtual",
    log: Annotated[
        Path | None, typer.Option("--log", metavar="FILE", help="Record the run there.")
    ] = None,
    override: Override = "100",
    approach: Approach = False,
    home_here: HomeHere = False,
    view: View = None,
    machine: MachineFile = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Bring up the drives of a bus and stream a plan to them."""
    factor = override_factor(override)
    require_log(log, reads=(plan, machine), force=force)
    require_page(view)
    from duoglide.control.host.run.fitness import machine_that_moves
    from duoglide.planning.trajectory import Trajectory

    trajectory = Trajectory.load(plan)
    given = load_machine(machine) if machine is not None else None
    described = machine_that_moves(given, trajectory.machine, bus)
    with (
        under_power(described, bus, home_here=home_here, run=(trajectory, approach)) as robot,
        page_beside(robot, plan, view),
    ):
        report = run_with_progress(robot, trajectory, log=log, approach=approach, override=factor)
    finish("stream", report, log, as_json)
