"""What stands around the mechanism in the 3D page: light, floor, axes and their letters, camera."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.viewer.mechanism import METRES

if TYPE_CHECKING:
    from duoglide.machine import Geometry

_FLOOR = -0.025  # [m], below the rails
_RAISED = 0.55  # of half the page's height, by which the machine is above its middle on a phone
_AXES: dict[str, tuple[int, int, int]] = {  # dark enough on white, light enough on black
    "x": (201, 42, 42), "y": (43, 138, 62), "z": (34, 114, 195),
}  # fmt: skip


def set_stage(server: Any, geometry: Geometry) -> None:
    """Put everything but the mechanism into a scene; the camera looks along the rails' side.

    Args:
        server: The viser server.
        geometry: Of the machine.
    """
    scene, half = server.scene, geometry.rail_half_length * METRES
    scene.set_up_direction("+z")
    _light(scene)
    scene.add_grid(
        "/floor",
        width=3.0 * half,
        height=3.0 * half,
        cell_size=0.05,
        section_size=0.25,
        position=(0.0, 0.0, _FLOOR),
        cell_color=(150, 155, 160),
        section_color=(110, 115, 120),
    )
    _add_axes(scene, geometry)
    camera = server.initial_camera
    camera.position = _eye(half, 1.0)
    camera.look_at = _middle(half)
    server.on_client_connect(lambda client: step_back(client, half))


def _eye(half: float, distance: float) -> tuple[float, float, float]:
    """Return where the camera stands [m]: +x comes towards it, +y goes to the right."""
    return 1.65 * half * distance, -0.95 * half * distance, 1.15 * half * distance


def _middle(half: float) -> tuple[float, float, float]:
    """Return what the camera looks at [m]."""
    return 0.0, 0.0, 0.3 * half


def step_back(client: Any, half: float) -> None:
    """Let a page that is higher than wide see the whole machine too: above the sheet of a phone."""
    camera = client.camera
    if camera.aspect < 1.0:
        eye, middle = np.array(_eye(half, 1.0 / camera.aspect)), np.array(_middle(half))
        sight = float(np.linalg.norm(eye - middle))
        camera.position = eye
        camera.look_at = middle - (0.0, 0.0, _RAISED * sight * np.tan(0.5 * camera.fov))


def _add_axes(scene: Any, geometry: Geometry) -> None:
    """Draw the directions of x, y and z beside the rails, not at the origin, where links move."""
    length = 0.1
    corner = np.array([-geometry.rail_half_spacing - 110.0, -geometry.rail_half_length, 0.0])
    start = corner * METRES + (0.0, 0.0, _FLOOR)
    tips = start + length * np.eye(3)
    colours = np.array(list(_AXES.values()), dtype=np.uint8)
    scene.add_arrows(
        "/axes",
        points=np.stack([np.broadcast_to(start, (3, 3)), tips], axis=1),
        colors=colours,
        shaft_radius=0.004,
        head_radius=0.009,
        head_length=0.02,
    )
    for letter, tip, way in zip(_AXES, tips, np.eye(3), strict=True):
        place = tuple(tip + 0.02 * way)
        scene.add_label(f"/axes/{letter}", letter, position=place, anchor="center-center")


def _light(scene: Any) -> None:
    """Light the scene by lamps alone.

    An environment map and shadows cost a computer without a graphics processor half a minute when
    the page opens, and most of its frames afterwards.
    """
    scene.configure_environment_map(hdri=None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/light/sky", intensity=2.2, ground_color=(150, 150, 155))
    for name, place, intensity in (
        ("key", (1.0, -1.5, 3.0), 1.6),
        ("fill", (-2.0, 1.0, 1.0), 0.7),
    ):
        scene.add_light_directional(f"/light/{name}", intensity=intensity, position=place)
