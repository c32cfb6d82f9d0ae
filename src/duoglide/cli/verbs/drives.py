"""``duoglide drives``: three simulated drives on a bus, until stopped."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from duoglide.cli.console import say
from duoglide.cli.options import Bus, MachineFile, load_machine

if TYPE_CHECKING:
    from duoglide.drives.simulated import SimulatedDrives
    from duoglide.drives.simulation.scenario import Scenario

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
_LOOK = 0.5  # [s] between two looks whether they still run
_WATCH = 0.02  # [s] the same, as long as a fault is to come


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("drives", help=_HELP, epilog=_EXAMPLE)(drives)


def drives(
    bus: Bus = "virtual",
    machine: MachineFile = None,
    scenario: Annotated[
        Path | None,
        typer.Option(
            "--scenario",
            metavar="FILE",
            help="Servo, encoder and faults of the drives (TOML); see the docs, Connect drives.",
        ),
    ] = None,
) -> None:
    """Run three simulated CiA 402 drives for somebody else to move; Ctrl-C or SIGTERM ends them."""
    described = load_machine(machine)
    from duoglide.drives.simulated import SimulatedDrives
    from duoglide.drives.simulation.scenario import Scenario
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
