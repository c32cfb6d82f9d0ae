"""``duoglide check``: why a path can be followed, or where and why it can not."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from duoglide.cli.console import Failed, say, say_facts, say_json, working
from duoglide.cli.options import Json, MachineFile, load_machine
from duoglide.cli.outputs import require_picture
from duoglide.cli.program import (
    Move,
    about_a_move,
    reading_facts,
    reading_numbers,
)
from duoglide.errors import PathError

if TYPE_CHECKING:
    from duoglide.machine import Machine
    from duoglide.motion.path.checked import CheckedPath, LeastMargin
    from duoglide.motion.path.path import Path as MotionPath

_HELP = """\
Explain a path in words: reach, rails, order of the carriages, room to every singularity.

A path that the machine cannot follow is refused with where, what and by how much; the picture
marks the place.
"""
_EXAMPLE = """\
Examples:

duoglide check --pick -41,-152.5,295 --place -41,152.5,295

duoglide check program.csv --machine cell.toml --picture path.png
"""
_MEANING = {
    "clearance": "to the nearest singular surface or edge of reach",
    "carriage_margin": "that every carriage may be off before links part",
    "travel_1": "of rail left to carriage 1",
    "travel_2": "of rail left to carriage 2",
    "travel_3": "of rail left to carriage 3",
    "order": "between carriages 1 and 2",
    "legs_vertical": "of rise left to the legs",
    "strut": "of reach left to the strut",
    "legs_parallel": "from parallel legs",
    "legs_flat": "from flat legs",
    "arm_strut": "from arm and strut in line",
    "arm_flat": "from a flat arm",
}


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("check", help=_HELP, epilog=_EXAMPLE)(about_a_move(check))


def check(
    move: Move,
    *,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help="Draw the path (png, pdf).")
    ] = None,
    machine: MachineFile = None,
    as_json: Json = False,
) -> None:
    """Explain a path in words: reach, rails, order of the carriages, room to every singularity."""
    require_picture(picture, reads=(move.program, machine))
    described = load_machine(machine)
    reading = move.read()
    path = reading.path
    from duoglide.planning.check.check import check_path

    try:
        with working("checking"):
            checked = check_path(described, path)
    except PathError as error:
        drawn = None if picture is None else _draw_refused(described, path, error, picture)
        if drawn is not None and not as_json:
            say(f"picture: {drawn}")
        raise Failed(error, {"accepted": False, "picture": _name(drawn)}) from error
    if picture is not None:
        from duoglide.drawing.picture import save

        save(checked.plot(), picture)
    if as_json:
        numbers = {**_numbers(checked), **reading_numbers(reading)}
        say_json("check", {**numbers, "picture": _name(picture)})
        return
    _explain(checked)
    say_facts(reading_facts(reading))
    if picture is not None:
        say(f"picture: {picture}")


def _draw_refused(
    machine: Machine, path: MotionPath, error: PathError, picture: Path
) -> Path | None:
    """Draw where a path fails, unless its blends do not fit: then there is nothing to draw."""
    from duoglide.drawing.picture import save
    from duoglide.motion.curve.picture import plot_in_machine
    from duoglide.motion.path.rounded import round_corners

    if not error.position:
        return None
    curve = round_corners(path).platform_curve(machine)
    save(plot_in_machine(machine, curve, (7.0, 6.0), error), picture)
    return picture


def _name(picture: Path | None) -> str | None:
    return None if picture is None else str(picture)


def _explain(checked: CheckedPath) -> None:
    length = float(checked.curve.arc_length(checked.curve.end))
    tightest = checked.report.tightest
    say(f"the machine can follow this path: {length:.1f} mm, {len(checked.waypoints)} waypoints")
    say_facts((f"{entry.margin:.2f} mm", _words(entry)) for entry in checked.report.least)
    spare = tightest.margin - tightest.required
    meaning = _MEANING.get(tightest.family, tightest.family)
    say(f"tightest: {tightest.margin:.2f} mm {meaning}, {spare:.2f} mm more than it must be")


def _words(entry: LeastMargin) -> str:
    meaning = _MEANING.get(entry.family, entry.family)
    needs = f" (needs {entry.required:g})" if entry.required else ""
    where = ", ".join(f"{value:.1f}" for value in entry.position)
    return f"{meaning}{needs}, {entry.arc_length:.1f} mm along, at ({where})"


def _numbers(checked: CheckedPath) -> dict[str, Any]:
    return {
        "accepted": True,
        "length": float(checked.curve.arc_length(checked.curve.end)),
        "tightest": checked.report.tightest.family,
        "least": {
            entry.family: {
                "margin": entry.margin,
                "required": entry.required,
                "arc_length": entry.arc_length,
                "position": entry.position,
            }
            for entry in checked.report.least
        },
    }
