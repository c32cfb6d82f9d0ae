"""``duoglide replay``: a recorded run once more, or raw frames."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from duoglide.cli.console import say, say_json, working
from duoglide.cli.motion import finish, run_with_progress
from duoglide.cli.options import (
    Approach,
    Bus,
    Json,
    MachineFile,
    load_machine,
    override_factor,
)
from duoglide.cli.outputs import Force, require_log
from duoglide.cli.powered import View, page_beside, require_page, under_power
from duoglide.errors import InputError

_EXAMPLE = """\
Examples:

duoglide replay run.mcap --log again.mcap

duoglide replay run.mcap --override 20 --approach --bus socketcan:can0

duoglide replay frames.log --bus socketcan:vcan0
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("replay", epilog=_EXAMPLE)(replay)


def replay(
    run: Annotated[Path, typer.Argument(help="A run (.mcap), or raw frames (candump .log).")],
    *,
    bus: Bus = "virtual",
    log: Annotated[
        Path | None, typer.Option("--log", metavar="FILE", help="Record the new run there.")
    ] = None,
    override: Annotated[
        str | None,
        typer.Option(
            "--override", metavar="PERCENT", help="Speed of the plan. (default: as recorded)"
        ),
    ] = None,
    approach: Approach = False,
    view: View = None,
    machine: MachineFile = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Check a recorded run against the machine again, and stream it again: the same setpoints.

    A candump log is sent frame by frame with the timing that it has, and nothing is checked. A run
    that is there already is kept unless --force is given.
    """
    factor = override_factor(override) if override is not None else None
    require_log(log, reads=(run, machine), force=force)
    require_page(view)
    if run.suffix == ".log":
        _play(run, bus, as_json)
        return
    from duoglide.playback.replay import prepare

    described = load_machine(machine) if machine is not None else None
    with working("checking"):
        again = prepare(run, described, log=log, approach=approach, override=factor)
    with under_power(again.machine, bus) as robot, page_beside(robot, run, view):
        report = run_with_progress(
            robot, again.trajectory, log=log, approach=again.approach, override=1.0
        )
    finish("replay", report, log, as_json)


def _play(frames: Path, bus: str, as_json: bool) -> None:
    if bus == "virtual":
        raise InputError("raw frames need a bus that others are on: --bus socketcan:IFACE or such")
    from duoglide.drives.buses import open_bus
    from duoglide.playback.candump import play, read_candump

    with working("sending frames"), open_bus(bus) as opened:
        count = play(read_candump(frames), opened)
    if as_json:
        say_json("replay", {"frames": count})
    else:
        say(f"{frames}: {count} frames sent to {bus}")
