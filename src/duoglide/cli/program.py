"""The move that ``plan`` and ``check`` are about: a file, or a pick and a place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from duoglide.cli.console import progress
from duoglide.cli.options import number, point

if TYPE_CHECKING:
    from duoglide.motion.path import Path as MotionPath

Program: TypeAlias = Annotated[
    Path | None,
    typer.Argument(metavar="[PROGRAM]", help="A program: TOML, CSV or G-code."),
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
        "--tolerance", metavar="MM", help=r"Round the corners within this \[mm]. (default: 2)"
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
) -> MotionPath:
    """Build the path that the arguments describe.

    Raises:
        typer.BadParameter: Not one of a program, points, and a pick and a place; or no numbers.
        DuoglideError: The program cannot be read, or describes no path.
    """
    if program is not None:
        if points or any(value is not None for value in (pick, place, lift, tolerance)):
            raise typer.BadParameter(
                "--point, --pick, --place, --lift and --tolerance do not go with a PROGRAM"
            )
        from duoglide.planning.programs import read_program

        return read_program(program)
    rounding = number(tolerance, "--tolerance", "mm") if tolerance is not None else 2.0
    if points:
        if any(value is not None for value in (pick, place, lift)):
            raise typer.BadParameter("--pick, --place and --lift do not go with --point")
        from duoglide.motion.path import Path as MotionPath

        return MotionPath.polyline([point(text, "--point") for text in points], rounding)
    if pick is None or place is None:
        raise typer.BadParameter("give a PROGRAM, or --point twice, or --pick and --place X,Y,Z")
    from duoglide.planning.pick_and_place import pick_and_place

    return pick_and_place(
        point(pick, "--pick"),
        point(place, "--place"),
        lift=number(lift, "--lift", "mm") if lift is not None else 25.0,
        tolerance=rounding,
    )
