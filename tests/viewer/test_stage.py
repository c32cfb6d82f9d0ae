"""Where the camera of the page stands."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics.home import home_carriages
from duoglide.viewer.stage import step_back

MACHINE = dg.Machine.default()
HALF = MACHINE.geometry.rail_half_length * 1e-3  # [m]


def on_the_page(camera: SimpleNamespace, point: np.ndarray) -> np.ndarray:
    """Return where a point is seen, from -1 to 1 across the page and from its bottom to its top."""
    ahead = np.asarray(camera.look_at) - camera.position
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    way = point - camera.position
    x, y = way @ right, way @ np.cross(right, ahead)
    half = (way @ ahead) * np.tan(0.5 * camera.fov)
    return np.array([x / (half * camera.aspect), y / half])


@pytest.mark.parametrize("size", [(390, 844), (360, 640), (768, 1024)])
def test_a_phone_shows_the_machine_between_its_banner_and_its_sheet(size: tuple[int, int]) -> None:
    camera = SimpleNamespace(aspect=size[0] / size[1], fov=np.radians(75.0))
    step_back(SimpleNamespace(camera=camera), HALF)
    places = [(-41.0, 0.0, 302.0)]
    for carriage, side in zip(home_carriages(MACHINE), (1.0, 1.0, -1.0), strict=True):
        places.append((side * MACHINE.geometry.rail_half_spacing, carriage, 0.0))
    for place in places:
        x, y = on_the_page(camera, 1e-3 * np.array(place))
        assert abs(x) < 0.9
        assert 0.0 < y < 0.85, place
