from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics.skeleton import joints
from duoglide.viewer.mechanism import METRES, Mechanism, bars


class Scene:
    """A viser scene that remembers what was put into it."""

    def __init__(self) -> None:
        self.nodes: dict[str, Any] = {}

    def __getattr__(self, kind: str) -> Any:
        def add(name: str, **values: Any) -> Any:
            node = SimpleNamespace(kind=kind, remove=lambda: self.nodes.pop(name, None), **values)
            self.nodes[name] = node
            return node

        return add


def rotated_z(wxyz: tuple[float, float, float, float]) -> np.ndarray:
    w, x, y, z = wxyz
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


@pytest.mark.parametrize("position", [(-41.0, 10.0, 302.0), (100.0, -50.0, 280.0)])
def test_every_bar_reaches_from_joint_to_joint(position: tuple[float, ...]) -> None:
    geometry = dg.Geometry(riser_height=20.0, arm_drop=5.0, strut_drop=8.0, strut_length=320.0)
    scene = Scene()
    mechanism = Mechanism(scene, geometry)
    mechanism.show(np.array([-41.0, 0.0, 310.0]))  # the lengths are kept from the first pose
    mechanism.show(np.array(position))
    at = joints(geometry, position)
    for bar in bars():
        node = scene.nodes[f"/robot/{bar.name}"]
        half = rotated_z(node.wxyz) * node.height / 2.0
        ends = [np.array(node.position) - half, np.array(node.position) + half]
        offset = np.array([bar.offset, 0.0, 0.0])
        np.testing.assert_allclose(ends[0] / METRES, at[bar.start] + offset, atol=1e-9)
        np.testing.assert_allclose(ends[1] / METRES, at[bar.end] + offset, atol=1e-9)


def test_an_unreachable_pose_leaves_the_picture_as_it_was(geometry: dg.Geometry) -> None:
    scene = Scene()
    mechanism = Mechanism(scene, geometry)
    mechanism.show(np.array([-41.0, 0.0, 302.0]))
    before = scene.nodes["/robot/leg 1"].position
    with pytest.raises(dg.UnreachableError):
        mechanism.show(np.array([0.0, 0.0, 500.0]))
    assert scene.nodes["/robot/leg 1"].position == before


def test_ghosts_are_the_other_solutions_that_could_be_built(geometry: dg.Geometry) -> None:
    scene = Scene()
    mechanism = Mechanism(scene, geometry)
    position = np.array([-80.3862, 66.73, 307.2328])
    assert mechanism.show_ghosts(position) == 5  # six of Table 3's eight are real, one is shown
    assert "/ghosts" in scene.nodes
    mechanism.hide_ghosts()
    assert "/ghosts" not in scene.nodes
