"""The workspace across the rails, which looks the same all along y, as far as the rails go."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics.carriage_margin import margin_up_to
from duoglide.kinematics.constants import pose_constants
from duoglide.kinematics.model import reachable
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.reach import reach_of
from duoglide.kinematics.singularity.margins import clearance
from duoglide.kinematics.workspace import section
from duoglide.machine import Machine

OUTLINE = "#222222"
ROOM = LinearSegmentedColormap.from_list("room", ["#fbfbfc", "#75858f"])
"""The more room, the darker; a path is seen on all of it."""
_CELLS = 240
_MARGIN = 12.0  # [mm] around what is drawn


def draw_section(axes: Axes, machine: Machine, around: ArrayLike) -> None:
    """Draw the clearance across the rails and the edge of the reach.

    Args:
        axes: Where to.
        machine: Whose; what is nearer to a singular surface than its clearance is left white, and
            what keeps that but not its carriage margin is hatched.
        around: Positions [mm], shape (n, 3). Drawn is the part of the reach that holds them: what
            lies beyond a singular surface is another workspace.
    """
    seeds = np.asarray(around, dtype=np.float64).reshape(-1, 3)
    x, z, room = _field(machine, seeds)
    drawn = axes.contourf(x, z, room, levels=_levels(room), cmap=ROOM, antialiased=False)
    axes.figure.colorbar(drawn, ax=axes, label="clearance [mm]", shrink=0.85, pad=0.02)
    _hatch(axes, machine, (x, z, room))
    for line in with_walls([line for _, line in section(machine.geometry).outline()]):
        axes.plot(*line.T, color=OUTLINE, linewidth=0.7)
    inside = np.argwhere(np.isfinite(room))
    field = np.stack([x[inside[:, 1]], z[inside[:, 0]]], axis=-1)
    low, high = (edge(np.vstack([field, seeds[:, ::2]]), axis=0) for edge in (np.min, np.max))
    axes.set_xlim(low[0] - _MARGIN, high[0] + _MARGIN)
    axes.set_ylim(low[1] - _MARGIN, high[1] + _MARGIN)
    axes.set_aspect("equal", adjustable="box")
    axes.set(title="Across the rails", xlabel="x [mm]", ylabel="z [mm]")
    axes.grid(visible=False)


def _hatch(axes: Axes, machine: Machine, field: tuple[FloatArray, FloatArray, FloatArray]) -> None:
    """Hatch what keeps the machine's clearance, but not its carriage margin; say what it is."""
    x, z, room = field
    row, column = np.nonzero(np.isfinite(room))
    places = np.stack([x[column], np.zeros(row.size), z[row]], axis=-1)
    reach = reach_of(places, pose_constants(machine.geometry, WORKING))
    needed = machine.carriage_margin
    found = margin_up_to(machine.geometry, places, reach, enough=needed)
    if (found >= needed).all():
        return
    lost = np.zeros(room.shape)
    lost[row, column] = found < needed
    axes.contourf(x, z, lost, levels=[0.5, 1.5], colors="none", hatches=["//////"])
    patch = Patch(facecolor="none", hatch="//////", label=f"carriage margin below {needed:g} mm")
    axes.legend(handles=[patch], loc="lower center", fontsize=7.0)


def with_walls(lines: list[FloatArray]) -> list[FloatArray]:
    """Close the outline of a section.

    Args:
        lines: The curves below and above, piece by piece in rising x, each of shape (n, 2).

    Returns:
        The same, and a wall at both ends.
    """
    ends = ((lines[:2], 0), (lines[-2:], -1)) if lines else ()
    return [*lines, *(np.stack([line[end] for line in pair]) for pair, end in ends)]


def _levels(room: FloatArray) -> FloatArray:
    """Return steps of clearance from 0 that people can read: 1, 2 or 5 times a power of ten."""
    most = float(np.nanmax(room, initial=0.0))
    if most <= 0.0:
        return np.array([0.0, 1.0])
    power = 10.0 ** np.floor(np.log10(most / 5.0))
    step = next(s for s in (power, 2.0 * power, 5.0 * power, 10.0 * power) if most / s <= 10.0)
    return np.arange(0.0, most + step, step)


def _field(machine: Machine, seeds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x, z and the clearance over them, NaN where it is less than the machine's."""
    g = machine.geometry
    wide = g.arm_length + abs(g.platform_half_width) + g.rail_half_spacing
    high = g.carriage_height + g.strut_length + g.strut_drop
    x = np.linspace(min(-wide, seeds[:, 0].min()), max(wide, seeds[:, 0].max()), _CELLS + 1)
    z = np.linspace(min(0.0, seeds[:, 2].min()), max(1.05 * high, seeds[:, 2].max()), _CELLS + 1)
    grid = np.stack(np.broadcast_arrays(x[None, :], seeds[0, 1], z[:, None]), axis=-1)
    within = reachable(g, grid)
    room = np.full(within.shape, np.nan)
    room[within] = clearance(g, grid[within])
    cell = max(x[1] - x[0], z[1] - z[0])
    clear = np.nan_to_num(room) >= max(machine.clearance, 1.5 * cell)
    room[~_part_with(clear, x, z, seeds) | (room < machine.clearance)] = np.nan
    return x, z, room


def _part_with(clear: BoolArray, x: FloatArray, z: FloatArray, seeds: FloatArray) -> BoolArray:
    """Return the connected parts of ``clear`` that hold seeds, and a rim; all of it without any."""
    from scipy import ndimage

    labels, _ = ndimage.label(clear)
    columns = np.abs(seeds[:, :1] - x).argmin(axis=1)
    lines = np.abs(seeds[:, 2:] - z).argmin(axis=1)
    found = np.unique(labels[lines, columns])
    found = found[found > 0]
    part = np.isin(labels, found) if found.size else clear
    grown: BoolArray = ndimage.binary_dilation(part, iterations=2)
    return grown
