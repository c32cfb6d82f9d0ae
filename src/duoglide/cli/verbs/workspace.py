"""``duoglide workspace``: how far the machine reaches."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from duoglide.cli.console import say, say_facts, say_json, triple, working
from duoglide.cli.options import Json, MachineFile, load_machine
from duoglide.cli.outputs import require_picture

if TYPE_CHECKING:
    from duoglide.kinematics.workspace import WorkspaceReport

_HELP = """\
Measure the workspace: its size, the largest free box, the deepest and the best pose.
"""
_EXAMPLE = """\
Examples:

duoglide workspace

duoglide workspace --machine cell.toml --picture workspace.png
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("workspace", help=_HELP, epilog=_EXAMPLE)(workspace)


def workspace(
    machine: MachineFile = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help="Draw it (png, pdf).")
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure the workspace: its size, the largest free box, the deepest and the best pose."""
    require_picture(picture, reads=(machine,))
    described = load_machine(machine)
    from duoglide.kinematics.workspace import analyse

    with working("analysing the workspace"):
        report = analyse(described)
    if picture is not None:
        from duoglide.drawing.picture import save
        from duoglide.viewer.workspace_picture import plot_workspace

        save(plot_workspace(described, report), picture)
    if as_json:
        drawn = None if picture is None else str(picture)
        say_json("workspace", {**_numbers(report), "picture": drawn})
        return
    say("where the platform's centre may be, with the machine's rails and clearance")
    say_facts(_facts(report))
    if picture is not None:
        say(f"picture: {picture}")


def _facts(report: WorkspaceReport) -> list[tuple[str, str]]:
    wide, tall = report.largest_box.size
    along_x, along_y, along_z = report.largest_cuboid.size
    return [
        ("volume", f"{report.volume * 1e-6:.2f} litres"),
        ("from", f"({triple(report.low)}) mm"),
        ("to", f"({triple(report.high)}) mm"),
        (
            "largest free box",
            f"{along_x:.0f} by {along_y:.0f} by {along_z:.0f} mm in x, y and z,"
            f" from ({triple(report.largest_cuboid.low)}) mm",
        ),
        ("in the cross-section", f"{wide:.0f} by {tall:.0f} mm in x and z"),
        ("deepest", f"({triple(report.deepest)}) mm, {report.depth:.1f} mm from any edge"),
        (
            "best conditioned",
            f"({triple(report.best_conditioned)}) mm,"
            f" inverse condition number {report.inverse_condition:.3f}",
        ),
    ]


def _numbers(report: WorkspaceReport) -> dict[str, Any]:
    wide, tall = report.largest_box.size
    return {
        "volume_litres": report.volume * 1e-6,
        "low": report.low,
        "high": report.high,
        "largest_box": {"width": wide, "height": tall},
        "largest_cuboid": {"low": report.largest_cuboid.low, "high": report.largest_cuboid.high},
        "deepest": report.deepest,
        "depth": report.depth,
        "best_conditioned": report.best_conditioned,
        "inverse_condition": report.inverse_condition,
    }
