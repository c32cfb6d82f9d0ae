"""``duoglide run``: plan and stream a program as it goes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from duoglide.cli.console import say, say_facts, say_json, working
from duoglide.cli.motion import run_facts, run_numbers, see_to_the_end
from duoglide.cli.options import (
    Approach,
    Bus,
    HomeHere,
    Json,
    MachineFile,
    Override,
    TimingWord,
    load_machine,
    override_factor,
)
from duoglide.cli.outputs import Force, require_log
from duoglide.cli.powered import under_power
from duoglide.cli.program import Move, about_a_move, reading_facts, reading_numbers

_HELP = """\
Plan a program part by part and stream it meanwhile: it moves once its first part is planned.

It is planned in a process of its own, a few parts ahead of the motion. Where the next part is late,
the machine comes to rest on its path and goes on when it is there; the report counts that. A path
that cannot be followed is refused when its turn comes, and the machine rests before it: duoglide
check looks at all of it first.

A long log goes on in other files, as shift_0002.mcap after shift.mcap. Ctrl-C and SIGTERM stop
along the path, close the log and switch off.
"""
_EXAMPLE = """\
Examples:

duoglide run program.toml --approach --log run.mcap

duoglide run picks.toml --repeat 1000 --approach --log shift.mcap

duoglide run part.nc --bus socketcan:can0 --machine cell.toml --approach --override 20
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("run", help=_HELP, epilog=_EXAMPLE)(about_a_move(run))


def run(
    move: Move,
    *,
    repeat: Annotated[
        int,
        typer.Option("--repeat", metavar="N", min=0, help="How often; 0: until it is stopped."),
    ] = 1,
    bus: Bus = "virtual",
    log: Annotated[
        Path | None, typer.Option("--log", metavar="FILE", help="Record the run there.")
    ] = None,
    override: Override = "100",
    approach: Approach = False,
    home_here: HomeHere = False,
    brake_safe: Annotated[
        bool,
        typer.Option(
            "--brake-safe/--no-brake-safe",
            help="Slow down where drives that brake by themselves would come too near.",
        ),
    ] = True,
    timing: TimingWord = None,
    machine: MachineFile = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Plan a program part by part and stream it meanwhile."""
    factor = override_factor(override)
    require_log(log, reads=(move.program, machine), force=force)
    described = load_machine(machine)
    reading = move.read()
    from duoglide.planning.programs.divide import divide

    program = divide(reading.path, repeat or None)
    with under_power(described, bus, home_here=home_here) as robot:
        with working("planning"):
            handle = robot.start_program(
                program.paths,
                program.tolerance,
                brake_safe,
                timing,
                log=log,
                approach=approach,
                override=factor,
            )
        with working("running"):
            report = see_to_the_end(handle, log)
    if as_json:
        remarks = [*reading.remarks, *report.remarks]
        numbers = run_numbers(report, log) | reading_numbers(reading)
        say_json("run", {**numbers, "remarks": remarks})
        return
    done = report.program
    parts = "" if done is None else f"{done.paths} paths in {done.parts} parts; "
    say(f"{parts}{report.cycles} cycles in {report.duration:.3f} s")
    say_facts(run_facts(report) + reading_facts(reading))
    if log is not None:
        say(f"log: {log}")
