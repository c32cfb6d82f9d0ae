"""The move that a verb is about: a program, points, or a pick and a place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, get_type_hints

import typer

from duoglide.cli.completion import PROGRAMS, files
from duoglide.cli.console import progress
from duoglide.cli.options import number, point

if TYPE_CHECKING:
    from duoglide.motion.path.path import Path as MotionPath
    from duoglide.planning.programs.read import Reading

Program: TypeAlias = Annotated[
    Path | None,
    typer.Argument(
        metavar="PROGRAM", help="A program: TOML, CSV or G-code.", autocompletion=files(*PROGRAMS)
    ),
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """What the command line says of a move; each field is an option of every verb about one."""

    program: Program = None
    point: Points = None
    pick: Pick = None
    place: Place = None
    lift: Lift = None
    tolerance: Tolerance = None
    ignore: Ignore = None

    def read(self) -> Reading:
        """Build the path, and tell how a program was read.

        Raises:
            typer.BadParameter: Not one of a program, points, and a pick and a place; no numbers.
            DuoglideError: The program cannot be read, or describes no path.
        """
        from duoglide.planning.programs.read import Reading

        tolerance = None if self.tolerance is None else number(self.tolerance, "--tolerance", "mm")
        if self.program is not None:
            return self._read_program(self.program, tolerance or 0.0)
        if self.ignore:
            raise typer.BadParameter("--ignore goes with a PROGRAM")
        return Reading(self._path(2.0 if tolerance is None else tolerance))

    def _read_program(self, program: Path, tolerance: float) -> Reading:
        from duoglide.planning.programs.read import read_with_notes

        if self.point or self._picks:
            raise typer.BadParameter("--point, --pick, --place and --lift do not go with a PROGRAM")
        words = [word for text in self.ignore or [] for word in text.split(",") if word.strip()]
        return read_with_notes(program, tolerance, words)

    def _path(self, tolerance: float) -> MotionPath:
        if self.point:
            if self._picks:
                raise typer.BadParameter("--pick, --place and --lift do not go with --point")
            from duoglide.motion.path.path import Path as MotionPath

            return MotionPath.polyline([point(text, "--point") for text in self.point], tolerance)
        if self.pick is None or self.place is None:
            raise typer.BadParameter(
                "give a PROGRAM, or --point twice, or --pick and --place X,Y,Z"
            )
        from duoglide.planning.programs.pick_and_place import pick_and_place

        return pick_and_place(
            point(self.pick, "--pick"),
            point(self.place, "--place"),
            lift=number(self.lift, "--lift", "mm") if self.lift is not None else 25.0,
            tolerance=tolerance,
        )

    @property
    def _picks(self) -> bool:
        """Whether a pick and a place are described, or a part of that."""
        return any(value is not None for value in (self.pick, self.place, self.lift))


def about_a_move(verb: Callable[..., None]) -> Callable[..., None]:
    """Make the fields of ``Move`` options of a verb, whose first argument is a move."""
    hints = get_type_hints(Move, include_extras=True)
    options = [
        Parameter(f.name, Parameter.KEYWORD_ONLY, default=f.default, annotation=hints[f.name])
        for f in fields(Move)
    ]
    whole = signature(verb, eval_str=True)
    _, *own = whole.parameters.values()

    @wraps(verb)
    def run(**values: Any) -> None:
        verb(Move(**{name: values.pop(name) for name in hints}), **values)

    # typer asks for both
    run.__signature__ = whole.replace(parameters=options + own)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in options + own}
    return run


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
