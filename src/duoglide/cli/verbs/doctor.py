"""``duoglide doctor``: whether this computer and its bus can run a cell."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from duoglide.cli.console import say, say_facts, say_json, working
from duoglide.cli.options import Bus, Json, MachineFile, load_machine

if TYPE_CHECKING:
    from duoglide.control.host.doctor import Finding

_HELP = """\
Say whether this computer and its bus can run a cell, and the command that mends each point.

Reads and measures, changes nothing, and sends no frame. The exit code is 0 where nothing is bad, 1
where something is.
"""
_EXAMPLE = """\
Examples:

duoglide doctor

duoglide doctor --bus socketcan:can0 --machine cell.toml
"""
_MARKS = {"good": ("ok", "green"), "notice": ("note", "yellow"), "bad": ("BAD", "red")}
_FAILED = 1


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("doctor", help=_HELP, epilog=_EXAMPLE)(doctor)


def doctor(
    bus: Bus = "virtual",
    seconds: Annotated[
        float,
        typer.Option(
            "--seconds", metavar="S", min=0.0, max=3600.0, help="Of measuring lateness; 0: none."
        ),
    ] = 10.0,
    port: Annotated[
        int, typer.Option("--port", min=1, max=65535, help="Where the page would be served.")
    ] = 8080,
    machine: MachineFile = None,
    as_json: Json = False,
) -> int:
    """Say whether this computer and its bus can run a cell."""
    from duoglide.control.host.doctor import Level, examine

    described = load_machine(machine)
    with working("examining this computer"):
        found = list(examine(described, bus, seconds=seconds, port=port, folder=Path.cwd()))
    bad = sum(finding.level is Level.BAD for finding in found)
    if as_json:
        say_json("doctor", {"findings": [asdict(finding) for finding in found]}, ok=not bad)
    else:
        say_facts([(_mark(finding), finding.found) for finding in found])
        for finding in found:
            if finding.mend:
                say(f"{finding.point}: {finding.mend}")
        say(f"{bad} of {len(found)} points are bad" if bad else "nothing is bad")
    return _FAILED if bad else 0


def _mark(finding: Finding) -> str:
    """Return a point with a word for how it is, coloured on a terminal."""
    word, colour = _MARKS[finding.level]
    text = f"{word:<4} {finding.point}"
    return typer.style(text, fg=colour) if sys.stdout.isatty() else text
