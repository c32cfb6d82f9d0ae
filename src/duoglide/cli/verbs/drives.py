"""``duoglide drives``: three simulated drives on a bus, until stopped."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from duoglide.cli.completion import DICTIONARIES, TABLES, files
from duoglide.cli.console import complain, say, say_as_it_is, say_json, working
from duoglide.cli.options import (
    Bus,
    HomeHere,
    Json,
    MachineFile,
    Override,
    load_machine,
    override_factor,
)
from duoglide.cli.verbs import size

if TYPE_CHECKING:
    from duoglide.drives.onboarding.probe import Probed
    from duoglide.drives.simulation.scenario import Scenario
    from duoglide.drives.simulation.simulated import SimulatedDrives

_HELP = """\
Run three simulated CiA 402 drives for somebody else to move; Ctrl-C or SIGTERM ends them.

With --bus virtual a hub is opened on the loopback, and its name printed for --bus elsewhere.
"""
_EXAMPLE = """\
Examples:

duoglide drives --bus virtual

duoglide drives --bus socketcan:vcan0 --machine cell.toml

duoglide drives --scenario soft_servo_and_a_jam.toml
"""
_PROBE_HELP = """\
Read what the drives of a bus have of all that Duoglide asks for, without power.

Prints the drives' tables of the machine file, as TOML on stdout, with what each gap costs in
comments. The settings that bring-up would write are tried, and what was there is put back; a drive
under power is refused.
"""
_PROBE_EXAMPLE = """\
Examples:

duoglide drives probe --bus socketcan:can0 > drives.toml

duoglide drives probe --bus socketcan:can0 --node 5

duoglide drives probe --eds maker.eds
"""
_LOOK = 0.5  # [s] between two looks whether they still run
_WATCH = 0.02  # [s] the same, as long as a fault is to come

_COMMISSION_HELP = """\
Learn how the drives trail their setpoints, from a motion along the rails.

Homes, approaches the home pose, goes along the rails and back, twice, and prints drives.lag and
drives.acceleration_lag for the machine file, as TOML on stdout: the nearer they are to what the
drives do, the better a carriage that is off is told from one that trails. Begin with a low
--override, and end with 100 %: acceleration_lag needs acceleration to show.
"""
_COMMISSION_EXAMPLE = """\
Examples:

duoglide drives commission

duoglide drives commission --bus socketcan:can0 --machine cell.toml --override 20 --home-here
"""
_UNITS_HELP = """\
Check by a slow move of each carriage in which unit its drive has its accelerations.

Homes; each carriage creeps a few millimetres, is told to brake gently (0x6085), and the way that it
needs is compared. A unit that is wrong makes a brake-safe plan worthless. The power is off
afterwards. Each rail needs 15 mm of room.
"""
_UNITS_EXAMPLE = """\
Examples:

duoglide drives units --bus socketcan:can0 --machine cell.toml

duoglide drives units --bus socketcan:can0 --machine cell.toml --axis 2
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    group = typer.Typer(invoke_without_command=True, help=_HELP, epilog=_EXAMPLE)
    group.callback()(drives)
    group.command("probe", help=_PROBE_HELP, epilog=_PROBE_EXAMPLE)(probe)
    group.command("commission", help=_COMMISSION_HELP, epilog=_COMMISSION_EXAMPLE)(commission)
    group.command("units", help=_UNITS_HELP, epilog=_UNITS_EXAMPLE)(units)
    size.add_to(group)
    app.add_typer(group, name="drives")


def drives(
    context: typer.Context,
    bus: Bus = "virtual",
    machine: MachineFile = None,
    scenario: Annotated[
        Path | None,
        typer.Option(
            "--scenario",
            metavar="FILE",
            help="Servo, encoder and faults of the drives (TOML); see the docs, Connect drives.",
            autocompletion=files(*TABLES),
        ),
    ] = None,
) -> None:
    """Run three simulated CiA 402 drives for somebody else to move; Ctrl-C or SIGTERM ends them."""
    if context.invoked_subcommand is not None:
        return
    described = load_machine(machine)
    from duoglide.drives.simulation.scenario import Scenario
    from duoglide.drives.simulation.simulated import SimulatedDrives
    from duoglide.kinematics.home import home_carriages

    play = Scenario.from_dict({}) if scenario is None else Scenario.load(scenario)
    try:
        start = play.carriages or home_carriages(described).tolist()
        with SimulatedDrives(described.drives, start, bus=bus, plants=play.plants) as running:
            say(f"three drives on --bus {running.address}, nodes {described.drives.node_ids}")
            say("Ctrl-C ends them")
            _run(running, play)
    except KeyboardInterrupt:
        say("ended")


