"""How much room the machine has where it stands: asked by its carriages, or by its platform.

``room`` takes carriages, and finds the platform by forward kinematics: motions made in carriage
space ask so. ``room_at`` takes positions of the platform. Neither raises: where the links do not
close, or close in another assembly mode, there is no room.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics import kernels
from duoglide.kinematics.carriage_margin import margin_up_to
from duoglide.kinematics.constants import carriage_constants, pose_constants
from duoglide.kinematics.model import inverse, reachable
from duoglide.kinematics.modes import ASSEMBLY, WORKING
from duoglide.kinematics.reach import reach_of
from duoglide.kinematics.singularity.margins import clearance, margins
from duoglide.machine import Box, Machine

TOUCHING = 1e-7  # [mm]; a margin this near to what is required counts as touching, and is refused
PLENTY = 5.0  # [mm]; more than this beyond what is asked for is not told of a carriage margin
SURE = 0.9 * TOUCHING  # [mm]; a bound this far above what is required certifies what lies between


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """What is left beyond what the machine asks for, each in mm and of shape (...).

    Attributes:
        clearance: Distance to singular surfaces and edges of reach, less ``machine.clearance``;
            -inf where the links do not close.
        travel: Least distance of a carriage to the end of its rail.
        order: Distance of carriages 1 and 2, less ``machine.carriage_width``.
        keep_out: Distance to the nearest keep-out box; negative inside, +inf without boxes.
        carriage_margin: Carriage margin, less ``machine.carriage_margin``, at most ``PLENTY``; -inf
            where the links do not close, +inf where the machine asks for none.
    """

    clearance: FloatArray
    travel: FloatArray
    order: FloatArray
    keep_out: FloatArray
    carriage_margin: FloatArray

    def least(self) -> FloatArray:
        """Return the least of the five [mm], shape (...)."""
        least: FloatArray = np.min([getattr(self, f.name) for f in fields(self)], axis=0)
        return least

    def worst(self) -> tuple[int, str, float]:
        """Return index, name and value of the least entry of a flat room."""
        index = int(np.argmin(self.least()))
        values = {f.name: float(getattr(self, f.name)[index]) for f in fields(self)}
        name = min(values, key=lambda key: values[key])
        return index, name, values[name]


def carriage_room(
    machine: Machine, position: FloatArray, closed: BoolArray, loss: float | FloatArray = 0.0
) -> FloatArray:
    """Measure what is left of the carriage margin at positions (n, 3), as in ``Room``.

    Args:
        machine: The machine.
        position: Of the platform [mm].
        closed: Where the links close, shape (n,).
        loss: What is taken off again, so that so much more is worth knowing [mm], as ``closed``.
    """
    if machine.carriage_margin == 0.0:
        return np.where(closed, np.inf, -np.inf)
    left = np.full(closed.shape, -np.inf)
    here = position[closed]
    reach = reach_of(here, pose_constants(machine.geometry, WORKING))
    enough = np.broadcast_to(machine.carriage_margin + PLENTY + loss, closed.shape)[closed]
    found = margin_up_to(machine.geometry, here, reach, enough=enough)
    left[closed] = found - machine.carriage_margin
    return left


def locate(machine: Machine, carriages: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Find the platform [mm], (..., 3), and where the links close in the machine's own modes."""
    g = machine.geometry
    k = carriage_constants(g, ASSEMBLY)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        x, y, z, sure = kernels.in_numpy(kernels.forward_pose)(
            carriages[..., 0], carriages[..., 1], carriages[..., 2], k
        )
        B = carriages[..., 1] - carriages[..., 0] - g.coupler_length
        h = np.sqrt((g.leg_length - 0.5 * B) * (g.leg_length + 0.5 * B))
        lift = z - (g.carriage_height + g.riser_height + g.arm_drop) - h
        closed = sure & (B > 0.0) & (lift * WORKING.v > 0.0)
        closed &= carriages[..., 2] * WORKING.w3 > y * WORKING.w3
    return np.stack([x, y, z], axis=-1), closed


def room(machine: Machine, carriages: FloatArray) -> Room:
    """Measure the room at carriages of shape (..., 3)."""
    position, closed = locate(machine, carriages)
    return _measure(machine, position, carriages, closed)


def room_at(machine: Machine, position: FloatArray) -> Room:
    """Measure the room at finite positions of the platform [mm], shape (..., 3).

    Out of reach, where there are no carriages, travel and order are measured at 0 mm.
    """
    geometry = machine.geometry
    inside = np.array(reachable(geometry, position))
    carriages = np.zeros(position.shape)
    carriages[inside] = inverse(geometry, position[inside])
    sides = margins(geometry, position[inside])
    own = inside.copy()
    own[inside] = (sides.legs_flat > 0.0) & (sides.arm_strut > 0.0)  # its own assembly mode
    return _measure(machine, position, carriages, own)


def _measure(
    machine: Machine, position: FloatArray, carriages: FloatArray, closed: BoolArray
) -> Room:
    clear = np.full(closed.shape, -np.inf)
    if closed.any():
        clear[closed] = clearance(machine.geometry, position[closed]) - machine.clearance
    free = carriage_room(machine, position.reshape(-1, 3), closed.ravel()).reshape(closed.shape)
    keep_out = np.full(closed.shape, np.inf)
    for box in machine.keep_out:
        distance = box_distance(outside(box, position))
        keep_out = np.minimum(keep_out, np.nan_to_num(distance, nan=-np.inf))
    return Room(
        clearance=clear,
        travel=machine.geometry.rail_half_length - np.abs(carriages).max(axis=-1, initial=0.0),
        order=carriages[..., 1] - carriages[..., 0] - machine.carriage_width,
        keep_out=keep_out,
        carriage_margin=free,
    )


def outside(box: Box, position: FloatArray) -> FloatArray:
    """Return how far outside the sides of a box positions are along each axis, shape (..., 3)."""
    far: FloatArray = np.maximum(np.array(box.low) - position, position - np.array(box.high))
    return far


def box_distance(far: FloatArray) -> FloatArray:
    """Return the distance to a box, negative inside, from how far outside its sides a point is."""
    beyond = np.linalg.norm(np.maximum(far, 0.0), axis=-1)
    distance: FloatArray = beyond + np.minimum(far.max(axis=-1), 0.0)
    return distance
