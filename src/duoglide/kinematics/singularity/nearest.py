"""Distance in the xz plane to lines, half circles, the strut's circle and the curve of case 2.

Coordinates (X, Z) are those of C3 seen from B3; all surfaces are cylinders along y. Of each surface
only what lies in the closure of reach counts: whatever lies beyond is farther away than the edge,
because the straight way to it crosses the edge.

This is what lies under ``clearance``, for callers that know their positions to be within reach.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray, IndexArray
from duoglide.kinematics.singularity.case2 import Case2Curve, curve_of
from duoglide.kinematics.singularity.nearest_pose import SURFACES
from duoglide.machine import Geometry

BLOCK = 4096  # poses at a time, to bound the memory
_SIDES = np.array([[-1.0], [0.0], [1.0]])  # lower edge of the legs' reach, legs flat, upper edge


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The nearest singular surfaces or edges of reach of some positions.

    Attributes:
        distance: Distance to it [mm], shape (...).
        away: Unit vector straight away from it, shape (..., 3).
        surface: Which of ``SURFACES`` it is, shape (...).
    """

    distance: FloatArray
    away: FloatArray
    surface: IndexArray

    @property
    def family(self) -> NDArray[np.str_]:
        """Names of the families, as in ``Margins``: an array of shape (...), or one name."""
        return np.array(SURFACES)[self.surface]


def nearest_surface(g: Geometry, v: int, position: FloatArray, within: float = inf) -> Nearest:
    """Find the nearest surface of the branch ``v`` for reachable positions.

    In the modes w1 = w2 every pose is singular besides (legs parallel); that is not looked at.

    Args:
        g: Dimensions of the robot.
        v: Sign of sin(beta).
        position: Platform centre O' [mm], shape (..., 3), within reach.
        within: Distance up to which the quartic of case 2 is sought [mm]: who only asks whether
            something is nearer than that has the answer sooner.
    """
    shape, poses = position.shape[:-1], position.size // 3
    distance, away = np.empty(poses), np.zeros((poses, 3))
    surface = np.empty(poses, dtype=np.intp)
    _in_blocks(g, v, position, within, (distance, away, surface))
    return Nearest(distance.reshape(shape), away.reshape(position.shape), surface.reshape(shape))


def _in_blocks(
    g: Geometry,
    v: int,
    position: FloatArray,
    within: float,
    out: tuple[FloatArray, FloatArray, IndexArray],
) -> None:
    """Find the nearest surfaces, a block of poses at a time."""
    distance, away, surface = out
    xb = g.platform_half_width - g.rail_half_spacing
    zb = g.carriage_height + g.strut_drop
    X = position[..., 0].ravel() - xb
    Z = position[..., 2].ravel() - zb
    curve = curve_of(g, v)
    for start in range(0, X.size, BLOCK):
        part = slice(start, start + BLOCK)
        found, surface[part] = _nearest(g, (curve, within), X[part], Z[part])
        distance[part], away[part, 0], away[part, 2] = found.T


def _nearest(
    g: Geometry, quartic: tuple[Case2Curve, float], X: FloatArray, Z: FloatArray
) -> tuple[FloatArray, IndexArray]:
    """Return the distance and the direction away, shape (n, 3), and which surface it is."""
    curve, within = quartic
    v, l2, l6, l9 = curve.v, g.leg_length, g.arm_length, g.strut_length
    u = X - 2.0 * (g.rail_half_spacing - g.platform_half_width)
    rise = Z - (g.riser_height + g.arm_drop - g.strut_drop)
    radius = np.hypot(X, Z)
    safe = np.where(radius > 0.0, radius, 1.0)
    table = np.empty((len(SURFACES), 3, X.size))  # distance and direction away
    table[0] = np.maximum(l6 - np.abs(u), 0.0), -np.copysign(1.0, u), np.zeros_like(u)
    away_x = np.where(radius > 0.0, -X / safe, 1.0)
    table[1] = np.maximum(l9 - radius, 0.0), away_x, -Z / safe
    _half_circles(u, rise - _SIDES * l2, l6, v, table[2:5])
    best = table[:5, 0].min(axis=0)
    table[5] = curve.nearest(X, Z, np.minimum(best, within))
    first = table[:, 0].argmin(axis=0)
    return table[first, :, np.arange(X.size)], first


def _half_circles(u: FloatArray, w: FloatArray, l6: float, v: int, out: FloatArray) -> None:
    """Measure the distance to the halves of three circles where w has the sign v.

    They are the lower edge of the legs' reach, legs flat, and the upper edge. Where the nearest
    point of a circle is on its other half, the ends of this half are farther than the line of the
    flat arm that they stand on: infinite here.

    Args:
        u: Coordinate along x from the circles' centres, shape (n,).
        w: Coordinate along z from each, (3, n).
        l6: Their radius.
        v: Sign of w on the halves that count.
        out: Where to write distance and direction away, (3, 3, n).
    """
    radius = np.hypot(u, w)
    outward = np.where(_SIDES == 0.0, np.sign(radius - l6), -v * _SIDES)
    outward = np.where(outward == 0.0, 1.0, outward)
    safe = np.where(radius > 0.0, radius, 1.0)
    out[:, 0] = np.where(v * w >= 0.0, np.abs(radius - l6), np.inf)
    out[:, 1], out[:, 2] = outward * u / safe, outward * w / safe
