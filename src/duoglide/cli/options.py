"""Options that several verbs share, and how their text becomes values."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

import typer

from duoglide.cli.completion import TABLES, buses, files

if TYPE_CHECKING:
    from duoglide.machine import Machine

MachineFile: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--machine",
        metavar="FILE",
        help="Machine file (TOML). (default: Table 1)",
        autocompletion=files(*TABLES),
    ),
]
Json: TypeAlias = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Bus: TypeAlias = Annotated[
    str,
    typer.Option(
        "--bus",
        metavar="NAME",
        help="virtual, socketcand:HOST:PORT, udp:GROUP:PORT or socketcan:IFACE.",
        autocompletion=buses,
    ),
]
TimingWord: TypeAlias = Annotated[
    Literal["near-optimal", "toppra", "ruckig"] | None,  # ``Timing``, without its import
    typer.Option(
        "--timing",
        help="How to time the path: see the page on planning. (default: as the program or the"
        " machine has it; else toppra where no carriage has a jerk limit, else near-optimal)",
    ),
]
Override: TypeAlias = Annotated[
    str,
    typer.Option("--override", metavar="PERCENT", help="Speed, above 0 to 100 % of the plan."),
]
Approach: TypeAlias = Annotated[
    bool,
    typer.Option("--approach", help="Move to the start first, by a planned and checked motion."),
]
HomeHere: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--home-here",
        help="Home first where the reference is not known: the machine stands in its home pose.",
    ),
]


def load_machine(file: Path | None) -> Machine:
    """Return the machine of a file, or the default one.

    Raises:
        ConfigError: The file cannot be read or breaks a rule.
    """
    from duoglide.machine import Machine

    return Machine.load(file) if file is not None else Machine.default()


def number(text: str, name: str, unit: str) -> float:
    """Turn text into a finite number.

    Raises:
        typer.BadParameter: It is none.
    """
    try:
        value = float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no number [{unit}]", param_hint=name) from None
    if not math.isfinite(value):
        raise typer.BadParameter(f"{text} is not finite [{unit}]", param_hint=name)
    return value


def point(text: str, name: str) -> tuple[float, float, float]:
    """Turn ``x,y,z`` into a point.

    Raises:
        typer.BadParameter: Not three finite numbers.
    """
    parts = text.replace(",", " ").split()
    if len(parts) != 3:
        raise typer.BadParameter(f"{text!r}: must be x,y,z [mm]", param_hint=name)
    x, y, z = (number(part, name, "mm") for part in parts)
    return x, y, z


def override_factor(text: str) -> float:
    """Turn a speed override in percent into a factor.

    Raises:
        typer.BadParameter: Not a number above 0 and up to 100.
    """
    value = number(text.rstrip("%"), "--override", "%")
    if not 0.0 < value <= 100.0:
        raise typer.BadParameter(
            f"{value:g}: must be above 0 and at most 100 [%]", param_hint="--override"
        )
    return value / 100.0
