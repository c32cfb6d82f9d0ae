"""The part of the page that moves the platform by hand and says what that means."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import DuoglideError
from duoglide.kinematics.carriage_margin import carriage_margin
from duoglide.kinematics.home import home_position
from duoglide.kinematics.model import inverse
from duoglide.kinematics.singularity.margins import clearance, margins
from duoglide.kinematics.transmission import transmission
from duoglide.viewer.mechanism import METRES, Mechanism

if TYPE_CHECKING:
    from duoglide.machine import Machine


class PosePanel:
    """Drag the platform, or type its position; the inverse kinematics answers at once.

    Args:
        server: The viser server.
        machine: The machine that is shown.
        mechanism: Its picture.
    """

    def __init__(self, server: Any, machine: Machine, mechanism: Mechanism) -> None:
        self._machine = machine
        self._mechanism = mechanism
        self.position = home_position(machine)
        x, y, z = self.position
        self._vector = server.gui.add_vector3(
            "Platform [mm]", initial_value=(float(x), float(y), float(z)), step=0.1
        )
        self._ghosts = server.gui.add_checkbox(
            "Other solutions", initial_value=False, hint="The other inverse solutions, as ghosts"
        )
        self._words = server.gui.add_markdown("")
        self._gizmo = server.scene.add_transform_controls(
            "/drag", scale=0.12, disable_rotations=True, position=tuple(self.position * METRES)
        )
        self._vector.on_update(self._typed)
        self._ghosts.on_update(lambda _: self.show(self.position))
        self._gizmo.on_update(self._dragged)
        self.show(self.position)

    def show(self, position: FloatArray) -> None:
        """Show the machine with its platform at ``position`` [mm], or say why it cannot be."""
        try:
            self._mechanism.show(position)
        except DuoglideError as error:
            self._words.content = f"**Out of reach.** {error}"
            return
        self.position = position
        if self._ghosts.value:
            self._mechanism.show_ghosts(position)
        else:
            self._mechanism.hide_ghosts()
        self._words.content = describe(self._machine, position)

    def follow(self, position: FloatArray) -> None:
        """Show a position that comes from a motion, and take the handle and the numbers along."""
        self.show(position)
        self._vector.value = _rounded(position)
        self._gizmo.position = tuple(position * METRES)

    def set_draggable(self, draggable: bool) -> None:
        """Show or hide the handle: nothing is dragged while a machine moves."""
        self._gizmo.visible = draggable

    def _typed(self, event: Any) -> None:
        if event.client is None:  # our own write, not a person's
            return
        position = np.array(self._vector.value, dtype=np.float64)
        self.show(position)
        self._gizmo.position = tuple(position * METRES)

    def _dragged(self, event: Any) -> None:
        position = np.array(self._gizmo.position, dtype=np.float64) / METRES
        self.show(position)
        self._vector.value = _rounded(position)
        if event.phase == "end" and not np.array_equal(position, self.position):
            self._gizmo.position = tuple(self.position * METRES)
            self._vector.value = _rounded(self.position)
            self.show(self.position)


def describe(machine: Machine, position: FloatArray) -> str:
    """Return the pose in words: what is left, margins, carriages, and what is refused.

    Args:
        machine: The machine.
        position: A reachable platform position [mm], shape (3,).

    Returns:
        Markdown.
    """
    geometry = machine.geometry
    carriages = inverse(geometry, position)
    room, loose = float(clearance(geometry, position)), float(carriage_margin(geometry, position))
    rows = "\n".join(
        f"| {family.replace('_', ' ')} | {float(value):.2f} |"
        for family, value in margins(geometry, position).by_family().items()
    )
    warnings = "".join(f"\n\n**{text}**" for text in _refusals(machine, carriages, room, loose))
    first, second, third = carriages
    return (
        f"Clearance **{room:.2f} mm**, carriage margin **{loose:.2f} mm**, 1/condition "
        f"**{1.0 / float(transmission(geometry, position).condition_number):.3f}**{warnings}\n\n"
        f"Carriages {first:.2f}, {second:.2f}, {third:.2f} mm\n\n"
        f"| margin | mm |\n|---|---|\n{rows}"
    )


def _refusals(machine: Machine, carriages: FloatArray, room: float, loose: float) -> list[str]:
    travel = machine.geometry.rail_half_length
    found = [
        f"Carriage {number} is {abs(value) - travel:.2f} mm past its travel of {travel:g} mm"
        for number, value in enumerate(carriages, start=1)
        if abs(value) >= travel
    ]
    gap = float(carriages[1] - carriages[0])
    if gap <= machine.carriage_width:
        found.append(f"Carriages 1 and 2 are {gap:.2f} mm apart, {machine.carriage_width:g} needed")
    if room <= machine.clearance:
        found.append(f"Clearance is below the machine's {machine.clearance:g} mm")
    if loose < machine.carriage_margin:
        found.append(f"Carriage margin is below the machine's {machine.carriage_margin:g} mm")
    return found


def _rounded(position: FloatArray) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 3) for v in position)
    return x, y, z
