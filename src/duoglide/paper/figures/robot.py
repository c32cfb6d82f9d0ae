"""The robot at a pose, as a scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray
from duoglide.drawing.picture import COLOURS, LOST
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.skeleton import joints
from duoglide.machine import Geometry
from duoglide.paper.figures.scene import Dot, Label, Line, Scene, Tube

COUPLER, ARM = "#7d8891", "#cc79a7"
PLATFORM, RAIL = "#4d4d4d", "#c9ced2"
FREE = LOST  # arrows of a free motion
KEY = (
    *((f"carriage {i}", colour) for i, colour in enumerate(COLOURS, start=1)),
    ("coupler", COUPLER),
    ("arm (parallelogram 1)", ARM),
    ("platform", PLATFORM),
)
"""What is which colour: a carriage has that of its post and of its leg, carriage 3 of the strut."""
_BAR = 3.2  # points
_HALF = 14.0  # [mm], half of a parallelogram's short side
_X, _Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def robot(
    geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING, *, labels: bool = True
) -> Scene:
    """Draw rails, carriages and links at a pose.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (3,).
        mode: Which of the inverse solutions.
        labels: Whether to name the joints.

    Raises:
        UnreachableError: A link is too short.
    """
    at = joints(geometry, position, mode)
    scene = Scene()
    _rails(scene, geometry, at)
    _chain_a(scene, at)
    _chain_b(scene, at)
    scene.add(*(Dot(at[name], "#ffffff", 4.0) for name in ("B1", "B2", "C1", "C2")))
    scene.add(Dot(at["O"], FREE, 4.0))
    if labels:
        _label(scene, at)
    return scene


def _rails(scene: Scene, g: Geometry, at: dict[str, FloatArray]) -> None:
    """Two rails, and a carriage with its post for each drive."""
    far = max(g.rail_half_length, *(abs(float(at[f"A{i}"][1])) + 30.0 for i in (1, 2, 3)))
    for side in (-1.0, 1.0):
        ends = np.array([[side * g.rail_half_spacing, y, 0.0] for y in (-far, far)])
        scene.add(Tube(ends[0], ends[1], RAIL, 4.5))
    for i in (1, 2, 3):
        foot, top = at[f"A{i}"], at[f"B{i}"]
        scene.add(Tube(foot - 18.0 * _Y, foot + 18.0 * _Y, COLOURS[i - 1], 8.0))
        scene.add(Tube(foot, top, COLOURS[i - 1], 4.0))


def _chain_a(scene: Scene, at: dict[str, FloatArray]) -> None:
    """Legs, coupler, riser, parallelogram 1 and platform."""
    for i in (1, 2):
        scene.add(Tube(at[f"B{i}"], at[f"C{i}"], COLOURS[i - 1], _BAR))
    scene.add(Tube(at["C1"], at["C2"], COUPLER, _BAR))
    _bar(scene, at["D1"], at["D2"], COUPLER)
    for end in ("D2", "E2"):
        scene.add(Tube(at[end] - _HALF * _X, at[end] + _HALF * _X, ARM, 2.2))
    for side in (-_HALF, _HALF):
        scene.add(Tube(at["D2"] + side * _X, at["E2"] + side * _X, ARM, _BAR))
        scene.add(*(Dot(at[end] + side * _X, "#ffffff", 3.0) for end in ("D2", "E2")))
    _bar(scene, at["E2"], at["S"], PLATFORM)
    scene.add(Tube(at["S"], at["T"], PLATFORM, 5.5))


def _chain_b(scene: Scene, at: dict[str, FloatArray]) -> None:
    """Parallelogram 2 between its two revolutes, and what hangs it under the platform."""
    _bar(scene, at["T"], at["C3"], PLATFORM)
    for end in ("B3", "C3"):
        scene.add(Tube(at[end] - _HALF * _Y, at[end] + _HALF * _Y, COLOURS[2], 2.2))
    for side in (-_HALF, _HALF):
        scene.add(Tube(at["B3"] + side * _Y, at["C3"] + side * _Y, COLOURS[2], _BAR))
        scene.add(*(Dot(at[end] + side * _Y, "#ffffff", 3.0) for end in ("B3", "C3")))


def _bar(scene: Scene, start: FloatArray, end: FloatArray, colour: str) -> None:
    """Draw a bar that the prototype leaves out by setting its length to zero."""
    if np.linalg.norm(end - start) > 0.0:
        scene.add(Tube(start, end, colour, _BAR))


def _label(scene: Scene, at: dict[str, FloatArray]) -> None:
    """Name the joints that a reader looks for."""
    offsets = {
        "A1": (0, -11), "A2": (0, -11), "A3": (0, -11), "B1": (10, 4), "B2": (-10, 3),
        "B3": (11, -2), "C1": (11, 6), "C2": (-9, 6), "C3": (-12, -3),
    }  # fmt: skip
    for name, offset in offsets.items():
        text = f"${name[0]}_{name[1]}$"
        scene.add(Label(at[name], text, offset))
    scene.add(Label(at["O"], r"$O^{\prime}$", (2, 10), FREE))


def arrow(start: FloatArray, direction: FloatArray, length: float = 70.0) -> Line:
    """Return an arrow that shows a free motion."""
    unit = direction / np.linalg.norm(direction)
    points = np.stack([start, start + length * unit])
    return Line(points, FREE, 1.4, arrow=True, on_top=True)


def axes_cross(origin: FloatArray, length: float, names: tuple[str, str, str]) -> Scene:
    """Return three short arrows with names."""
    scene = Scene()
    for direction, name in zip(np.eye(3), names, strict=True):
        tip = origin + length * direction
        scene.add(Line(np.stack([origin, tip]), "#444444", 0.9, arrow=True, on_top=True))
        scene.add(Label(origin + 1.22 * length * direction, name, (0, 0), "#444444"))
    return scene
