"""``duoglide machine``: write the default machine file, or say what one means."""

from __future__ import annotations

from math import isinf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from duoglide.cli.console import say, say_facts, say_json, triple
from duoglide.cli.options import Json, load_machine
from duoglide.cli.outputs import require_place
from duoglide.errors import ConfigError

if TYPE_CHECKING:
    from duoglide.machine import Machine

_HELP = """\
Check a machine file and say what it means, or write one to begin with.

Errors name the key, the value and the rule.
"""
_EXAMPLE = """\
Examples:

duoglide machine --out cell.toml

duoglide machine cell.toml
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("machine", help=_HELP, epilog=_EXAMPLE)(machine)


def machine(
    file: Annotated[
        Path | None, typer.Argument(help="Machine file to read. (default: Table 1)")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write the machine there, every key in it."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write over an existing file.")] = False,
    as_json: Json = False,
) -> None:
    """Check a machine file and say what it means, or write one to begin with."""
    described = load_machine(file)
    require_place(out)
    if out is not None:
        if out.exists() and not force:
            raise ConfigError(f"{out} is there already; --force writes over it")
        described.save(out)
    if as_json:
        say_json("machine", described.to_dict())
    elif out is not None:
        say(f"wrote {out}")
    else:
        say(f"{file or 'the default machine'}: accepted")
        say_facts(_facts(described))


def _jerk_in_words(jerk: list[float]) -> str:
    return "no limit" if all(map(isinf, jerk)) else f"{triple(jerk, 0)} mm/s^3"


def _facts(machine: Machine) -> list[tuple[str, str]]:
    limits, drives = machine.limits, machine.drives
    return [
        ("rails", f"{2 * machine.geometry.rail_half_length:g} mm long"),
        ("velocity", f"{triple(limits.velocity, 0)} mm/s"),
        ("acceleration", f"{triple(limits.acceleration, 0)} mm/s^2"),
        ("jerk", _jerk_in_words(limits.jerk.tolist())),
        ("clearance", f"{machine.clearance:g} mm"),
        ("carriage width", f"{machine.carriage_width:g} mm"),
        ("drives", f"nodes {triple(drives.node_ids, 0)} at {drives.bit_rate / 1000:g} kbit/s"),
        ("cycle", f"{1e3 * drives.cycle:g} ms"),
        ("scale", f"{triple(drives.increments_per_mm, 0)} increments/mm"),
    ]
