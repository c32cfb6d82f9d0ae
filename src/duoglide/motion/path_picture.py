"""Pictures of a path, as it is programmed and once it is checked, and their notebook tables."""

from __future__ import annotations

from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from duoglide.arrays import FloatArray
from duoglide.drawing.notebook import Rows, notebook_html
from duoglide.drawing.picture import COLOURS, LIMIT, Picture, drawn
from duoglide.drawing.section import draw_section
from duoglide.errors import PathError
from duoglide.kinematics.model import reachable
from duoglide.kinematics.singularity import clearance
from duoglide.machine import Machine
from duoglide.motion.blend import Blend
from duoglide.motion.blending import round_corners
from duoglide.motion.checked import CheckedPath, CheckReport
from duoglide.motion.curve import Curve
from duoglide.motion.path import Path
from duoglide.motion.path_segments import show

_SAMPLES = 2000
_LEAST = 5.0  # [mm] that a view shows on both sides of the middle, however flat the path is
_STEPS = (1, 2, 5, 10)  # of the scales
_FAILURE: dict[str, Any] = {
    "color": "#cc0050",
    "markersize": 8.0,
    "markeredgewidth": 2.0,
    "label": "fails first here",
}
_LETTERS = 112  # of words above a picture, a line
_LARGE, _SMALL = (7.0, 3.6), (5.0, 2.6)


def plot_path(path: Path, size: tuple[float, float] = _LARGE) -> Picture:
    """Draw a path with its corners rounded: see ``Path.plot``."""
    points = _points_of(round_corners(path).curve)
    halts = np.array([path.waypoints[i] for i, _ in path.actions]).reshape(-1, 3)
    with drawn(size) as figure:
        views: dict[str, Axes] = figure.subplot_mosaic(
            [["side", "front"], ["top", "."]], width_ratios=(2.0, 1.0)
        )
        for name, across, up, title in (
            ("side", 1, 2, "From the side"),
            ("front", 0, 2, "Across the rails"),
            ("top", 1, 0, "From above"),
        ):
            _draw_view(views[name], points, np.array(path.waypoints), (across, up), title)
            views[name].plot(halts[:, across], halts[:, up], "o", color=COLOURS[1], markersize=4.0)
    return figure


def path_html(path: Path) -> str:
    """Return what a notebook shows of a path."""
    try:
        length = f"{float(round_corners(path).curve.length):.1f} mm, corners rounded"
        figure = plot_path(path, _SMALL)
    except PathError as error:  # explicit blends that do not fit: still a value to look at
        length, figure = str(error), None
    rows = [
        ("from", f"{show(path.start)} mm"),
        ("to", f"{show(path.end)} mm"),
        ("length", length),
        ("segments", f"{len(path.segments)}"),
        ("corners", _corners(path)),
        ("actions", f"{len(path.actions)}"),
        ("tool speed", _cap(path.tool_speed, "mm/s")),
        ("tool acceleration", _cap(path.tool_acceleration, "mm/s²")),
    ]
    return notebook_html("Path", [rows], figure)


def plot_checked(checked: CheckedPath, size: tuple[float, float] = (7.0, 5.6)) -> Picture:
    """Draw a checked path: see ``CheckedPath.plot``."""
    return _plot_in(checked.machine, _points_of(checked.curve), None, size)


def plot_refused(machine: Machine, path: Path, refusal: PathError) -> Picture:
    """Draw a path that a machine cannot follow, as a checked one is drawn, and where it fails.

    Raises:
        PathError: Explicit blends do not fit, so that there is no path.
    """
    offset = np.subtract(machine.work_frame, machine.tool_offset)
    points = _points_of(round_corners(path).curve.moved(offset))
    where = np.array(refusal.position) if refusal.position else None
    return _plot_in(machine, points, where, (7.0, 6.0), fill(str(refusal), _LETTERS))


def checked_html(checked: CheckedPath) -> str:
    """Return what a notebook shows of a checked path."""
    head = [("from", f"{show(checked.path.start)} mm"), ("to", f"{show(checked.path.end)} mm")]
    head.append(("length", f"{float(checked.curve.length):.1f} mm"))
    return notebook_html(
        "Checked path", [head, _margins(checked.report)], plot_checked(checked, (6.0, 4.8))
    )


def margins_html(report: CheckReport) -> str:
    """Return what a notebook shows of a check's margins."""
    return notebook_html("Least margins", [_margins(report)])


