"""Which link is too short, and by how much: what is asked when a closed form has no real value."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.errors import SingularityError, UnreachableError
from duoglide.kinematics.constants import PoseConstants
from duoglide.kinematics.kernels import in_numpy

EDGE = 1e-9  # [mm], by which rounding may leave a pose on the edge outside it


@dataclass(frozen=True, slots=True)
class Reach:
    """Square roots of the inverse kinematics, and what each link lacks.

    Attributes:
        A: l6 sin(beta) [mm], 0 where the arm is too short.
        h: Rise of the legs [mm].
        p: Stroke of the legs along y [mm], 0 where they are too short.
        q: Stroke of the strut along y [mm].
        lacking: What arm, legs and strut lack [mm], shape (..., 3); negative where they suffice.
            The legs' value counts only where the arm suffices.
    """

    A: FloatArray
    h: FloatArray
    p: FloatArray
    q: FloatArray
    lacking: FloatArray

    def __getitem__(self, rows: BoolArray) -> Reach:
        return Reach(self.A[rows], self.h[rows], self.p[rows], self.q[rows], self.lacking[rows])

    @property
    def within(self) -> BoolArray:
        """Where every link suffices, up to rounding."""
        return np.asarray((self.lacking <= EDGE).all(axis=-1))


def links_pose(x: float, z: float, k: PoseConstants) -> tuple[float, ...]:
    """Square roots of one pose, as in ``Reach``, and what arm, legs and strut lack."""
    l6, l2, l9 = k.l6, k.l2, k.l9
    u = x - k.cx
    A = k.v * sqrt(max((l6 - u) * (l6 + u), 0.0))
    h = z - k.base - A
    X = x - k.xb
    Z = z - k.zb
    p = sqrt(max((l2 - h) * (l2 + h), 0.0))
    square = X * X + Z * Z
    q = sqrt(max(l9 * l9 - square, 0.0))
    # near the arm's own edge, rounding x alone moves A, and h with it, by up to a square root
    noise = 2.0**-51 * l6 * (abs(x) + abs(k.cx) + l6)
    slack = noise / max(abs(A), sqrt(noise))
    return A, h, p, q, abs(u) - l6, abs(h) - l2 - slack, sqrt(square) - l9


_links_columns = in_numpy(links_pose)


def reach_of(position: FloatArray, k: PoseConstants) -> Reach:
    """Evaluate every link at finite positions of shape (..., 3); never fails."""
    with np.errstate(over="ignore"):
        A, h, p, q, *lacking = _links_columns(position[..., 0], position[..., 2], k)
    return Reach(A=A, h=h, p=p, q=q, lacking=np.stack(lacking, axis=-1))


def require_reach(position: FloatArray, k: PoseConstants) -> Reach:
    """Evaluate every link, and refuse the first position that one of them is too short for.

    Raises:
        UnreachableError: Carries the index, the link and the shortfall [mm].
    """
    reach = reach_of(position, k)
    within = reach.within
    if not within.all():
        index = tuple(int(i) for i in np.argwhere(~within)[0])
        raise _unreachable(position[index], reach, index, k)
    return reach


def require_inside(position: FloatArray, reach: Reach) -> None:
    """Refuse positions on the edge of reach, where the carriages would move infinitely fast.

    Raises:
        SingularityError: Names the index and the family.
    """
    on_edge = reach.lacking > -EDGE
    if on_edge.any():
        *row, link = (int(i) for i in np.argwhere(on_edge)[0])
        index = tuple(row)
        family = ("arm_flat", "legs_vertical", "strut")[link]
        x, y, z = position[index].tolist()
        where = f"position[{', '.join(map(str, index))}]" if index else "position"
        raise SingularityError(
            f"{where} ({x:.6g}, {y:.6g}, {z:.6g}) mm lies on the edge of reach ({family}), where"
            " the carriages' derivatives are infinite",
            index=index,
            family=family,
        )


def _unreachable(
    pose: FloatArray, reach: Reach, index: tuple[int, ...], k: PoseConstants
) -> UnreachableError:
    x, y, z = pose.tolist()
    arm, legs, strut = reach.lacking[index].tolist()
    if arm > EDGE:
        link, short = "arm", arm
        remedy = f"x from {k.cx - k.l6:.6g} to {k.cx + k.l6:.6g} mm is within it"
    elif strut >= legs:
        link, short = "strut", strut
        scale = k.l9 / (k.l9 + strut)
        near_x, near_z = k.xb + (x - k.xb) * scale, k.zb + (z - k.zb) * scale
        remedy = f"(x, z) = ({near_x:.6g}, {near_z:.6g}) is the nearest that it reaches"
    else:
        link, short = "legs", legs
        middle = k.base + float(reach.A[index])
        remedy = f"at this x they reach z from {middle - k.l2:.6g} to {middle + k.l2:.6g} mm"
    where = f"position[{', '.join(map(str, index))}]" if index else "position"
    verb = "are" if link == "legs" else "is"
    return UnreachableError(
        f"{where} ({x:.6g}, {y:.6g}, {z:.6g}) mm: the {link} {verb} {short:.6g} mm too short;"
        f" {remedy}",
        index=index,
        link=link,
        shortfall=short,
    )
