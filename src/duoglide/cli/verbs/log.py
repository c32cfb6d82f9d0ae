"""``duoglide log``: what a plan or a run says, and its way into other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from duoglide.cli.completion import RECORDINGS, files
from duoglide.cli.console import say, say_facts, say_json, triple, working
from duoglide.cli.options import Json
from duoglide.cli.outputs import Force, require_new, require_picture, require_place

if TYPE_CHECKING:
    from duoglide.playback.compare import Comparison, RunSide
    from duoglide.playback.summary import LogSummary, RunSummary
    from duoglide.storage import Log

_HELP = """\
Summarise a log: events, following error, lateness; or export or compare it.

A log that was killed or damaged is read up to its last whole record.
"""
_EXAMPLE = """\
Examples:

duoglide log run.mcap

duoglide log run.mcap --csv run.csv --candump run.log

duoglide log run.mcap --foxglove full.mcap --layout layout.json

duoglide log run.mcap --picture run.png

duoglide log run.mcap --compare again.mcap
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("log", help=_HELP, epilog=_EXAMPLE)(log)


def log(
    file: Annotated[
        Path, typer.Argument(help="A plan or a run (.mcap).", autocompletion=files(*RECORDINGS))
    ],
    *,
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="Write a table, a row a cycle.")
    ] = None,
    parquet: Annotated[
        Path | None,
        typer.Option("--parquet", metavar="FILE", help="The same as Parquet (extra: parquet)."),
    ] = None,
    candump: Annotated[
        Path | None,
        typer.Option(
            "--candump",
            metavar="FILE",
            help="Write the cycles' frames (candump .log, .asc, .blf or .trc).",
        ),
    ] = None,
    foxglove: Annotated[
        Path | None,
        typer.Option(
            "--foxglove",
            metavar="FILE",
            help="Write MCAP with derived topics and the 3D scene.",
        ),
    ] = None,
    layout: Annotated[
        Path | None,
        typer.Option("--layout", metavar="FILE", help="Write the layout that shows it (.json)."),
    ] = None,
    rerun: Annotated[
        Path | None,
        typer.Option("--rerun", metavar="FILE", help="Write for Rerun (.rrd; extra: rerun)."),
    ] = None,
    ros2: Annotated[
        Path | None,
        typer.Option("--ros2", metavar="FOLDER", help="Write a ROS 2 bag (extra: ros2)."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", metavar="FILE", help="Draw it over time (png, pdf)."),
    ] = None,
    other: Annotated[
        Path | None,
        typer.Option("--compare", metavar="OTHER", help="Compare with another run."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Summarise a log: events, following error, lateness; or export or compare it."""
    goals = {
        "csv": csv,
        "parquet": parquet,
        "candump": candump,
        "foxglove": foxglove,
        "layout": layout,
        "rerun": rerun,
        "ros2": ros2,
    }
    require_place(*goals.values(), picture, reads=(file, other), force=force)
    require_picture(picture)
    require_new(ros2)
    from duoglide.storage import read_log

    with working("opening"):
        opened = read_log(file)
    written = {k: str(goal) for k, goal in {**goals, "picture": picture}.items() if goal}
    exports = _exports(goals)
    for name, goal, write in exports:
        with working(f"writing {goal}"):
            count = write(opened, goal)
        if not as_json:
            say(f"{goal}: {count} {name}")
    if picture is not None:
        with working(f"drawing {picture}"):
            _draw(opened, picture)
        if not as_json:
            say(f"picture: {picture}")
    if other is not None:
        _compare(opened, other, written if as_json else None)
    elif as_json or not exports:
        _summarise(opened, written if as_json else None)


def _draw(opened: Log, picture: Path) -> None:
    """Draw a plan, or a run with what it was meant to be."""
    from duoglide.drawing.picture import save
    from duoglide.playback.rebuild import plan_of, plans_of
    from duoglide.playback.run_data import read_run
    from duoglide.storage import LogKind
    from duoglide.viewer.run_picture import plot_run

    if opened.kind is LogKind.RUN:
        save(plot_run(read_run(opened), plans_of(opened)), picture)
    else:
        save(plan_of(opened).plot(), picture)


Writer = tuple[str, Path, Callable[["Log", Path], int]]


def _exports(goals: dict[str, Path | None]) -> list[Writer]:
    """Return what to write: what it counts, where to, and how."""
    if not any(goals.values()):
        return []
    from duoglide.playback.candump import write_candump
    from duoglide.playback.shown.foxglove import write_foxglove
    from duoglide.playback.shown.foxglove_layout import write_layout
    from duoglide.playback.shown.rerun_file import write_rerun
    from duoglide.playback.shown.ros2 import write_ros2
    from duoglide.playback.tables import write_csv, write_parquet

    writers: dict[str, tuple[str, Callable[[Log, Path], int]]] = {
        "csv": ("rows", write_csv),
        "parquet": ("rows", write_parquet),
        "candump": ("frames", write_candump),
        "foxglove": ("messages", write_foxglove),
        "layout": ("panels", lambda _, goal: write_layout(goal)),
        "rerun": ("rows", write_rerun),
        "ros2": ("messages", write_ros2),
    }
    return [_with_goal(writers[name], goal) for name, goal in goals.items() if goal is not None]


def _with_goal(writer: tuple[str, Callable[[Log, Path], int]], goal: Path) -> Writer:
    counted, write = writer
    return counted, goal, write


def _summarise(opened: Log, written: dict[str, str] | None) -> None:
    """Say what a log holds; as JSON, with the files that were written, where these are given."""
    from duoglide.playback.summary import summarise

    with working("reading"):
        summary = summarise(opened)
        numbers, facts = _planned(opened)
    if written is not None:
        say_json("log", {**summary.to_dict(), **numbers, "files": written})
        return
    say(f"{summary.file}: a {summary.kind}, recorded {summary.recorded}")
    say_facts(_facts(summary) + facts)
    for t, event in summary.events:
        say(f"  {t:9.3f} s  {event.kind.value}: {event.text}")


def _planned(opened: Log) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """Return what ``duoglide plan`` has said of a plan; nothing of a run."""
    from duoglide.storage import LogKind

    if opened.kind is not LogKind.PLAN:
        return {}, []
    from duoglide.cli.verbs.plan import plan_facts, plan_numbers
    from duoglide.playback.rebuild import plan_of

    trajectory = plan_of(opened)
    audit = trajectory.audit()
    facts = [("duration", f"{trajectory.duration:.4f} s"), *plan_facts(trajectory, audit)]
    return {"plan": plan_numbers(trajectory, audit)}, facts


def _facts(summary: LogSummary) -> list[tuple[str, str]]:
    rows = [("holds", ", ".join(summary.documents) or "no document")]
    if summary.missing:
        rows.append(("missing", summary.missing))
    return rows + (_run_facts(summary.run) if summary.run else [])


def _run_facts(run: RunSummary) -> list[tuple[str, str]]:
    late = run.lateness
    period = f", one every {1e3 * run.period:.3f} ms" if run.period else ""
    rows = [
        ("cycles", f"{run.cycles} in {run.duration:.3f} s{period}; {run.skipped} left out"),
        ("plan", f"up to {run.path_time:.4f} s of its path time"),
        ("worst following error", f"{triple(run.following_error, 3)} mm"),
        ("answers missing", ", ".join(map(str, run.missing))),
        ("lateness", f"median {late.median:.0f}, 99 % {late.p99:.0f}, worst {late.worst:.0f} us"),
    ]
    most = max((count for _, count in late.histogram), default=0)
    below = 0
    for edge, count in late.histogram:
        name = f"up to {edge} us" if edge else f"above {below} us"
        bar = "#" * round(30 * count / most) if most else ""
        rows.append(("", f"{name:>14} {count:8d} {bar}"))
        below = edge
    return rows


def _compare(opened: Log, other: Path, written: dict[str, str] | None) -> None:
    """Hold two runs against each other; as JSON, as ``_summarise``."""
    from duoglide.playback.compare import compare
    from duoglide.storage import read_log

    with working("comparing"):
        result = compare(opened, read_log(other))
    if written is not None:
        say_json("log", {**result.to_dict(), "files": written})
        return
    say(f"{opened.path} and {other}: {_verdict(result)}")
    say_facts(
        [
            ("worst setpoint difference", f"{triple(result.setpoint, 0)} increments"),
            ("worst position difference", f"{triple(result.actual, 3)} mm"),
            *_side_by_side(result, str(opened.path), str(other)),
        ]
    )


def _verdict(result: Comparison) -> str:
    if not result.same_path:
        return "two paths, compared at equal path time"
    if not result.same_setpoints:
        return f"the same path, but setpoints differ there, first in cycle {result.first}"
    if result.same_pace:
        return f"the same path at the same pace; all {result.common} setpoints are the same"
    return "the same path at another pace; every setpoint is the same at the same place"


def _side_by_side(result: Comparison, one: str, other: str) -> list[tuple[str, str]]:
    """Return rows with a column for each run."""
    sides = [_side(run) for run in result.runs]
    rows = [("", (one, other))]
    rows += [(name, (value, sides[1][name])) for name, value in sides[0].items()]
    width = max(len(values[0]) for _, values in rows)
    return [(name, f"{values[0]:<{width}}  {values[1]}") for name, values in rows]


def _side(run: RunSide) -> dict[str, str]:
    late = run.lateness
    return {
        "cycles on the plan": f"{run.cycles} in {run.duration:.3f} s",
        "path time": f"{run.path_time:.4f} of {run.planned:.4f} s",
        "pace": ", ".join(f"{100.0 * pace:g} %" for pace in run.paces) or "never steady",
        "worst following error": f"{triple(run.following_error, 3)} mm",
        "lateness, median and 99 %": f"{late.median:.0f} and {late.p99:.0f} us",
    }
