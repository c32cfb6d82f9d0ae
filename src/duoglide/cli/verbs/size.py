"""``duoglide drives size``: what the drives must deliver for a cycle and a payload."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from duoglide.cli.console import say, say_facts, say_json
from duoglide.cli.options import Json, MachineFile, TimingWord, load_machine
from duoglide.cli.program import Move, about_a_move, planning

if TYPE_CHECKING:
    from duoglide.motion.forces import Demand

_HELP = """\
Say what the drives must deliver for a cycle and a payload, to hold against a catalogue.

Plans the cycle under the machine's limits, with its masses; those that the machine file leaves out
are assumed, and named. Forces and speeds are those of the carriages: what a motor must deliver
follows from its screw or belt.
"""
_EXAMPLE = """\
Examples:

duoglide drives size --pick -41,-152.5,295 --place -41,152.5,295 --payload 0.5

duoglide drives size program.toml --machine cell.toml
"""
_ROWS = (
    ("peak force [N]", "peak_force", 1),
    ("rms force [N]", "rms_force", 1),
    ("peak speed [mm/s]", "peak_speed", 0),
    ("peak power [W]", "peak_power", 1),
    ("energy delivered [J]", "energy", 2),
    ("energy returned [J]", "returned", 2),
)


def add_to(group: typer.Typer) -> None:
    """Add the verb to the group of ``duoglide drives``."""
    group.command("size", help=_HELP, epilog=_EXAMPLE)(about_a_move(size))


def size(
    move: Move,
    *,
    payload: Annotated[
        float | None,
        typer.Option(
            "--payload",
            metavar="KG",
            min=0.0,
            help=r"What the platform carries \[kg]. (default: the machine's)",
        ),
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
    as_json: Json = False,
) -> None:
    """Say what the drives must deliver for a cycle and a payload."""
    described = load_machine(machine)
    if payload is not None:
        described = replace(described, masses=replace(described.masses, payload=payload))
    path = move.read().path
    from duoglide.planning.plan import plan

    with planning() as done:
        demand = plan(described, path, brake_safe, done, timing).demand()
    masses = described.masses
    if as_json:
        numbers = {"payload": masses.payload, "assumed": masses.assumed}
        say_json("drives", numbers | _numbers(demand))
        return
    say(f"a cycle of {demand.duration:.4f} s with {masses.payload:g} kg; carriages 1, 2 and 3:")
    rows = [(name, _three(getattr(demand, key), digits)) for name, key, digits in _ROWS]
    rows.append(("all three together", f"{demand.total_peak_power:.0f} W at most"))
    rows.append(("mean power", f"{_mean_power(demand):.1f} W, with nothing of it recovered"))
    if masses.assumed:
        rows.append(("assumed masses", ", ".join(masses.assumed)))
    say_facts(rows)


def _numbers(demand: Demand) -> dict[str, Any]:
    """Return what a script wants to know."""
    columns = {key: getattr(demand, key) for _, key, _ in _ROWS}
    return {
        "duration": demand.duration,
        **columns,
        "total_peak_power": demand.total_peak_power,
        "mean_power": _mean_power(demand),
    }


def _mean_power(demand: Demand) -> float:
    return float(demand.energy.sum()) / demand.duration


def _three(values: np.ndarray[Any, Any], digits: int) -> str:
    return "  ".join(f"{value:>8.{digits}f}" for value in values)
