"""Figures 8 to 11: singular surfaces and the workspace."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.drawing.section import with_walls
from duoglide.kinematics.workspace import Constraints, section
from duoglide.machine import Geometry
from duoglide.paper.figures.frame import frame
from duoglide.paper.figures.joint_space import joint_space_panels
from duoglide.paper.figures.plates import Flat, Plate, Solid
from duoglide.paper.figures.scene import Panels, Scene, View
from duoglide.paper.figures.surfaces import (
    COLOURS,
    PARALLEL,
    SERIAL,
    WORKSPACE,
    extruded,
    within_reach,
    workspace_curves,
    workspace_panels,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ALONG = View(-68.0, 20.0)
CORNER = View(-38.0, 24.0)
_EDGE = "#4c5f6b"  # of the workspace
SEARCH_BOX = ((-150.0, 150.0), (-200.0, 200.0), (380.0, 550.0))  # Section 4 of the paper
XYZ = ("x [mm]", "y [mm]", "z [mm]")


def figure_8(geometry: Geometry) -> Plate:
    """Singular surfaces in the workspace."""
    panels: list[Solid | Flat] = [
        Solid("(a)  serial", _surfaces(geometry, SERIAL), ALONG),
        Solid("(b)  parallel", _surfaces(geometry, PARALLEL), ALONG),
    ]
    caption = (
        "The whole algebraic surfaces in the workspace, for all inverse solutions: cylinders along"
        " y over circles, lines and one quartic, as elimination gives them. The paper's serial"
        " surfaces lack the flat arm (planes), where the branches v meet; its parallel ones lack"
        " legs flat, and it holds case 2 (quartic) to be empty. Case 1 has no surface here: it"
        " fills the workspace of the modes w1 = w2."
    )
    key = [(name, COLOURS[name]) for name in (*SERIAL, *PARALLEL)]
    return Plate(8, "Singular surfaces in the workspace", caption, panels, 2, (7.2, 4.2), key)


def _surfaces(geometry: Geometry, families: tuple[str, ...]) -> Scene:
    """Return the surfaces of some families between y = -200 and 200."""
    scene = Scene()
    curves = [c for c in workspace_curves(geometry) if c.family in families]
    for curve in curves:
        opacity = 0.45 if curve.family == "arm flat" else 0.75
        corners = extruded(curve.points, (-200.0, 200.0))
        scene.add(Panels(corners, COLOURS[curve.family], opacity))
    _box(scene, XYZ, ALONG)
    return scene


def figure_9(geometry: Geometry) -> Plate:
    """Singular surfaces in the space of the carriages."""
    half = geometry.rail_half_length
    names = (r"$y_{A1}$ [mm]", r"$y_{A2}$ [mm]", r"$y_{A3}$ [mm]")
    panels: list[Solid | Flat] = []
    for title, families in (
        ("(a)  serial", SERIAL),
        ("(b)  parallel", ("legs parallel", *PARALLEL)),
    ):
        scene = Scene()
        scene.add(*joint_space_panels(geometry, families, half))
        cube = np.full(3, half)
        scene.merge(frame(-cube, cube, names, CORNER))
        panels.append(Solid(title, scene, CORNER))
    caption = (
        "The surfaces in the space of the carriages, within the rails; all of them run along"
        " (1, 1, 1), the direction in which the platform moves along y. Legs vertical and legs"
        " parallel are one plane, yA2 - yA1 = l3. As in Fig. 8, arm flat and legs flat are not in"
        " the paper. Case 2 is drawn on both of its branches (both signs of sin beta)."
    )
    key = [(name, COLOURS[name]) for name in (*SERIAL, "legs parallel", *PARALLEL)]
    return Plate(9, "Singular surfaces of the carriages", caption, panels, 2, (7.2, 4.4), key)


def figure_10(geometry: Geometry) -> Plate:
    """The workspace and its projections."""
    scene = Scene()
    scene.add(workspace_panels(geometry))
    _box(scene, XYZ, CORNER)
    panels: list[Solid | Flat] = [
        Solid("(a)  workspace", scene, CORNER),
        Flat("(b)  projection along x", partial(_side, geometry)),
        Flat("(c)  projection along y", partial(_front, geometry)),
    ]
    area = section(geometry).area
    caption = (
        "The workspace of the machine's mode (n = +1) between the ends of the rails; its"
        f" cross-section has {area * 1e-3:.2f} litres per metre along y. Both outlines are exact;"
        " that in (c) is made of arcs and one quartic. The paper searches 380 <= z <= 550 (dashed"
        " box); no point of it is within reach, because z cannot exceed l1 + l8 + l9 = "
        f"{geometry.carriage_height + geometry.strut_drop + geometry.strut_length:g}."
    )
    return Plate(10, "Workspace", caption, panels, 3, (9.6, 3.3))


def _side(geometry: Geometry, axes: Axes) -> None:
    """Draw the shadow of the workspace in the yz plane."""
    half = geometry.rail_half_length
    limits = Constraints(travel=half)
    spans = []
    for y in np.linspace(-half, half, 121).tolist():
        pieces = section(geometry, limits, y).pieces
        if pieces:
            x = [np.linspace(p.start + 1e-6, p.end - 1e-6, 41) for p in pieces]
            low = min(np.nanmin(p.low.z(at)) for p, at in zip(pieces, x, strict=True))
            high = max(np.nanmax(p.high.z(at)) for p, at in zip(pieces, x, strict=True))
            spans.append((y, float(low), float(high)))
    along, lowest, highest = np.array(spans).T
    axes.fill_between(along, lowest, highest, color=WORKSPACE, alpha=0.4, lw=0)
    around = np.concatenate([[lowest[0]], highest, lowest[::-1]])
    axes.plot(np.concatenate([along[:1], along, along[::-1]]), around, color=_EDGE, lw=1.0)
    _dashed_box(axes, SEARCH_BOX[1], SEARCH_BOX[2])
    axes.set(xlabel="y [mm]", ylabel="z [mm]", xlim=(-370, 370), ylim=(0, 580))
    axes.set_aspect("equal")


def _front(geometry: Geometry, axes: Axes) -> None:
    """Draw the cross-section, which is also the shadow along y."""
    _fill_section(axes, geometry)
    _dashed_box(axes, SEARCH_BOX[0], SEARCH_BOX[2])
    axes.annotate("searched in\nthe paper", (0, 465), ha="center", va="center", fontsize=6.5)
    axes.set(xlabel="x [mm]", ylabel="z [mm]", xlim=(-200, 260), ylim=(0, 580))
    axes.set_aspect("equal")


def _fill_section(axes: Axes, geometry: Geometry) -> None:
    """Fill the exact cross-section and draw its outline."""
    found = section(geometry)
    for piece in found.pieces:
        x = np.linspace(piece.start + 1e-6, piece.end - 1e-6, 200)
        axes.fill_between(x, piece.low.z(x), piece.high.z(x), color=WORKSPACE, alpha=0.4, lw=0)
    for line in with_walls([line for _, line in found.outline()]):
        axes.plot(*line.T, color=_EDGE, lw=1.0)


def _dashed_box(axes: Axes, across: tuple[float, float], up: tuple[float, float]) -> None:
    x = [across[0], across[1], across[1], across[0], across[0]]
    z = [up[0], up[0], up[1], up[1], up[0]]
    axes.plot(x, z, color="#777777", lw=0.8, ls=(0, (3, 2)))


def figure_11(geometry: Geometry) -> Plate:
    """Workspace and singular surfaces together."""
    panels: list[Solid | Flat] = []
    for letters, families, what in (("ab", SERIAL, "serial"), ("cd", PARALLEL, "parallel")):
        scene = Scene()
        scene.add(workspace_panels(geometry))
        for name, line in _bordering(geometry, families):
            corners = extruded(line[np.linspace(0, len(line) - 1, 90).astype(int)], (-340.0, 340.0))
            scene.add(Panels(corners, COLOURS[name], 0.5))
        _box(scene, XYZ, ALONG, half_y=360.0)
        panels.append(Solid(f"({letters[0]})  {what}", scene, ALONG))
        panels.append(
            Flat(f"({letters[1]})  {what}, along y", partial(_front_surfaces, geometry, families))
        )
    caption = (
        "The workspace (grey) and the singular surfaces of the machine's own branch v = +1, as far"
        " as they border on reach. Serial ones are edges of reach; beyond legs flat and case 2 lie"
        " poses of other assembly modes (m = -1, n = -1), which the machine cannot enter: the"
        " workspace ends there, and holds no singular pose inside. In the paper the workspace is"
        " drawn where none is (z from 380), and the parallel surfaces lack both families."
    )
    key = [("workspace", WORKSPACE), *((n, COLOURS[n]) for n in (*SERIAL, *PARALLEL))]
    return Plate(11, "Singular surfaces and workspace", caption, panels, 2, (7.2, 7.4), key)


def _bordering(geometry: Geometry, families: tuple[str, ...]) -> list[tuple[str, FloatArray]]:
    """Return what of the surfaces borders on the reach of the branch v = +1."""
    return [
        (curve.family, line)
        for curve in workspace_curves(geometry, v=1)
        if curve.family in families
        for line in within_reach(geometry, curve)
    ]


def _front_surfaces(geometry: Geometry, families: tuple[str, ...], axes: Axes) -> None:
    """Draw the cross-section with the curves of some families."""
    _fill_section(axes, geometry)
    for name, line in _bordering(geometry, families):
        axes.plot(*line.T, color=COLOURS[name], lw=1.8)
    axes.set(xlabel="x [mm]", ylabel="z [mm]")
    axes.set_aspect("equal")


def _box(
    scene: Scene, names: tuple[str, str, str], view: View, half_y: float | None = None
) -> None:
    """Put a box with scales around the panels of a scene."""
    points = np.concatenate([group.corners.reshape(-1, 3) for group in scene.panels])
    low, high = points.min(axis=0), points.max(axis=0)
    if half_y is not None:
        low[1], high[1] = -half_y, half_y
    step = 50.0
    scene.merge(frame(np.floor(low / step) * step, np.ceil(high / step) * step, names, view))
