"""Lines along y: whether a point of the xz plane is admissible, and from where to where in y."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import BoolArray, FloatArray, as_triples
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.nearest import nearest_surface
from duoglide.kinematics.workspace.constraints import Constraints, Range
from duoglide.kinematics.workspace.interference import interference_gap
from duoglide.machine import Geometry


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """What is admissible on lines along y through points of the xz plane.

    Attributes:
        low: Least admissible y [mm], +inf where nothing is admissible.
        high: Greatest admissible y [mm], -inf where nothing is.
    """

    low: FloatArray
    high: FloatArray

    @property
    def mask(self) -> BoolArray:
        """Where some y is admissible."""
        found: BoolArray = self.low <= self.high
        return found

    @property
    def length(self) -> FloatArray:
        """Length of the interval [mm], 0 where nothing is admissible, inf on unlimited rails."""
        found = np.zeros(self.low.shape)
        np.subtract(self.high, self.low, out=found, where=self.mask)
        return found


def columns(
    geometry: Geometry,
    x: FloatArray,
    z: FloatArray,
    constraints: Constraints,
    mode: WorkingMode = WORKING,
) -> Columns:
    """Evaluate lines along y.

    Args:
        geometry: Dimensions of the robot.
        x: Coordinate of the lines [mm], an array of any shape (n, ...).
        z: The same shape.
        constraints: What limits the workspace.
        mode: Which of the inverse solutions; of it, the side m = +1 (legs above flat) counts.
    """
    g, c = geometry, constraints
    centre = g.rail_half_spacing - g.platform_half_width
    u, X = x - centre, x + centre
    Z = z - g.carriage_height - g.strut_drop
    with np.errstate(invalid="ignore"):  # beyond reach roots are NaN, and compare as false
        A = mode.v * np.sqrt(g.arm_length**2 - u * u)
        h = z - (g.carriage_height + g.riser_height + g.arm_drop) - A
        p = np.sqrt(g.leg_length**2 - h * h)
        q = np.sqrt(g.strut_length**2 - (X * X + Z * Z))
        inside = (h >= 0.0) & (p >= 0.0) & (q >= 0.0)
        if not c.beyond_case_2:
            inside &= X * A - Z * u >= 0.0
        inside &= _within(np.arcsin(h / g.leg_length), c.leg_angle)
        inside &= _within(np.arctan2(A, -u), c.arm_angle)
        inside &= _within(np.arctan2(X, Z), c.strut_swing)
        inside &= _within(mode.w3 * np.arcsin(q / g.strut_length), c.strut_tilt)
        inside &= g.coupler_length + (mode.w2 - mode.w1) * p >= c.carriage_width
    if inside.any():
        poses = np.stack([x[inside], np.zeros(int(inside.sum())), z[inside]], axis=-1)
        inside[inside] = _is_clear(g, poses, c, mode)
    half = g.coupler_length / 2.0
    offsets = np.stack([mode.w1 * p - half, mode.w2 * p + half, mode.w3 * q])
    low = np.where(inside, -c.travel - offsets.min(axis=0), inf)
    high = np.where(inside, c.travel - offsets.max(axis=0), -inf)
    return Columns(low, high)


def _within(angle: FloatArray, limits: Range) -> BoolArray | bool:
    """Whether an angle lies in its range; nothing is computed twice for an open one."""
    if limits == Range():
        return True
    return (angle >= limits.low) & (angle <= limits.high)


def _is_clear(g: Geometry, poses: FloatArray, c: Constraints, mode: WorkingMode) -> BoolArray:
    """Whether poses keep away from singularities, and links from each other."""
    clear = np.ones(len(poses), dtype=np.bool_)
    if c.clearance > 0.0:
        near = nearest_surface(g, mode.v, poses, within=c.clearance)
        clear &= (near.distance >= c.clearance) & (mode.w1 != mode.w2)  # else singular everywhere
    if c.link_radius > 0.0:
        clear[clear] = interference_gap(g, poses[clear], mode) >= 2.0 * c.link_radius
    return clear


def admissible(
    geometry: Geometry,
    position: ArrayLike,
    constraints: Constraints,
    mode: WorkingMode = WORKING,
) -> BoolArray:
    """Tell which positions satisfy every constraint.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (..., 3).
        constraints: What limits the workspace.
        mode: Which of the inverse solutions.

    Returns:
        Boolean mask of shape (...).

    Raises:
        InputError: Not finite numbers of shape (..., 3).
    """
    pose = as_triples(position, "position")
    x, y, z = pose.reshape(-1, 3).T
    lines = columns(geometry, x, z, constraints, mode)
    found: BoolArray = (lines.low <= y) & (y <= lines.high)
    return found.reshape(pose.shape[:-1])
