"""``duoglide drives``: three simulated drives on a bus, until stopped."""

from __future__ import annotations

import time

import typer

from duoglide.cli.console import say
from duoglide.cli.options import Bus, MachineFile, load_machine

_EXAMPLE = """\
Examples:

duoglide drives --bus virtual

duoglide drives --bus socketcan:vcan0 --machine cell.toml
"""
_LOOK = 0.5  # [s] between two looks whether they still run


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("drives", epilog=_EXAMPLE)(drives)


def drives(bus: Bus = "virtual", machine: MachineFile = None) -> None:
    """Run three simulated CiA 402 drives for somebody else to move; Ctrl-C or SIGTERM ends them.

    With --bus virtual a hub is opened on the loopback, and its name printed for --bus elsewhere.
    """
    described = load_machine(machine)
    from duoglide.drives.simulated import SimulatedDrives
    from duoglide.kinematics.home import home_carriages

    try:
        start = home_carriages(described).tolist()
        with SimulatedDrives(described.drives, start, bus=bus) as running:
            say(f"three drives on --bus {running.address}, nodes {described.drives.node_ids}")
            say("Ctrl-C ends them")
            while True:
                running.snapshot()  # an error if they have died
                time.sleep(_LOOK)
    except KeyboardInterrupt:
        say("ended")
