"""``duoglide plan``: from a program to a plan that can be streamed."""

from __future__ import annotations

from math import isinf, isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from duoglide.cli.console import percent, say, say_facts, say_json
from duoglide.cli.options import Json, MachineFile, TimingWord, load_machine
from duoglide.cli.outputs import Force, require_log, require_picture
from duoglide.cli.program import (
    Move,
    about_a_move,
    planning,
    reading_facts,
    reading_numbers,
)
from duoglide.errors import LimitError

if TYPE_CHECKING:
    from duoglide.motion.audit import Audit
    from duoglide.planning.trajectory import Trajectory

_MOST_RESTS = 30  # between which toppra is asked for a bound, some 20 ms each
_HELP = """\
Check a path, time it under the carriages' limits, and write the plan.

A plan or a run that is there already is kept unless --force is given.
"""
_EXAMPLE = """\
Examples:

duoglide plan --pick -41,-152.5,295 --place -41,152.5,295 --lift 25

duoglide plan --point -41,-50,295 --point -41,50,320 --out line.mcap

duoglide plan program.toml --machine cell.toml --picture plan.png --force

duoglide plan program.toml --timing ruckig --out preview.mcap
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("plan", help=_HELP, epilog=_EXAMPLE)(about_a_move(plan))


def plan(
    move: Move,
    *,
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
    timing: TimingWord = None,
    machine: MachineFile = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Check a path, time it under the carriages' limits, and write the plan.

    A plan or a run that is there already is kept unless --force is given.
    """
    require_log(out, reads=(move.program, machine), force=force)
    require_picture(picture, reads=(move.program, machine, out))
    described = load_machine(machine)
    reading = move.read()
    path = reading.path
    from duoglide.planning.plan import plan as make_plan

    with planning() as done:
        trajectory = make_plan(described, path, brake_safe, done, timing)
    audit, bound = trajectory.audit(), _bound(trajectory)
    trajectory.save(out)
    if picture is not None:
        from duoglide.drawing.picture import save

        save(trajectory.plot(), picture)
    if as_json:
        files = {"file": str(out), "picture": None if picture is None else str(picture)}
        numbers = {
            "least_duration": bound,
            **plan_numbers(trajectory, audit),
            **reading_numbers(reading),
        }
        say_json("plan", {**files, **numbers})
        return
    say(f"{out}: {trajectory.duration:.4f} s{_bound_in_words(bound)}")
    say_facts(plan_facts(trajectory, audit) + reading_facts(reading))
    if picture is not None:
        say(f"picture: {picture}")


def plan_numbers(trajectory: Trajectory, audit: Audit) -> dict[str, Any]:
    """Return what a script wants to know of a plan."""
    demand = trajectory.demand()
    return {
        "duration": trajectory.duration,
        "picks_per_minute": audit.picks_per_minute,
        "use": {
            "velocity": audit.velocity,
            "acceleration": audit.acceleration,
            "jerk": audit.jerk,
            "force": audit.force,
        },
        "least_clearance": audit.least_clearance,
        "carriage_margin": audit.carriage_margin,
        "braking_clearance": audit.braking_clearance,
        "braking_carriage_margin": audit.braking_carriage_margin,
        "stays_on_path": audit.stays_on_path,
        "force": {"peak": demand.peak_force, "rms": demand.rms_force},
        "peak_power": demand.total_peak_power,
        "energy": float(demand.energy.sum()),
        "limited_by": audit.explain(),
        "method": trajectory.report.method.value,
        "fallback": audit.fallback,
        "brake_safe": trajectory.report.brake_safe,
    }


def _bound(trajectory: Trajectory) -> float:
    """Return what no motion without a jerk limit can beat [s]; NaN where that is not reckoned."""
    from duoglide.motion.path.carriage import CarriagePath

    path = trajectory.path
    if isinstance(path, CarriagePath) and len(path.curve.rests) > _MOST_RESTS:
        return nan
    try:
        return trajectory.lower_bound()
    except LimitError:
        return nan


def _bound_in_words(bound: float) -> str:
    if isnan(bound):
        return ""
    return f"; no motion without a jerk limit can take less than {bound:.4f} s (toppra)"


def _jerk_in_words(trajectory: Trajectory, audit: Audit) -> str:
    """Return the worst use of jerk, or that there is no limit of it."""
    free = all(map(isinf, trajectory.machine.limits.jerk))
    return "no limit" if free else percent(audit.jerk)


def _demand_in_words(trajectory: Trajectory) -> list[tuple[str, str]]:
    """Return forces and energy, and what of the masses is assumed."""
    demand = trajectory.demand()
    peak, rms = (
        ", ".join(f"{force:.1f}" for force in forces)
        for forces in (demand.peak_force, demand.rms_force)
    )
    energy, returned = float(demand.energy.sum()), float(demand.returned.sum())
    spent = f"{energy:.2f} J, of which {returned:.2f} J come back; at most"
    assumed = ", masses of bars assumed" if trajectory.machine.masses.assumed else ""
    return [
        ("peak and rms force", f"{peak} N; {rms} N{assumed}"),
        ("energy", f"{spent} {demand.total_peak_power:.0f} W"),
    ]


def plan_facts(trajectory: Trajectory, audit: Audit) -> list[tuple[str, str]]:
    """Return what a person wants to know of a plan."""
    rows = [
        ("worst use, velocity", f"{percent(audit.velocity)} of the limit, per carriage"),
        ("worst use, acceleration", percent(audit.acceleration)),
        ("worst use, jerk", _jerk_in_words(trajectory, audit)),
        *([("worst use, force", percent(audit.force))] if audit.force.any() else []),
        ("timed by", trajectory.report.method.value),
        ("held back by", audit.explain()),
        ("least clearance", f"{audit.least_clearance:.2f} mm to a singular surface"),
        ("carriage margin", f"{audit.carriage_margin:.2f} mm that every carriage may be off"),
    ]
    if audit.picks:
        rate = f"{audit.picks_per_minute:.0f} picks a minute"
        if audit.picks == 1:
            rows.insert(0, ("there and back", f"{2 * audit.duration:.4f} s, {rate}"))
        else:
            rows.insert(0, ("up, across, down", f"{audit.picks} times; {rate}, with the ways back"))
    if not isnan(audit.braking_clearance):
        margin = f"carriage margin {audit.braking_carriage_margin:.2f} mm"
        least = f"clearance {audit.braking_clearance:.2f} mm, {margin} at least"
        rows.append(("while braking", f"{least}, every drive by itself"))
    promised = f"{percent(audit.stays_on_path)} of the time, should that drive brake by itself"
    rows.append(("stays on its path", promised))
    rows += _demand_in_words(trajectory)
    if audit.fallback:
        rows.append(("slower, certified", audit.fallback))
    return rows