def _margins(report: CheckReport) -> Rows:
    """Return a table of the least margins."""
    return [("least margin", "is", "needed", "along the path", "platform at")] + [
        (
            entry.family.replace("_", " "),
            f"{entry.margin:.2f} mm",
            f"{entry.required:g} mm",
            f"{entry.arc_length:.1f} mm",
            f"({', '.join(f'{value:.1f}' for value in entry.position)}) mm",
        )
        for entry in report.least
    ]


def _points_of(curve: Curve) -> FloatArray:
    """Return positions along a curve [mm], shape (n, 3); the ends of its pieces are among them."""
    sigma = np.unique(np.concatenate([np.linspace(0.0, curve.end, _SAMPLES), curve.breaks]))
    return curve.derivatives(sigma)[:, 0]


def _plot_in(
    machine: Machine,
    points: FloatArray,
    failure: FloatArray | None,
    size: tuple[float, float],
    words: str = "",
) -> Picture:
    """Draw positions of the platform [mm], shape (n, 3), in the machine, and where they fail."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    within = reachable(machine.geometry, points)
    room = np.full(len(points), np.nan)
    room[within] = clearance(machine.geometry, points[within])
    with drawn(size) as figure:
        if words:
            figure.suptitle(words, fontsize=8.0, x=0.01, ha="left")
        views = figure.subplot_mosaic("aa;bc", height_ratios=(1.0, 1.6), width_ratios=(1.25, 1.0))
        side, section, way = views["a"], views["b"], views["c"]
        _draw_view(side, points, points[[0, -1]], (1, 2), "From the side")
        draw_section(section, machine, points)
        section.plot(points[:, 0], points[:, 2], color=COLOURS[1], linewidth=2.0)
        section.plot(*points[[0, -1]][:, ::2].T, ".", color=COLOURS[1], markersize=6.0)
        way.plot(along, room, color=COLOURS[0])
        way.axhline(machine.clearance, color=LIMIT, linestyle="--", linewidth=1.0)
        way.annotate(
            "needed", (along[-1], machine.clearance), (0.0, 2.0), ha="right", color=LIMIT,
            textcoords="offset points", fontsize=7.5,
        )  # fmt: skip
        way.set(title="Clearance [mm]", xlabel="along the path [mm]")
        way.set_xlim(-0.03 * along[-1], 1.03 * along[-1])
        way.set_ylim(0.0, 1.08 * np.nanmax(room, initial=max(machine.clearance, 1.0)))
        if failure is not None:
            nearest = along[np.linalg.norm(points - failure, axis=1).argmin()]
            side.plot(failure[1], failure[2], "x", **_FAILURE)
            section.plot(failure[0], failure[2], "x", **_FAILURE)
            way.axvline(nearest, color=_FAILURE["color"], linewidth=1.0)
            side.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    return figure


def _draw_view(
    axes: Axes, points: FloatArray, marks: FloatArray, plane: tuple[int, int], title: str
) -> None:
    """Draw points as they are seen along the third axis, at one scale, and marks on them."""
    across, up = plane
    axes.plot(points[:, across], points[:, up], color=COLOURS[0])
    axes.plot(marks[:, across], marks[:, up], ".", color=COLOURS[0], markersize=5.0)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))[[across, up]]
    axes.update_datalim([middle - _LEAST, middle + _LEAST])
    axes.margins(0.08)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(title=title, xlabel=f"{'xyz'[across]} [mm]", ylabel=f"{'xyz'[up]} [mm]")
    axes.xaxis.set_major_locator(MaxNLocator(6 if across == 1 else 3, steps=_STEPS))
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=_STEPS))


def _corners(path: Path) -> str:
    """Return what the corners are, in words."""
    blends = sum(isinstance(corner, Blend) for corner in path.corners)
    tolerances = [corner for corner in path.corners if not isinstance(corner, Blend)]
    rounded = [value for value in tolerances if value > 0.0]
    words = [f"{blends} explicit"] if blends else []
    if rounded:
        low, high = min(rounded), max(rounded)
        span = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        words.append(f"{len(rounded)} within {span} mm")
    if exact := len(tolerances) - len(rounded):
        words.append(f"{exact} exact")
    return ", ".join(words) or "none"


def _cap(value: float | None, unit: str) -> str:
    return f"at most {value:g} {unit}" if value is not None else "not capped"
