from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.viewer.mechanism import METRES
from duoglide.viewer.surfaces import Surfaces

FAMILIES = {
    "legs flat": "legs_flat",
    "legs vertical": "legs_vertical",
    "strut": "strut",
    "arm in line with strut (case 2)": "arm_strut",
    "arm flat": "arm_flat",
}


class Box(SimpleNamespace):
    """A checkbox that can be ticked."""

    def on_update(self, call: Any) -> None:
        self.call = call


class Server:
    """A viser server that remembers meshes and checkboxes."""

    def __init__(self) -> None:
        self.meshes: dict[str, Any] = {}
        self.boxes: dict[str, Box] = {}
        self.scene = self.gui = self

    def add_mesh_simple(self, name: str, **values: Any) -> Any:
        self.meshes[name.rsplit("/", maxsplit=1)[-1]] = SimpleNamespace(**values)
        return self.meshes[name.rsplit("/", maxsplit=1)[-1]]

    def add_checkbox(self, label: str, initial_value: bool) -> Box:
        self.boxes[label] = Box(value=initial_value)
        return self.boxes[label]

    def add_folder(self, label: str, expand_by_default: bool) -> Server:
        return self

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...


@pytest.mark.parametrize(
    "geometry", [dg.Geometry(), dg.Geometry(riser_height=15.0, arm_drop=-6.0, strut_drop=11.0)]
)
def test_every_point_drawn_is_singular_in_its_family(geometry: dg.Geometry) -> None:
    server = Server()
    Surfaces(server, dg.Machine(geometry=geometry))
    assert set(server.meshes) == {*FAMILIES, "workspace"}
    for family, field in FAMILIES.items():
        points = server.meshes[family].vertices / METRES
        inside = points[dg.reachable(geometry, points)]
        if len(inside):
            margin = getattr(dg.margins(geometry, inside), field)
            # chords of a curve, steep where the arm is flat: on it to the width of a drawn line
            assert np.abs(margin).max() < 2.0, family


def test_the_workspace_drawn_holds_the_carriages_on_their_rails(geometry: dg.Geometry) -> None:
    server = Server()
    Surfaces(server, dg.Machine(geometry=geometry))
    points = server.meshes["workspace"].vertices / METRES
    inside = points[dg.reachable(geometry, points)]
    assert len(inside) > 1000
    assert np.abs(dg.inverse(geometry, inside)).max() < geometry.rail_half_length + 1e-6


def test_a_switch_shows_its_body(geometry: dg.Geometry) -> None:
    server = Server()
    Surfaces(server, dg.Machine(geometry=geometry))
    box, mesh = server.boxes["Workspace"], server.meshes["workspace"]
    assert not mesh.visible
    box.value = True
    box.call(None)
    assert mesh.visible
