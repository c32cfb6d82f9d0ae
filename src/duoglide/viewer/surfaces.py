"""Singular surfaces and the room between them, as translucent bodies along y in the 3D page."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics.model import reachable
from duoglide.viewer.mechanism import METRES, Colour

if TYPE_CHECKING:
    from duoglide.machine import Geometry, Machine

SURFACES: dict[str, Colour] = {
    "legs flat": (213, 94, 0),
    "legs vertical": (230, 159, 0),
    "strut": (86, 180, 233),
    "arm in line with strut": (204, 0, 80),
    "arm flat": (0, 158, 115),
}
_POINTS = 721
_INSET = 1e-3  # [mm]: a point counts where its neighbourhood, this far away, is within reach


def singular_curves(geometry: Geometry) -> dict[str, list[FloatArray]]:
    """Sample the cross-sections of the singular surfaces of the machine's own working mode.

    Args:
        geometry: Dimensions of the robot.

    Returns:
        Family to polylines in the xz plane [mm], each of shape (n, 2): what of the surface lies
        in the closure of reach.
    """
    g = geometry
    arm_x = g.rail_half_spacing - g.platform_half_width
    base = g.carriage_height + g.riser_height + g.arm_drop
    beta = np.linspace(0.0, np.pi, _POINTS)
    x = arm_x - g.arm_length * np.cos(beta)
    arc = g.arm_length * np.sin(beta)
    strut_base = g.carriage_height + g.strut_drop
    turn = np.linspace(-np.pi, np.pi, 2 * _POINTS)
    with np.errstate(all="ignore"):
        case2 = strut_base - (x + arm_x) * np.tan(beta)
    upright = np.linspace(base - g.leg_length, base + g.leg_length, _POINTS)
    candidates: dict[str, list[FloatArray]] = {
        "legs flat": [np.stack([x, base + arc], -1)],
        "legs vertical": [
            np.stack([x, base + arc + side * g.leg_length], -1) for side in (-1.0, 1.0)
        ],
        "strut": [
            np.stack(
                [g.strut_length * np.sin(turn) - arm_x, strut_base + g.strut_length * np.cos(turn)],
                -1,
            )
        ],
        "arm in line with strut": [np.stack([x, case2], -1)],
        "arm flat": [
            np.stack([np.full(_POINTS, arm_x + side * g.arm_length), upright], -1)
            for side in (-1.0, 1.0)
        ],
    }
    return {
        family: [run for line in lines for run in _runs(line, _touches_reach(g, line))]
        for family, lines in candidates.items()
    }


def _touches_reach(geometry: Geometry, line: FloatArray) -> BoolArray:
    """Whether each point of a polyline lies in the closure of reach, or within ``_INSET`` of it."""
    finite = np.isfinite(line.sum(axis=1))
    points = np.where(finite[:, None], line, 0.0)
    turn = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], -1) * _INSET
    around = points[:, None, :] + ring
    poses = np.stack([around[..., 0], np.zeros(around.shape[:2]), around[..., 1]], -1)
    near: BoolArray = (np.count_nonzero(reachable(geometry, poses), axis=1) > 0) & finite
    return near


def _runs(line: FloatArray, keep: BoolArray) -> list[FloatArray]:
    """Return the stretches of a polyline that are kept, of at least two points each."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], keep, [False]]).astype(int)))
    return [line[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 1]


class Surfaces:
    """The surfaces in a viser scene, each with its switch.

    Args:
        server: The viser server.
        machine: The machine that is shown.
    """

    def __init__(self, server: Any, machine: Machine) -> None:
        half = machine.geometry.rail_half_length
        curves = singular_curves(machine.geometry)
        with server.gui.add_folder("Singular surfaces", expand_by_default=False):
            for family, colour in SURFACES.items():
                handles = [
                    _wall(server.scene, f"/surfaces/{family}/{i}", line, half, colour)
                    for i, line in enumerate(curves[family])
                ]
                if handles:
                    _switch(server.gui, family, handles)


def _switch(gui: Any, family: str, handles: list[Any]) -> None:
    box = gui.add_checkbox(family.capitalize(), initial_value=False)

    def turn(_: Any) -> None:
        for handle in handles:
            handle.visible = box.value

    box.on_update(turn)


def _wall(scene: Any, name: str, line: FloatArray, half: float, colour: Colour) -> Any:
    """Draw a curve of the xz plane as a translucent wall along y."""
    vertices = np.array([(x, side * half, z) for x, z in line for side in (-1.0, 1.0)]) * METRES
    faces = [
        face
        for a, b in pairwise(range(len(line)))
        for face in ((2 * a, 2 * a + 1, 2 * b), (2 * b, 2 * a + 1, 2 * b + 1))
    ]
    return scene.add_mesh_simple(
        name,
        vertices=vertices,
        faces=np.array(faces),
        color=colour,
        opacity=0.3,
        side="double",
        visible=False,
        cast_shadow=False,
        receive_shadow=False,
    )
