"""Lines along y: whether a point of the xz plane is admissible, and from where to where in y."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import BoolArray, FloatArray, as_triples
from duoglide.kinematics.constants import pose_constants
from duoglide.kinematics.kernels import in_numpy, inverse_pose, margins_pose
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.kinematics.workspace.constraints import Constraints, Range
from duoglide.kinematics.workspace.interference import interference_gap
from duoglide.machine import Geometry

_inverse_columns, _margins_columns = in_numpy(inverse_pose), in_numpy(margins_pose)


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """What is admissible on lines along y through points of the xz k.

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
    k = pose_constants(g, mode)
    with np.errstate(invalid="ignore"):  # beyond reach roots are NaN, and compare as false
        a1, a2, a3 = carriages = _inverse_columns(x, 0.0, z, k)
        strut, h, in_line, _ = _margins_columns(x, z, k)
        inside = (h >= 0.0) & (h <= g.leg_length) & (strut >= 0.0)
        if not c.beyond_case_2:
            inside &= in_line >= 0.0
        inside &= a2 - a1 >= c.carriage_width
        for limits, angle in (
            (c.leg_angle, lambda: np.arcsin(h / g.leg_length)),
            (c.arm_angle, lambda: np.arctan2(z - k.base - h, k.cx - x)),
            (c.strut_swing, lambda: np.arctan2(x - k.xb, z - k.zb)),
            (c.strut_tilt, lambda: np.arcsin(a3 / g.strut_length)),
        ):
            if limits != Range():
                turned = angle()
                inside &= (turned >= limits.low) & (turned <= limits.high)
    if inside.any():
        poses = np.stack([x[inside], np.zeros(int(inside.sum())), z[inside]], axis=-1)
        inside[inside] = _is_clear(g, poses, c, mode)
    offsets = np.stack(carriages)
    low = np.where(inside, -c.travel - offsets.min(axis=0), inf)
    high = np.where(inside, c.travel - offsets.max(axis=0), -inf)
    return Columns(low, high)


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
