"""Pictures of a curve of the platform: by itself, and among the clearances of a machine."""

from __future__ import annotations

from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from duoglide.arrays import FloatArray
from duoglide.drawing.picture import CURVE, LIMIT, LOST, Picture, drawn
from duoglide.drawing.section import draw_section
from duoglide.errors import PathError
from duoglide.kinematics.carriage_margin import carriage_margin
from duoglide.kinematics.model import reachable
from duoglide.kinematics.singularity.margins import clearance
from duoglide.machine import Machine
from duoglide.motion.curve.curve import Curve

_SAMPLES = 2000
_LEAST = 5.0  # [mm] that a view shows on both sides of the middle, however flat the path is
_STEPS = (1, 2, 5, 10)  # The scales have divisions of 1, 2 or 5 times a power of ten.
_FAILURE: dict[str, Any] = {
    "color": LOST,
    "markersize": 8.0,
    "markeredgewidth": 2.0,
    "label": "fails first here",
}
_LETTERS = 112  # of words above a picture, a line


def plot_curve(
    curve: Curve,
    waypoints: FloatArray,
    halts: FloatArray,
    size: tuple[float, float] = (7.0, 3.6),
) -> Picture:
    """Draw a curve from the side, along the rails and from above.

    Args:
        curve: With its corners rounded.
        waypoints: What was programmed [mm], shape (n, 3).
        halts: Where something is done on the way [mm], shape (m, 3).
        size: Width and height [inch].
    """
    points = _sample_points(curve)
    with drawn(size) as figure:
        views: dict[str, Axes] = figure.subplot_mosaic(
            [["side", "front"], ["top", "."]], width_ratios=(2.0, 1.0)
        )
        for name, across, up, title in (
            ("side", 1, 2, "From the side"),
            ("front", 0, 2, "Across the rails"),
            ("top", 1, 0, "From above"),
        ):
            _draw_view(views[name], points, waypoints, (across, up), title)
            views[name].plot(halts[:, across], halts[:, up], "o", color=CURVE, mfc="white", ms=4.5)
    return figure


def plot_in_machine(
    machine: Machine,
    curve: Curve,
    size: tuple[float, float] = (7.0, 5.6),
    refusal: PathError | None = None,
) -> Picture:
    """Draw a curve of the platform's centre in the machine, and where it fails if it does.

    Args:
        machine: Whose clearances are shown.
        curve: In the base frame.
        size: Width and height [inch].
        refusal: Why the machine cannot follow it.
    """
    points = _sample_points(curve)
    failure = np.array(refusal.position) if refusal is not None and refusal.position else None
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    within = reachable(machine.geometry, points)
    room, loose = np.full((2, len(points)), np.nan)
    room[within] = clearance(machine.geometry, points[within])
    loose[within] = carriage_margin(machine.geometry, points[within])
    with drawn(size) as figure:
        if refusal is not None:
            figure.suptitle(fill(str(refusal), _LETTERS), fontsize=8.0, x=0.01, ha="left")
        views = figure.subplot_mosaic(
            "aa;bc;bd", height_ratios=(1.0, 0.8, 0.8), width_ratios=(1.25, 1.0)
        )
        side, section, ways = views["a"], views["b"], (views["c"], views["d"])
        _draw_view(side, points, points[[0, -1]], (1, 2), "From the side")
        draw_section(section, machine, points)
        section.plot(points[:, 0], points[:, 2], color=CURVE, linewidth=2.0)
        section.plot(*points[[0, -1]][:, ::2].T, ".", color=CURVE, markersize=6.0)
        _draw_needed(ways[0], along, room, machine.clearance, "Clearance [mm]")
        _draw_needed(ways[1], along, loose, machine.carriage_margin, "Carriage margin [mm]")
        ways[1].set_xlabel("along the path [mm]")
        if failure is not None:
            nearest = along[np.linalg.norm(points - failure, axis=1).argmin()]
            side.plot(failure[1], failure[2], "x", **_FAILURE)
            section.plot(failure[0], failure[2], "x", **_FAILURE)
            for way in ways:
                way.axvline(nearest, color=_FAILURE["color"], linewidth=1.0)
            side.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    return figure


def _draw_needed(
    axes: Axes, along: FloatArray, values: FloatArray, needed: float, title: str
) -> None:
    """Draw what is left along the path, and how much of it the machine asks for."""
    axes.plot(along, values, color=CURVE)
    axes.axhline(needed, color=LIMIT, linestyle="--", linewidth=1.0)
    axes.annotate(
        "needed", (along[-1], needed), (0.0, 2.0), ha="right", color=LIMIT,
        textcoords="offset points", fontsize=7.5,
    )  # fmt: skip
    axes.set_title(title)
    axes.set_xlim(-0.03 * along[-1], 1.03 * along[-1])
    axes.set_ylim(0.0, 1.08 * np.nanmax(values, initial=max(needed, 1.0)))


def _sample_points(curve: Curve) -> FloatArray:
    """Return positions along a curve [mm], shape (n, 3); the ends of its pieces are among them."""
    sigma = np.unique(np.concatenate([np.linspace(0.0, curve.end, _SAMPLES), curve.breaks]))
    return curve.derivatives(sigma)[:, 0]


def _draw_view(
    axes: Axes, points: FloatArray, marks: FloatArray, plane: tuple[int, int], title: str
) -> None:
    """Draw points as they are seen along the third axis, at one scale, and marks on them."""
    across, up = plane
    axes.plot(points[:, across], points[:, up], color=CURVE)
    axes.plot(marks[:, across], marks[:, up], ".", color=CURVE, markersize=5.0)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))[[across, up]]
    axes.update_datalim([middle - _LEAST, middle + _LEAST])
    axes.margins(0.08)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(title=title, xlabel=f"{'xyz'[across]} [mm]", ylabel=f"{'xyz'[up]} [mm]")
    axes.xaxis.set_major_locator(MaxNLocator(6 if across == 1 else 3, steps=_STEPS))
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=_STEPS))
