"""What room is kept where the carriages are not known exactly: bounds, no samples.

The platform's place in the xz plane follows from B = yA2 - yA1 - l3 and D = yA3 - y alone. While
both stay within known intervals, so do the rise of the legs h and the strut's projection rho, and
with them the triangle of arm, strut and arm's foot: its angle at C3 says how fast the platform can
move at most. That is the Jacobian's bound; nothing about it is sampled, and where the triangle may
collapse it is infinite. Beyond the slope at the middle, a bound on the second derivative is enough:

    n P'' = n_z h'' - |a'|^2 / l6,   e P'' = rho'' - (|P'|^2 - rho'^2) / rho

(n and e: unit vectors of arm and strut, a: the arm; from a^2 = l6^2 and P^2 = rho^2).

The clearance is a distance to a set, so it falls by at most the way that the platform goes, and
where that way leads along the nearest surface by much less: it is bounded from an anchor further
away from the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics.constants import carriage_constants
from duoglide.kinematics.headroom.anchors import bound_from_anchors
from duoglide.kinematics.headroom.nearby_kernel import swing
from duoglide.kinematics.headroom.room import (
    PLENTY,
    Room,
    box_distance,
    carriage_room,
    locate,
    outside,
)
from duoglide.kinematics.modes import ASSEMBLY, WORKING
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.machine import Machine

Pair: TypeAlias = tuple[FloatArray, FloatArray]
Swing: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""Where ways lead the platform in x and z, (n, k, 2); how far off these it may be, and how far from
the middle at most, (n,) each; inf where a singularity may be crossed [mm]."""


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """Sets of carriages: a middle, straight ways to either side of it, and what bends off these.

    Attributes:
        middle: Carriages [mm], shape (n, 3).
        ways: How far each of k independent parameters takes the carriages to either side [mm],
            shape (n, k, 3).
        beyond: How far, besides, carriages 1 to 3, B and D may be off [mm], shape (n, 5).
    """

    middle: FloatArray
    ways: FloatArray
    beyond: FloatArray

    def reach(self) -> FloatArray:
        """Return how far carriages 1 to 3, B and D may be from the middle [mm], shape (n, 5)."""
        reach: FloatArray = np.abs(with_pairs(self.ways)).sum(axis=1) + self.beyond
        return reach


def with_pairs(carriages: FloatArray) -> FloatArray:
    """Append the changes of B and D to those of the carriages, (..., 3) to (..., 5)."""
    one, two, three = np.moveaxis(carriages, -1, 0)
    return np.stack([one, two, three, two - one, three - 0.5 * (one + two)], axis=-1)


def room_on(machine: Machine, patch: Patch, enough: float) -> tuple[Room, Room]:
    """Measure the room in the middle of patches, and bound it on the whole of them.

    Args:
        machine: The machine.
        patch: Where its carriages are.
        enough: Clearance beyond ``machine.clearance`` above which no bound need be sharp [mm].

    Returns:
        Room in the middle, and lower bounds of all of it, each of shape (n,); -inf where the links
        do not close, or may not.
    """
    position, closed = locate(machine, patch.middle)
    ways = swing_of(machine, patch, position)
    here, lowest = _rails(machine, patch)
    with np.errstate(invalid="ignore"):  # inf - inf, where nothing is known
        clear = _clearance(machine, (position, closed), ways, enough)
    boxes = _keep_out(machine, position, _around(patch, ways))
    free = _carriage_margin(machine, patch, (position, closed))
    return (
        Room(clear[0] - machine.clearance, *here, boxes[0], free[0]),
        Room(clear[1] - machine.clearance, *lowest, boxes[1], free[1]),
    )


def swing_of(machine: Machine, patch: Patch, position: FloatArray) -> Swing:
    """Carry patches of carriages to the platform, which is at ``position`` in the middle."""
    count, parameters = patch.ways.shape[:2]
    across = np.empty((count, parameters, 2))
    off, farthest = np.empty((2, count))
    constants = carriage_constants(machine.geometry, ASSEMBLY)
    patches = patch.middle, patch.ways, patch.beyond
    swing(patches, position, constants, (across, off, farthest))
    return across, off, farthest


