"""``duoglide status``: who is on the bus, and in which state."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from duoglide.cli.console import say, say_facts, say_json, triple, working
from duoglide.cli.options import Bus, Json, MachineFile, load_machine

if TYPE_CHECKING:
    from duoglide.control.robot import Robot

_EXAMPLE = """\
Examples:

duoglide status --bus socketcan:can0 --machine cell.toml

duoglide status --json
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("status", epilog=_EXAMPLE)(status)


def status(bus: Bus = "virtual", machine: MachineFile = None, as_json: Json = False) -> None:
    """Identify and configure the three drives of a bus, and say how they are; nothing gets power.

    The first thing to try with real drives.
    """
    described = load_machine(machine)
    from duoglide.control.robot import Robot

    with working("connecting"):
        robot = Robot.connect(described, bus=bus)
    with robot:
        numbers = _numbers(robot)
    if as_json:
        say_json(numbers)
        return
    say(f"three drives answer on {numbers['bus']}")
    say_facts(
        [
            ("states", ", ".join(numbers["states"])),
            ("position reference", "known" if numbers["homed"] else "not known: not homed"),
            ("carriages", f"{triple(numbers['carriages'], 3)} mm"),
        ]
    )


def _numbers(robot: Robot) -> dict[str, Any]:
    return {
        "bus": robot.bus,
        "states": [state.words for state in robot.states],
        "homed": robot.homed,
        "carriages": robot.carriages.tolist(),
    }
