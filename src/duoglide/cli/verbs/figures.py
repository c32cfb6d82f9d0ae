"""``duoglide figures``: the paper's figures, computed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from duoglide.cli.console import progress, say, say_json
from duoglide.cli.options import Json, MachineFile, load_machine

_HELP = """\
Draw the paper's figures for a machine: PDF, PNG, captions, and a page to turn them on.
"""
_EXAMPLE = """\
Examples:

duoglide figures pictures

duoglide figures pictures --machine cell.toml
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("figures", help=_HELP, epilog=_EXAMPLE)(figures)


def figures(
    directory: Annotated[Path, typer.Argument(help="Where to write; made if it is not there.")],
    machine: MachineFile = None,
    as_json: Json = False,
) -> None:
    """Draw the paper's figures for a machine: PDF, PNG, captions, and a page to turn them on."""
    described = load_machine(machine)
    from duoglide.paper.figures import write_figures

    with progress("drawing", 1.0) as done:
        files = write_figures(
            directory, described.geometry, lambda name, ready, total: done(ready / total)
        )
    if as_json:
        say_json("figures", {"files": [str(file) for file in files]})
        return
    for file in files:
        say(str(file))
