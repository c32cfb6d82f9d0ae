"""``duoglide machine``: write the default machine file, or say what one means, or its keys."""

from __future__ import annotations

import json
from enum import StrEnum
from math import isinf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from duoglide.cli.completion import TABLES, files, keys, profiles
from duoglide.cli.console import say, say_facts, say_json, triple
from duoglide.cli.options import Json, load_machine
from duoglide.cli.outputs import require_place
from duoglide.errors import ConfigError

if TYPE_CHECKING:
    from duoglide.machine import Machine


class SchemaOf(StrEnum):
    """Which files have a schema."""

    MACHINE = "machine"
    PROGRAM = "program"


_HELP = """\
Check a machine file and say what it means, or write one to begin with.

Errors name the key, the value and the rule. The file that is written names its JSON schema in the
first line, where editors look for it; --schema prints that of a machine or a program.
"""
_EXAMPLE = """\
Examples:

duoglide machine --out cell.toml

duoglide machine cell.toml

duoglide machine --profile elmo-gold --out elmo.toml

duoglide machine --explain drives.cycle
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("machine", help=_HELP, epilog=_EXAMPLE)(machine)


def machine(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="Machine file to read. (default: Table 1)", autocompletion=files(*TABLES)
        ),
    ] = None,
    *,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write the machine there, every key in it."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write over an existing file.")] = False,
    profile: Annotated[
        str | None,
        typer.Option(
            "--profile",
            metavar="NAME",
            help="Make of the drives of a new machine.",
            autocompletion=profiles,
        ),
    ] = None,
    explain: Annotated[
        str | None,
        typer.Option(
            "--explain",
            metavar="KEY",
            help="Say what a key of the file means.",
            autocompletion=keys,
        ),
    ] = None,
    schema: Annotated[
        SchemaOf | None, typer.Option("--schema", help="Print the JSON schema of such a file.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Check a machine file and say what it means, or write one to begin with."""
    if explain is not None:
        _explain(explain, as_json)
        return
    if schema is not None:
        print(json.dumps(_schema(schema), indent=2))
        return
    if profile is not None and file is not None:
        raise typer.BadParameter("a file has a profile of its own", param_hint="--profile")
    described = load_machine(file) if profile is None else _machine_of(profile)
    require_place(out)
    if out is not None:
        if out.exists() and not force:
            raise ConfigError(f"{out} is there already; --force writes over it")
        from duoglide.machine.schema import SCHEMA

        described.save(out, schema=SCHEMA.as_uri())
    if as_json:
        say_json("machine", described.to_dict())
    elif out is not None:
        say(f"wrote {out}")
    else:
        say(f"{file or 'the default machine'}: accepted")
        say_facts(_facts(described))


def _machine_of(profile: str) -> Machine:
    from duoglide.machine import Machine

    return Machine.from_dict({"drives": {"profile": profile}})


def _schema(of: SchemaOf) -> dict[str, Any]:
    if of is SchemaOf.PROGRAM:
        from duoglide.planning.programs.schema import program_schema

        return program_schema()
    from duoglide.machine.schema import machine_schema

    return machine_schema()


def _explain(key: str, as_json: bool) -> None:
    from duoglide.machine import schema

    about = schema.explain(key)
    if as_json:
        say_json("machine", {"key": key, **about})
        return
    say(f"{key}: {about.get('description', 'a table')}")
    rows = [("default", json.dumps(about["default"]))] if "default" in about else []
    inner = about.get("items", about).get("properties", {})
    say_facts([*rows, *((name, entry.get("description", "")) for name, entry in inner.items())])


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
