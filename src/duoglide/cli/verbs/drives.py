"""``duoglide drives``: three simulated drives on a bus, until stopped."""

from __future__ import annotations

import typer

from duoglide.cli.options import Bus, MachineFile, load_machine

_EXAMPLE = """\
Examples:

duoglide drives --bus virtual

duoglide drives --bus socketcan:vcan0 --machine cell.toml
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("drives", epilog=_EXAMPLE)(drives)


def drives(bus: Bus = "virtual", machine: MachineFile = None) -> None:
    """Run three simulated CiA 402 drives for somebody else to move; Ctrl-C ends them.

    With --bus virtual a hub is opened on the loopback and its address printed.
    """
    described = load_machine(machine)
    from duoglide.cli.simulation import serve

    serve(described, bus)
