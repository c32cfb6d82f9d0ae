"""The mechanism in the live 3D page: rails, carriages, links and platform, from any Geometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.skeleton import joints
from duoglide.kinematics.solutions import inverse_all

if TYPE_CHECKING:
    from duoglide.machine import Geometry

METRES = 1e-3  # the page is in metres, so that the browser's camera has sensible defaults
Colour = tuple[int, int, int]

RAIL: Colour = (150, 155, 160)
CARRIAGES: tuple[Colour, Colour, Colour] = ((0, 114, 178), (213, 94, 0), (0, 158, 115))
LINK_COLOURS: dict[str, Colour] = {
    "leg 1": CARRIAGES[0],
    "leg 2": CARRIAGES[1],
    "coupler": (90, 95, 105),
    "arm": (204, 121, 167),
    "strut": CARRIAGES[2],
    "platform": (60, 60, 70),
}
GHOST: Colour = (120, 140, 170)
_RADIUS = 6.0  # [mm]
_CARRIAGE = (44.0, 52.0, 20.0)  # [mm]
_THINNEST = 8.0  # [mm] along the rails that a carriage is drawn, however near it may come
_PARALLELOGRAM = 14.0  # half the distance between the two long sides [mm]


@dataclass(frozen=True, slots=True)
class Bar:
    """One straight bar of the picture.

    Attributes:
        name: Unique name, for the scene's tree.
        start: Letter of the joint at one end.
        end: Letter of the joint at the other end.
        offset: Along x, of one side of a parallelogram [mm].
        colour: Red, green, blue, 0 to 255.
    """

    name: str
    start: str
    end: str
    offset: float
    colour: Colour


def bars() -> tuple[Bar, ...]:
    """Return the bars of the mechanism; parallelograms have two, apart along x."""
    single = (
        ("post 1", "A1", "B1", CARRIAGES[0]),
        ("post 2", "A2", "B2", CARRIAGES[1]),
        ("post 3", "A3", "B3", CARRIAGES[2]),
        ("leg 1", "B1", "C1", LINK_COLOURS["leg 1"]),
        ("leg 2", "B2", "C2", LINK_COLOURS["leg 2"]),
        ("coupler", "C1", "C2", LINK_COLOURS["coupler"]),
        ("riser", "D1", "D2", LINK_COLOURS["coupler"]),
        ("arm drop", "E2", "S", LINK_COLOURS["platform"]),
        ("strut drop", "T", "C3", LINK_COLOURS["platform"]),
    )
    double = (
        ("arm", "D2", "E2", LINK_COLOURS["arm"]),
        ("strut", "B3", "C3", LINK_COLOURS["strut"]),
    )
    sides = ((-_PARALLELOGRAM, "a"), (_PARALLELOGRAM, "b"))
    return tuple(Bar(name, start, end, 0.0, colour) for name, start, end, colour in single) + tuple(
        Bar(f"{name} {side}", start, end, offset, colour)
        for name, start, end, colour in double
        for offset, side in sides
    )


class Mechanism:
    """The mechanism in a viser scene; ``show`` moves it.

    Args:
        scene: The viser scene, ``server.scene``.
        geometry: Dimensions of the robot.
        carriage_width: How near carriages 1 and 2 may come: then their pictures touch [mm].
    """

    def __init__(
        self, scene: Any, geometry: Geometry, carriage_width: float = _CARRIAGE[1]
    ) -> None:
        self._scene = scene
        self._geometry = geometry
        self._carriage = (_CARRIAGE[0], max(carriage_width, _THINNEST), _CARRIAGE[2])
        self._bars = bars()
        self._handles: dict[str, Any] = {}
        self._draw_rails()
        self._draw_carriages()
        g = geometry
        self._platform = scene.add_box(
            "/robot/platform",
            dimensions=_metres((abs(2.0 * g.platform_half_width) + 24.0, 60.0, 10.0)),
            color=LINK_COLOURS["platform"],
        )
        self._tool = scene.add_icosphere("/robot/centre", radius=7.0 * METRES, color=(240, 228, 66))

    def _draw_rails(self) -> None:
        g = self._geometry
        size = (26.0, 2.0 * g.rail_half_length + 60.0, 12.0)
        for name, x in (("I", g.rail_half_spacing), ("II", -g.rail_half_spacing)):
            self._scene.add_box(
                f"/robot/rail {name}",
                dimensions=_metres(size),
                position=_metres((x, 0.0, -16.0)),
                color=RAIL,
            )

    def _draw_carriages(self) -> None:
        for number, colour in enumerate(CARRIAGES, start=1):
            name = f"/robot/carriage {number}"
            self._handles[f"carriage {number}"] = self._scene.add_box(
                name, dimensions=_metres(self._carriage), color=colour
            )
            place = _metres((self._carriage[0] / 2.0 + 12.0, 0.0, 12.0))
            self._scene.add_label(
                f"{name}/number", text=str(number), position=place, anchor="center-center"
            )

    def show(self, position: FloatArray, mode: WorkingMode = WORKING) -> None:
        """Put the mechanism where the platform is at ``position`` [mm], shape (3,).

        Raises:
            UnreachableError: A link is too short; the picture stays as it was.
        """
        at = joints(self._geometry, position, mode)
        for number in (1, 2, 3):
            self._handles[f"carriage {number}"].position = _metres(at[f"A{number}"])
        self._platform.position = _metres(at["O"])
        self._tool.position = _metres(at["O"] + (0.0, 0.0, 10.0))
        for bar in self._bars:
            offset = np.array([bar.offset, 0.0, 0.0])
            self._place(bar, at[bar.start] + offset, at[bar.end] + offset)

    def _place(self, bar: Bar, start: FloatArray, end: FloatArray) -> None:
        way = end - start
        length = float(np.linalg.norm(way))
        if length < 1e-6:
            return
        handle = self._handles.get(bar.name)
        if handle is None:  # links are rigid: their length is known at the first pose
            handle = self._handles[bar.name] = self._scene.add_cylinder(
                f"/robot/{bar.name}",
                radius=_RADIUS * METRES,
                height=length * METRES,
                color=bar.colour,
                radial_segments=16,
            )
        handle.position = _metres((start + end) / 2.0)
        handle.wxyz = _turn_from_z(way / length)

    def show_ghosts(self, position: FloatArray, mode: WorkingMode = WORKING) -> int:
        """Draw the other inverse solutions at ``position`` as thin lines; return how many.

        Only those that could be built: carriages in order, links not crossing.
        """
        others = [
            s for s in inverse_all(self._geometry, position) if s.realisable and s.mode != mode
        ]
        segments = [
            (at[bar.start], at[bar.end])
            for solution in others
            for at in [joints(self._geometry, position, solution.mode)]
            for bar in self._bars
            if not bar.name.startswith("post")
        ]
        self.hide_ghosts()
        if segments:
            self._handles["ghosts"] = self._scene.add_line_segments(
                "/ghosts",
                points=np.array(segments) * METRES,
                colors=GHOST,
                thickness=1.5,
                thickness_units="screen",
            )
        return len(others)

    def hide_ghosts(self) -> None:
        """Take the other inverse solutions away."""
        handle = self._handles.pop("ghosts", None)
        if handle is not None:
            handle.remove()


def _metres(value: FloatArray | tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (float(v) * METRES for v in value)
    return x, y, z


def _turn_from_z(direction: FloatArray) -> tuple[float, float, float, float]:
    """Return the quaternion (w, x, y, z) that turns +z into a unit ``direction``."""
    x, y, z = (float(v) for v in direction)
    if z < -1.0 + 1e-12:
        return 0.0, 1.0, 0.0, 0.0
    w = np.sqrt((1.0 + z) / 2.0)
    return float(w), -y / (2.0 * w), x / (2.0 * w), 0.0
