"""The move that ``plan`` and ``check`` are about: a file, or a pick and a place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from duoglide.cli.console import progress
from duoglide.cli.options import number, point

if TYPE_CHECKING:
    from duoglide.planning.programs.read import Reading

Program: TypeAlias = Annotated[
    Path | None,
    typer.Argument(metavar="PROGRAM", help="A program: TOML, CSV or G-code."),
]
Pick: TypeAlias = Annotated[
    str | None,
    typer.Option("--pick", metavar="X,Y,Z", help=r"Instead of a program: from here \[mm]."),
]
Place: TypeAlias = Annotated[
    str | None, typer.Option("--place", metavar="X,Y,Z", help=r"To here \[mm].")
]
Lift: TypeAlias = Annotated[
    str | None, typer.Option("--lift", metavar="MM", help=r"Up by this much \[mm]. (default: 25)")
]
Tolerance: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--tolerance",
        metavar="MM",
        help=r"Round the corners within this \[mm]; of a PROGRAM those for which it has no"
        " tolerance. (default: 2; of a PROGRAM 0)",
    ),
]
Ignore: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--ignore",
        metavar="WORDS",
        help="Skip these words of a PROGRAM, as M104,E (or G92, for G92 E only), and count them;"
        " only words that neither move, offset nor change units.",
    ),
]
Points: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--point", metavar="X,Y,Z", help=r"Instead of a program: two or more, in order \[mm]."
    ),
]


@contextmanager
def planning() -> Iterator[Callable[[float], None]]:
    """Show on stderr how far a plan is, and that its kernels are compiled where they are not yet.

    Yields:
        A function to call with the share that is done, 0 to 1.
    """
    from duoglide.planning import compile_ahead

    first = "" if compile_ahead.ready() else "compiling kernels (once)"
    with compile_ahead.beside(), progress("planning", 1.0, first) as done:
        yield done


def read_path(
    program: Path | None,
    *,
    points: list[str] | None,
    pick: str | None,
    place: str | None,
    lift: str | None,
    tolerance: str | None,
    ignore: list[str] | None = None,
) -> Reading:
    """Build the path that the arguments describe, and tell how a program was read.

    Raises:
        typer.BadParameter: Not one of a program, points, and a pick and a place; or no numbers.
        DuoglideError: The program cannot be read, or describes no path.
    """
    from duoglide.planning.programs.read import Reading, read_with_notes

    rounding = number(tolerance, "--tolerance", "mm") if tolerance is not None else None
    if program is not None:
        if points or any(value is not None for value in (pick, place, lift)):
            raise typer.BadParameter("--point, --pick, --place and --lift do not go with a PROGRAM")
        words = [word for text in ignore or [] for word in text.split(",") if word.strip()]
        return read_with_notes(program, rounding or 0.0, words)
    if ignore:
        raise typer.BadParameter("--ignore goes with a PROGRAM")
    rounding = 2.0 if rounding is None else rounding
    if points:
        if any(value is not None for value in (pick, place, lift)):
            raise typer.BadParameter("--pick, --place and --lift do not go with --point")
        from duoglide.motion.path.path import Path as MotionPath

        corners = [point(text, "--point") for text in points]
        return Reading(MotionPath.polyline(corners, rounding))
    if pick is None or place is None:
        raise typer.BadParameter("give a PROGRAM, or --point twice, or --pick and --place X,Y,Z")
    from duoglide.planning.programs.pick_and_place import pick_and_place

    return Reading(
        pick_and_place(
            point(pick, "--pick"),
            point(place, "--place"),
            lift=number(lift, "--lift", "mm") if lift is not None else 25.0,
            tolerance=rounding,
        )
    )


def reading_numbers(reading: Reading) -> dict[str, Any]:
    """Return what a script wants to know of how a program was read."""
    return {"ignored": dict(reading.ignored), "remarks": list(reading.remarks)}


def reading_facts(reading: Reading) -> list[tuple[str, str]]:
    """Return what a person wants to know of how a program was read."""
    rows = [("note", remark) for remark in reading.remarks]
    if reading.ignored:
        counts = (f"{w} {n} time{'s' * (n > 1)}" for w, n in reading.ignored.items())
        rows.append(("ignored", ", ".join(counts)))
    return rows
