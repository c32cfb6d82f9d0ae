"""Mechanisms as data: this robot, and others that the paper compares it with.

What is taken from [Shen2021]_: the joints of this robot, its POC, xi, DOF, constraint degrees and
coupling degree; that the others are translational with three DOF; and Delta's 21 joints and 17
links. The joints of the others are what their names say, with axes as their builders place them.
Their xi, constraint and coupling degrees are computed, and held against no publication. The
Tri-pyramid family is left out: what joints its limbs have is not in the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from duoglide.paper.topology.mechanism import Joint, JointKind, Mechanism
from duoglide.paper.topology.subspace import cross, vector

_Axis = Sequence[int | Fraction]
_Step = tuple[JointKind, tuple[_Axis, ...]]
R, P, C, U, PA = (
    JointKind.REVOLUTE,
    JointKind.PRISMATIC,
    JointKind.CYLINDRICAL,
    JointKind.UNIVERSAL,
    JointKind.PARALLELOGRAM,
)
X, Y = (1, 0, 0), (0, 1, 0)
_OBLIQUE = (3, 0, -2)  # the axis of parallelogram 2, which turns about y with the strut
_THREE = ((5, 0, 2), (-3, 4, 1), (-2, -6, 3))  # three limb directions in general position


def duoglide_robot(strut_axis: _Axis = Y) -> Mechanism:
    """Return the robot of [Shen2021]_, Section 1.

    Args:
        strut_axis: Direction of the revolutes R32 and R33 in series with parallelogram 2. They have
            to differ from x: parallel to R13 they would leave the platform a rotation about x.
    """
    legs = [
        joint
        for i in (1, 2)
        for joint in (
            Joint.of(P, ("base", f"carriage {i}"), Y, actuated=True),
            Joint.of(R, (f"carriage {i}", f"leg {i}"), X),
            Joint.of(R, (f"leg {i}", "coupler"), X),
        )
    ]
    strut = [
        Joint.of(P, ("base", "carriage 3"), Y, actuated=True),
        Joint.of(R, ("carriage 3", "lower bar"), strut_axis),
        Joint.of(PA, ("lower bar", "upper bar"), _OBLIQUE),
        Joint.of(R, ("upper bar", "platform"), strut_axis),
    ]
    arm = Joint.of(PA, ("coupler", "platform"), Y)
    return Mechanism("Duoglide", (*legs, arm, *strut))


def delta() -> Mechanism:
    """Return Clavel's Delta with revolute parallelograms, limbs R-R-Pa-R with parallel axes."""
    return _limbs("Delta", [((R, (u,)), (R, (u,)), (PA, (_tilted(u),)), (R, (u,))) for u in _THREE])


def orthoglide() -> Mechanism:
    """Return the Orthoglide of Wenger and Chablat, limbs P-R-Pa-R on orthogonal rails."""
    rails = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    axes = ((0, 1, 0), (0, 0, 1), (1, 0, 0))
    return _limbs(
        "Orthoglide",
        [
            ((P, (rail,)), (R, (u,)), (PA, (_tilted(u),)), (R, (u,)))
            for rail, u in zip(rails, axes, strict=True)
        ],
    )


def rrc3() -> Mechanism:
    """Return the 3-RRC, the axes of each limb parallel."""
    return _limbs("3-RRC", [((R, (u,)), (R, (u,)), (C, (u,))) for u in _THREE])


def crr3() -> Mechanism:
    """Return the 3-CRR of Kong and Gosselin, the axes of each limb parallel."""
    return _limbs("3-CRR", [((C, (u,)), (R, (u,)), (R, (u,))) for u in _THREE])


def upu3() -> Mechanism:
    """Return Tsai's translational 3-UPU.

    The outer axes of a limb's two universal joints are parallel, and so are the inner ones; the
    prismatic joint, along the limb, is driven.
    """
    limbs = []
    for u in _THREE:
        inner = cross(vector(u), vector((1, 2, 7)))
        along = cross(inner, vector((2, -1, 1)))
        limbs.append(((U, (u, inner)), (P, (along,)), (U, (inner, u))))
    return _limbs("3-UPU", limbs, actuated=1)


def _limbs(name: str, limbs: Sequence[Sequence[_Step]], actuated: int = 0) -> Mechanism:
    """Join base and platform by limbs; the joint number ``actuated`` of each is driven."""
    joints = []
    for i, steps in enumerate(limbs, start=1):
        names = ["base", *(f"limb {i} link {k}" for k in range(1, len(steps))), "platform"]
        for k, (kind, axes) in enumerate(steps):
            links = (names[k], names[k + 1])
            joints.append(Joint.of(kind, links, *axes, actuated=k == actuated))
    return Mechanism(name, tuple(joints))


def _tilted(u: _Axis) -> _Axis:
    """Return an axis perpendicular to ``u``: that of a parallelogram whose short sides lie on u."""
    return cross(vector(u), vector((2, 3, 13)))
