"""Curves of the three carriages over time, with their limits."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite

from matplotlib.axes import Axes

from duoglide.arrays import AXES, FloatArray
from duoglide.drawing.picture import COLOURS, LIMIT, WIDTHS
from duoglide.machine import Machine


def draw_carriages(axes: Axes, times: FloatArray, values: FloatArray, machine: Machine) -> None:
    """Draw positions along the rails between the rails' ends, and the key to all curves.

    Args:
        axes: Where to.
        times: [s], shape (n,).
        values: [mm], shape (n, 3).
        machine: Whose.
    """
    draw_curves(axes, times, values)
    travel = machine.geometry.rail_half_length
    for end in (-travel, travel):
        axes.axhline(end, color=LIMIT, linestyle="--", linewidth=1.0)
    axes.set_title("Carriages [mm]")
    axes.plot([], [], color=LIMIT, linestyle="--", linewidth=1.0, label="limit")
    draw_key(axes)


def draw_key(axes: Axes) -> None:
    """Draw the key to the curves above the axes, at the right."""
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=4,
        borderaxespad=0.1,
        handlelength=1.4,
        handletextpad=0.5,
        columnspacing=1.2,
    )


def draw_limited(
    axes: Axes, times: FloatArray, values: FloatArray, limits: FloatArray, title: str
) -> None:
    """Draw three curves and the limits that they keep.

    Args:
        axes: Where to.
        times: [s], shape (n,).
        values: Shape (n, 3).
        limits: Of each carriage, shape (3,).
        title: With the unit.
    """
    draw_curves(axes, times, values)
    for limit in sorted(filter(isfinite, set(limits.tolist()))):
        for sign in (-1.0, 1.0):
            axes.axhline(sign * limit, color=LIMIT, linestyle="--", linewidth=1.0)
    axes.set_title(title)


def draw_curves(axes: Axes, times: FloatArray, values: FloatArray) -> None:
    """Draw one curve per carriage; ``values`` has shape (n, 3)."""
    for axis in range(AXES):
        axes.plot(
            times,
            values[:, axis],
            color=COLOURS[axis],
            linewidth=WIDTHS[axis],
            label=f"carriage {axis + 1}",
        )


def finish(rows: Iterable[Axes], label: str) -> None:
    """Give rows of axes that share their time its name, and their curves some room."""
    last = None
    for axes in rows:
        axes.margins(x=0.01, y=0.1)
        last = axes
    if last is not None:
        last.set_xlabel(label)
