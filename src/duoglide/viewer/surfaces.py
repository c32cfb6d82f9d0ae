"""Singular surfaces and the workspace between them, as translucent bodies in the 3D page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.paper.figures.surfaces import (
    COLOURS,
    extruded,
    within_reach,
    workspace_curves,
    workspace_panels,
)
from duoglide.viewer.mechanism import METRES

if TYPE_CHECKING:
    from duoglide.machine import Machine

_POINTS = 91  # of a curve, within 0.1 mm of the fine one; browsers draw in software, too


class Surfaces:
    """The workspace and the surfaces in a viser scene, each with its switch.

    Args:
        server: The viser server.
        machine: The machine that is shown.
    """

    def __init__(self, server: Any, machine: Machine) -> None:
        self._scene, self._gui = server.scene, server.gui
        geometry = machine.geometry
        along = (-geometry.rail_half_length, geometry.rail_half_length)
        bodies: dict[str, list[FloatArray]] = {}
        for curve in workspace_curves(geometry, v=1):
            lines = [_thinned(line) for line in within_reach(geometry, curve)]
            parts = [extruded(line, along, 1) for line in lines]
            bodies.setdefault(curve.family, []).extend(parts)
        with self._gui.add_folder("Workspace and singular surfaces", expand_by_default=False):
            panels = workspace_panels(geometry)
            self._add("workspace", panels.corners, panels.colour)
            for family, parts in bodies.items():
                if parts:
                    self._add(family, np.concatenate(parts), COLOURS[family])

    def _add(self, name: str, corners: FloatArray, colour: str) -> None:
        """Add panels of shape (n, 4, 3) [mm] and a switch for them, off at first."""
        first = 4 * np.arange(len(corners))[:, None]
        faces = np.concatenate([first + np.array(corner) for corner in ([0, 1, 2], [0, 2, 3])])
        body = self._scene.add_mesh_simple(
            f"/surfaces/{name}",
            vertices=corners.reshape(-1, 3) * METRES,
            faces=faces,
            color=tuple(bytes.fromhex(colour.removeprefix("#"))),
            opacity=0.3,
            side="double",
            visible=False,
            cast_shadow=False,
            receive_shadow=False,
        )
        box = self._gui.add_checkbox(name.capitalize(), initial_value=False)

        def turn(_: Any) -> None:
            body.visible = box.value

        box.on_update(turn)


def _thinned(line: FloatArray) -> FloatArray:
    """Return a polyline through some of its points, both ends among them."""
    kept = np.linspace(0, len(line) - 1, min(len(line), _POINTS)).astype(int)
    thinned: FloatArray = line[kept]
    return thinned