def _around(patch: Patch, ways: Swing) -> FloatArray:
    """Return how far the platform may be from the middle along x, y and z, (n, 3)."""
    across, off, farthest = ways
    around = np.empty(patch.middle.shape)
    around[:, ::2] = np.minimum(np.abs(across).sum(axis=1) + off[:, None], farthest[:, None])
    around[:, 1] = 0.5 * np.abs(patch.ways[..., 0] + patch.ways[..., 1]).sum(axis=1)
    around[:, 1] += 0.5 * (patch.beyond[:, 0] + patch.beyond[:, 1])
    return around


def _rails(machine: Machine, patch: Patch) -> tuple[Pair, Pair]:
    """Return travel and order in the middle, and at the least."""
    carriages, reach = patch.middle, patch.reach()
    left = machine.geometry.rail_half_length - np.abs(carriages)
    order = carriages[:, 1] - carriages[:, 0] - machine.carriage_width
    lowest = (left - reach[:, :3]).min(axis=-1), order - reach[:, 3]
    return (left.min(axis=-1), order), lowest


def _carriage_margin(machine: Machine, patch: Patch, pose: tuple[FloatArray, BoolArray]) -> Pair:
    """Return what is left of the carriage margin in the middle, and at the least.

    It changes by at most half of what the distance of any two carriages does: of 1 and 2 by that
    of B, of either of them and 3 by that of D and half of B.
    """
    reach = patch.reach()
    loss = 0.5 * np.maximum(reach[:, 3], reach[:, 4] + 0.5 * reach[:, 3])
    bounded = loss < PLENTY
    here = carriage_room(machine, *pose, np.where(bounded, loss, 0.0))
    return here, np.where(bounded, here - loss, -np.inf)


def _clearance(
    machine: Machine,
    pose: tuple[FloatArray, BoolArray],
    ways: Swing,
    enough: float,
) -> Pair:
    """Return the clearance in the middle, and at the least."""
    (position, closed), (across, off, farthest) = pose, ways
    here, lowest = np.full((2, len(position)), -np.inf)
    rows = np.flatnonzero(closed)
    found = nearest_surface(machine.geometry, WORKING.v, position[rows])
    here[rows] = found.distance
    corners = _corners(across)
    spread = np.minimum(np.linalg.norm(corners, axis=-1).max(axis=1) + off, farthest)
    lowest[rows] = here[rows] - spread[rows]
    normal = found.away[:, ::2]
    slope = np.abs((across[rows] * normal[:, None]).sum(axis=-1)).sum(axis=-1)
    best, needed = found.distance - slope - off[rows], machine.clearance + enough
    spare = best - needed
    pick = (lowest[rows] < needed) & (spare > 0.0)
    if pick.any():
        some = rows[pick]
        bound = bound_from_anchors(
            machine, (position[some], normal[pick]), corners[some], spare[pick]
        )
        lowest[some] = np.maximum(lowest[some], bound - off[some])
    return here, lowest


def _corners(across: FloatArray) -> FloatArray:
    """Return the corners of what ways (n, k, 2) span, shape (n, 2^k, 2)."""
    corners = np.zeros((len(across), 1, 2))
    for i in range(across.shape[1]):
        way = across[:, i : i + 1]
        corners = np.concatenate([corners + way, corners - way], axis=1)
    return corners


def _keep_out(machine: Machine, position: FloatArray, around: FloatArray) -> Pair:
    """Return the distance to the nearest keep-out box in the middle, and at the least."""
    here, lowest = np.full((2, len(position)), np.inf)
    for box in machine.keep_out:
        far = outside(box, position)
        for found, way in ((here, 0.0), (lowest, around)):
            distance = np.nan_to_num(box_distance(far - way), nan=-np.inf)
            np.minimum(found, distance, out=found)
    return here, lowest