def probe(
    bus: Bus = "virtual",
    machine: MachineFile = None,
    node: Annotated[
        int | None,
        typer.Option("--node", min=1, max=127, help="Only the drive with this node number."),
    ] = None,
    eds: Annotated[
        Path | None,
        typer.Option(
            "--eds",
            metavar="FILE",
            help="A maker's dictionary (EDS, DCF) instead of a bus.",
            autocompletion=files(*DICTIONARIES),
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Read what the drives of a bus have of all that Duoglide asks for, without power."""
    described = load_machine(machine)
    from duoglide.control.host.commission import probe_dictionary, probe_drives
    from duoglide.drives.onboarding.probe_text import tables

    if eds is not None:
        found: tuple[Probed, ...] = (probe_dictionary(described, eds, node),)
        source = f"dictionary {eds.name}"
    else:
        with working("probing"):
            found = probe_drives(described, bus, node)
        source = f"bus {bus}"
    text = tables(found, described.drives, source)
    unusable = [f"{_name(one)}: {why}" for one in found for why in one.refusals]
    if as_json:
        numbers = {"toml": text, "drives": [asdict(one) for one in found]}
        say_json("drives", numbers, ok=not unusable)
    else:
        say_as_it_is(text)
        for why in unusable:
            complain(why, 1)
    if unusable:
        raise typer.Exit(1)


def commission(
    *,
    bus: Bus = "virtual",
    machine: MachineFile = None,
    distance: Annotated[
        float, typer.Option("--distance", metavar="MM", help="How far; below 0 towards -y.")
    ] = 100.0,
    override: Override = "100",
    home_here: HomeHere = False,
    as_json: Json = False,
) -> None:
    """Learn how the drives trail their setpoints, from a motion along the rails."""
    factor = override_factor(override)
    described = load_machine(machine)
    from duoglide.cli.motion import run_with_progress
    from duoglide.cli.powered import under_power
    from duoglide.control.host.commission import lag_tables, plan_lag_motion

    with working("planning"):
        motion = plan_lag_motion(described, distance)
    with under_power(described, bus, home_here=home_here, run=(motion, True)) as robot:
        report = run_with_progress(robot, motion, log=None, approach=True, override=factor)
    text = lag_tables(report.drives)
    if as_json:
        say_json("drives", {"toml": text, "drives": [drive.to_dict() for drive in report.drives]})
    else:
        say_as_it_is(text)


def units(
    *,
    bus: Bus = "virtual",
    machine: MachineFile = None,
    axis: Annotated[
        int | None, typer.Option("--axis", min=1, max=3, help="Only this carriage.")
    ] = None,
    home_here: HomeHere = False,
    as_json: Json = False,
) -> None:
    """Check by a slow move of each carriage in which unit its drive has its accelerations."""
    described = load_machine(machine)
    from duoglide.cli.powered import under_power
    from duoglide.control.host.units_check import check_units

    checks = []
    with under_power(described, bus, home_here=home_here) as robot, working("moving"):
        for number in (1, 2, 3) if axis is None else (axis,):
            robot.enable()
            checks.append(check_units(robot, number))
    wrong = [check.refusal for check in checks if check.refusal]
    if as_json:
        found = [
            asdict(check) | {"braked": check.braked, "refusal": check.refusal} for check in checks
        ]
        say_json("drives", {"drives": found}, ok=not wrong)
    else:
        for check in checks:
            if not check.refusal:
                say(str(check))
        for refusal in wrong:
            complain(refusal, 1)
    if wrong:
        raise typer.Exit(1)


def _name(one: Probed) -> str:
    return f"node {one.node_id}"


def _run(running: SimulatedDrives, play: Scenario) -> None:
    """Let the faults happen at their times, until interrupted; an error if the drives have died."""
    from duoglide.drives.cia402 import State
    from duoglide.drives.simulation.scenario import FaultSchedule

    start = time.monotonic()
    schedule = FaultSchedule(play.faults, start)
    while True:
        enabled = [drive.state is State.OPERATION_ENABLED for drive in running.snapshot()]
        now = time.monotonic()
        for fault in schedule.due(now, enabled):
            running.inject(fault.injection)
            say(f"{now - start:.2f} s, {fault.words}")
        time.sleep(_WATCH if schedule.waiting else _LOOK)
