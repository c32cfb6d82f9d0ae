"""``duoglide view``: the live page."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from duoglide.cli.completion import RECORDINGS, files
from duoglide.cli.console import say
from duoglide.cli.options import Bus, MachineFile, load_machine
from duoglide.storage import read_log

if TYPE_CHECKING:
    from duoglide.viewer.join import JoinedRobot

_HELP = r"""Serve the live 3D page: the mechanism, plans and logs, and the running machine.

Open the whole address that is printed: its token lets in. What the page opens and records is
below the folder where this runs.

Needs the extra: pip install "duoglide\[view]". Ctrl-C ends it, and stops the machine first.
"""
_EXAMPLE = """\
Examples:

duoglide view

duoglide view run.mcap --machine cell.toml --port 9000

duoglide view --join
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("view", help=_HELP, epilog=_EXAMPLE)(view)


def view(
    file: Annotated[
        Path | None,
        typer.Argument(help="A plan or a run to open with.", autocompletion=files(*RECORDINGS)),
    ] = None,
    *,
    bus: Bus = "virtual",
    host: Annotated[
        str, typer.Option("--host", help="Address to serve on; by default only this machine.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="0 takes a free one.")] = (
        8080
    ),
    join: Annotated[
        bool,
        typer.Option(
            "--join", help="Watch and stop a stream, replay or demo of yours on this computer."
        ),
    ] = False,
    pid: Annotated[
        int | None,
        typer.Option("--pid", metavar="NUMBER", help="Join that process, where several run."),
    ] = None,
    machine: MachineFile = None,
) -> None:
    """Serve the live 3D page: the mechanism, plans and logs, and the running machine."""
    drives = _joined(pid) if join or pid is not None else bus
    described = load_machine(machine) if isinstance(drives, str) else drives.machine
    if file is not None:
        read_log(file)  # a page that is open can no longer fail
    from duoglide.viewer.page import Page

    with Page(described, file=file, drives=drives, host=host, port=port) as page:
        say(f"{page.address} (Ctrl-C ends)")
        try:
            while True:
                time.sleep(3600.0)
        except KeyboardInterrupt:
            say("ended")


def _joined(pid: int | None) -> JoinedRobot:
    from duoglide.viewer.join import JoinedRobot, find

    return JoinedRobot(find(pid))
