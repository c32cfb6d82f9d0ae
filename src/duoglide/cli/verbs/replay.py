"""``duoglide replay``: a recorded run once more, or raw frames."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from duoglide.cli.completion import FRAMES, RECORDINGS, files
from duoglide.cli.console import say, say_json, working
from duoglide.cli.motion import finish, run_with_progress, see_to_the_end
from duoglide.cli.options import (
    Approach,
    Bus,
    HomeHere,
    Json,
    MachineFile,
    load_machine,
    override_factor,
)
from duoglide.cli.outputs import Force, require_log
from duoglide.cli.powered import View, page_beside, require_page, under_power
from duoglide.errors import InputError, LogError

_HELP = """\
Check a recorded run against the machine again, and stream it again: the same setpoints.

Raw frames are sent one by one with the timing that they have, when all of them have been read;
what they ask of the drives is not checked. A bus on which another host is heard is refused. A run
that is there already is kept unless --force is given.
"""
_EXAMPLE = """\
Examples:

duoglide replay run.mcap --log again.mcap

duoglide replay run.mcap --override 20 --approach --bus socketcan:can0

duoglide replay frames.log --bus socketcan:vcan0
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("replay", help=_HELP, epilog=_EXAMPLE)(replay)


def replay(
    run: Annotated[
        Path,
        typer.Argument(
            help="A run (.mcap), or raw frames (candump .log, .asc, .blf, .trc).",
            autocompletion=files(*RECORDINGS, *FRAMES),
        ),
    ],
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
    channel: Annotated[
        str | None,
        typer.Option(
            "--channel", metavar="NAME", help="Of raw frames: those of this interface only."
        ),
    ] = None,
    home_here: HomeHere = False,
    view: View = None,
    machine: MachineFile = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Check a recorded run against the machine again, and stream it again: the same setpoints."""
    factor = override_factor(override) if override is not None else None
    require_log(log, reads=(run, machine), force=force)
    require_page(view)
    from duoglide.playback.can_log import SUFFIXES

    if run.suffix.lower() in SUFFIXES:
        if log or override or approach or home_here or view or machine:
            raise typer.BadParameter(
                "--log, --override, --approach, --home-here, --view and --machine do not go with"
                " raw frames"
            )
        _play(run, bus, channel, as_json)
        return
    if channel is not None:
        raise typer.BadParameter("--channel goes with raw frames only")
    from duoglide.playback.replay import prepare

    described = load_machine(machine) if machine is not None else None
    try:
        with working("checking"):
            again = prepare(run, described, bus=bus, log=log, approach=approach, override=factor)
    except LogError as error:
        if run.suffix.lower() in ("", ".mcap") or not run.is_file():
            raise
        raise LogError(f"{error}; raw frames are read from {', '.join(SUFFIXES)}") from error
    ready = None if again.parts else (again.trajectory, again.approach)
    with (
        under_power(again.machine, bus, home_here=home_here, run=ready) as robot,
        page_beside(robot, run, view),
    ):
        if again.parts:
            with working("streaming"):
                handle = robot.start_parts(
                    again.parts, log=log, approach=again.approach, override=again.override
                )
                report = see_to_the_end(handle, log)
        else:
            report = run_with_progress(
                robot, again.trajectory, log=log, approach=again.approach, override=1.0
            )
    finish("replay", report, log, as_json)


def _play(file: Path, bus: str, channel: str | None, as_json: bool) -> None:
    if bus == "virtual":
        raise InputError("raw frames need a bus that others are on: --bus socketcan:IFACE or such")
    from duoglide.drives.bus.buses import open_bus
    from duoglide.drives.bus.listen import require_alone
    from duoglide.machine import DriveSettings
    from duoglide.playback.can_log import play, read_frames

    with working("reading frames"):
        frames = read_frames(file, channel)
    with working("listening"):
        require_alone(bus, DriveSettings())  # a SYNC is one whatever the machine
    with working("sending frames"), open_bus(bus) as opened:
        count = play(frames, opened)
    if as_json:
        facts = {"frames": count, "channel": frames.channel, "skipped": frames.skipped}
        say_json("replay", facts)
        return
    left = f"; {frames.skipped} error frames or status lines left out" if frames.skipped else ""
    say(f"{file}: {count} frames of {frames.channel} sent to {bus}{left}")
