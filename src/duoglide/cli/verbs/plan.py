"""``duoglide plan``: from a program to a plan that can be streamed."""

from __future__ import annotations

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from duoglide.cli.console import percent, progress, say, say_facts, say_json
from duoglide.cli.options import Json, MachineFile, load_machine
from duoglide.cli.outputs import require_picture, require_place
from duoglide.cli.program import (
    Ignore,
    Lift,
    Pick,
    Place,
    Points,
    Program,
    Tolerance,
    read_path,
    reading_facts,
    reading_numbers,
)

if TYPE_CHECKING:
    from duoglide.motion.audit import Audit
    from duoglide.motion.trajectory import Trajectory

_HELP = """\
Check a path, time it near its optimum under the carriages' limits, and write the plan.
"""
_EXAMPLE = """\
Examples:

duoglide plan --pick -41,-152.5,295 --place -41,152.5,295 --lift 25 --out plan.mcap

duoglide plan --point -41,-50,295 --point -41,-50,320 --point -41,50,320 --tolerance 4

duoglide plan program.toml --machine cell.toml --picture plan.png
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("plan", help=_HELP, epilog=_EXAMPLE)(plan)


def plan(
    program: Program = None,
    *,
    point: Points = None,
    pick: Pick = None,
    place: Place = None,
    lift: Lift = None,
    tolerance: Tolerance = None,
    ignore: Ignore = None,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Where to write.")] = Path(
        "plan.mcap"
    ),
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help="Draw the plan (png, pdf).")
    ] = None,
    brake_safe: Annotated[
        bool,
        typer.Option(
            "--brake-safe/--no-brake-safe",
            help="Slow down where drives that brake by themselves would come too near.",
        ),
    ] = True,
    machine: MachineFile = None,
    as_json: Json = False,
) -> None:
    """Check a path, time it near its optimum under the carriages' limits, and write the plan."""
    require_place(out, reads=program)
    require_picture(picture)
    described = load_machine(machine)
    reading = read_path(
        program,
        points=point,
        pick=pick,
        place=place,
        lift=lift,
        tolerance=tolerance,
        ignore=ignore,
    )
    path = reading.path
    from duoglide.planning import compile_ahead
    from duoglide.planning.plan import plan as make_plan

    with compile_ahead.beside(), progress("planning", 1.0) as done:
        trajectory = make_plan(described, path, brake_safe=brake_safe, progress=done)
    audit = trajectory.audit()
    trajectory.save(out)
    if picture is not None:
        from duoglide.drawing.picture import save

        save(trajectory.plot(), picture)
    if as_json:
        numbers = plan_numbers(trajectory, audit)
        say_json({"file": str(out), **numbers, **reading_numbers(reading)})
    else:
        say(f"{out}: {trajectory.duration:.4f} s")
        say_facts(plan_facts(trajectory, audit) + reading_facts(reading))


def plan_numbers(trajectory: Trajectory, audit: Audit) -> dict[str, Any]:
    """Return what a script wants to know of a plan."""
    return {
        "duration": trajectory.duration,
        "picks_per_minute": audit.picks_per_minute,
        "use": {
            "velocity": audit.velocity,
            "acceleration": audit.acceleration,
            "jerk": audit.jerk,
        },
        "least_clearance": audit.least_clearance,
        "braking_clearance": audit.braking_clearance,
        "limited_by": audit.explain(),
        "method": trajectory.report.method.value,
        "fallback": audit.fallback,
        "brake_safe": trajectory.report.brake_safe,
    }


def plan_facts(trajectory: Trajectory, audit: Audit) -> list[tuple[str, str]]:
    """Return what a person wants to know of a plan."""
    rows = [
        ("there and back", f"{2 * audit.duration:.4f} s, {audit.picks_per_minute:.0f} a minute"),
        ("worst use, velocity", f"{percent(audit.velocity)} of the limit, per carriage"),
        ("worst use, acceleration", percent(audit.acceleration)),
        ("worst use, jerk", percent(audit.jerk)),
        ("held back by", audit.explain()),
        ("least clearance", f"{audit.least_clearance:.2f} mm to a singular surface"),
    ]
    if not isnan(audit.braking_clearance):
        least = f"{audit.braking_clearance:.2f} mm at least"
        rows.append(("while braking", f"{least}, every drive by itself"))
    if audit.fallback:
        rows.append(("slower, certified", audit.fallback))
    return rows
