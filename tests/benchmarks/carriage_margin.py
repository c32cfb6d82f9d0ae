"""What a carriage margin costs: ``python tests/benchmarks/carriage_margin.py [PICTURE]``.

Printed for the default machine: which share of the cross-section that its clearance allows each
carriage margin loses, and by how much a clearance suffices above legs flat. The picture is the one
in the docs.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

import duoglide as dg
from duoglide.drawing.picture import CURVE, LIMIT, LOST, Picture, drawn, save
from duoglide.drawing.section import OUTLINE, with_walls
from duoglide.kinematics.workspace import section

STEP = 0.5  # mm
ACROSS, UP = (-140.0, 230.0), (80.0, 372.0)
LEVELS = (2.0, 5.0, 10.0, 20.0, 30.0)
LABELS = ((45.0, 275.0), (45.0, 290.0), (45.0, 305.0), (-30.0, 308.0), (-75.0, 305.0))
MIDDLE = 45.0  # x above the legs' feet, where only the legs bound the reach from below


def measure(machine: dg.Machine) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return x, z, clearance and carriage margin over them, NaN outside of the own workspace."""
    g = machine.geometry
    x, z = np.arange(*ACROSS, STEP), np.arange(*UP, STEP)
    grid = np.stack(np.broadcast_arrays(x[None, :], 0.0, z[:, None]), axis=-1)
    own = np.array(dg.reachable(g, grid))
    sides = dg.margins(g, grid[own])
    own[own] = (sides.legs_flat > 0.0) & (sides.arm_strut > 0.0)
    room, loose = np.full((2, *own.shape), np.nan)
    room[own], loose[own] = dg.clearance(g, grid[own]), dg.carriage_margin(g, grid[own])
    return x, z, room, loose


def draw(machine: dg.Machine, fields: tuple[np.ndarray, ...]) -> Picture:
    """Draw what is lost across the rails, and why: both measures straight above legs flat."""
    with drawn((7.2, 3.5)) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.55, 1.0))
        _draw_lost(left, machine, fields)
        _draw_above_legs_flat(right, machine)
    return figure


def _draw_lost(axes: Axes, machine: dg.Machine, fields: tuple[np.ndarray, ...]) -> None:
    x, z, room, loose = fields
    clear = np.nan_to_num(room) >= machine.clearance
    kept, lost = (
        clear & (loose >= machine.carriage_margin),
        clear & (loose < machine.carriage_margin),
    )
    axes.contourf(x, z, kept, levels=[0.5, 1.5], colors=[CURVE], alpha=0.22)
    axes.contourf(x, z, lost, levels=[0.5, 1.5], colors=[LOST], alpha=0.75)
    lines = axes.contour(x, z, loose, levels=LEVELS, colors=CURVE, linewidths=0.7)
    axes.clabel(lines, fmt="%g", fontsize=6.5, manual=LABELS)
    for line in with_walls([line for _, line in section(machine.geometry).outline()]):
        axes.plot(*line.T, color=OUTLINE, linewidth=0.8)
    share = lost.sum() / clear.sum()
    axes.set_xlim(*ACROSS)
    axes.set_ylim(*UP)
    axes.set_aspect("equal", adjustable="box")
    axes.set(xlabel="x [mm]", ylabel="z [mm]", title="Across the rails")
    axes.grid(visible=False)
    keys = [
        Patch(color=CURVE, alpha=0.22, label="kept; lines: carriage margin [mm]"),
        Patch(
            color=LOST,
            alpha=0.75,
            label=f"carriage margin below {machine.carriage_margin:g} mm: {100.0 * share:.0f} %",
        ),
    ]
    axes.legend(handles=keys, loc="lower center", fontsize=6.5, framealpha=0.9)


def _draw_above_legs_flat(axes: Axes, machine: dg.Machine) -> None:
    g = machine.geometry
    flat = _height_of_legs_flat(g)
    above = np.geomspace(0.5, 40.0, 200)
    places = np.stack([np.full(above.size, MIDDLE), np.zeros(above.size), flat + above], axis=-1)
    loose = dg.carriage_margin(g, places)
    axes.loglog(above, loose, color=CURVE)
    axes.axhline(machine.carriage_margin, color=LIMIT, linestyle="--", linewidth=1.0)
    axes.axvline(machine.clearance, color=LIMIT, linestyle="--", linewidth=1.0)
    at = float(np.interp(machine.clearance, above, loose))
    axes.plot(machine.clearance, at, "o", color=LOST, markersize=4.0)
    axes.annotate(
        f"{machine.clearance:g} mm of clearance are\n{at:.3f} mm of the carriages",
        (machine.clearance, at), (8.0, -4.0), textcoords="offset points", fontsize=7.0, va="top",
    )  # fmt: skip
    for axis, ticks in (
        (axes.xaxis, (0.5, 1, 2, 5, 10, 20, 40)),
        (axes.yaxis, (0.001, 0.01, 0.1, 1, 10)),
    ):
        axis.set_major_locator(FixedLocator(ticks))
        axis.set_major_formatter(FixedFormatter([f"{tick:g}" for tick in ticks]))
        axis.set_minor_locator(NullLocator())
    axes.set(
        title=f"Above legs flat, x = {MIDDLE:g} mm",
        xlabel="clearance [mm]",
        ylabel="carriage margin [mm]",
    )


def _height_of_legs_flat(g: dg.Geometry) -> float:
    """Return z of the platform at ``MIDDLE`` with the legs flat [mm]."""
    low, high = 100.0, 330.0
    for _ in range(60):
        z = 0.5 * (low + high)
        inside = bool(dg.margins(g, (MIDDLE, 0.0, z)).legs_flat > 0.0)
        low, high = (low, z) if inside else (z, high)
    return high


def main(picture: str = "") -> None:
    """Measure, print, draw."""
    machine = dg.Machine.default()
    fields = measure(machine)
    _, _, room, loose = fields
    clear = np.nan_to_num(room) >= machine.clearance
    print(f"clear by {machine.clearance:g} mm: {clear.sum() * STEP**2 / 100.0:.1f} cm^2")
    for needed in (0.2, 0.5, 1.0, 2.0, 5.0):
        share = float((loose[clear] < needed).mean())
        print(f"a carriage margin of {needed:g} mm loses {100.0 * share:.1f} % of it")
    flat = _height_of_legs_flat(machine.geometry)
    for above in (2.0, 5.0, 10.0, 20.0):
        margin = float(dg.carriage_margin(machine.geometry, (MIDDLE, 0.0, flat + above)))
        print(f"{above:g} mm above legs flat the carriage margin is {margin:.3f} mm")
    if picture:
        save(draw(machine, fields), Path(picture))


if __name__ == "__main__":
    main(*sys.argv[1:])
