"""Figures 2, 4, 5, 6 and 7: the robot at poses."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import SingularityError
from duoglide.kinematics.constants import Plane
from duoglide.kinematics.home import home_carriages
from duoglide.kinematics.model import forward, jacobian, reachable
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.singularity.margins import margins
from duoglide.kinematics.solutions import ForwardSolution, forward_all, inverse_all
from duoglide.kinematics.workspace import Curve, CurveKind
from duoglide.machine import Geometry, Machine
from duoglide.paper.figures.plates import Plate, Solid
from duoglide.paper.figures.robot import KEY, arrow, axes_cross, robot
from duoglide.paper.figures.scene import Label, View

TABLE_2 = np.array([-111.24, 244.70, 246.92])  # measured, Section 2.3.4
TABLE_3 = np.array([-80.39, 66.73, 307.23])
ALL_ROUND = View(-128.0, 18.0)


def example_carriages(geometry: Geometry) -> FloatArray:
    """Return Table 2's carriages where they give four poses, else those of the home pose."""
    if geometry == Geometry() or len(_solutions(geometry, TABLE_2)) == 4:
        return TABLE_2
    return home_carriages(Machine(geometry=geometry))


def _solutions(geometry: Geometry, carriages: FloatArray) -> list[ForwardSolution]:
    try:
        return forward_all(geometry, carriages)
    except SingularityError:
        return []


def figure_2(geometry: Geometry) -> Plate:
    """Coordinates and joints."""
    carriages = example_carriages(geometry)
    scene = robot(geometry, forward(geometry, carriages))
    origin = np.array([-3.4 * geometry.rail_half_spacing, -geometry.rail_half_length, 0.0])
    scene.merge(axes_cross(origin, 70.0, ("$X$", "$Y$", "$Z$")))
    for side, name in ((1.0, "rail I"), (-1.0, "rail II")):
        end = np.array([side * geometry.rail_half_spacing, -geometry.rail_half_length, 0.0])
        scene.add(Label(end, name, (-4, -12)))
    caption = (
        "Kinematic model, drawn to scale at the pose of Table 2, row 1. The paper's figure is not"
        " to scale. The axes of parallelogram 1 are parallel to y, as Eq. 10 needs (Section 1 says"
        " x); the revolutes R32 and R33 of the strut are parallel to y too: parallel to x they"
        " would leave the platform a rotation."
    )
    return Plate(2, "Kinematic model", caption, [Solid("", scene, ALL_ROUND)], 1, (6.0, 3.9), KEY)


def figure_4(geometry: Geometry) -> Plate:
    """The forward solutions."""
    carriages = example_carriages(geometry)
    panels = []
    for letter, solution in zip("abcd", forward_all(geometry, carriages), strict=False):
        m, n = solution.mode.m, solution.mode.n
        mode = _mode_of(geometry, solution.position, carriages)
        x, y, z = solution.position
        title = (
            f"({letter})  m = {m:+d}, n = {n:+d}  (v = {mode.v:+d})\n"
            f"O' = ({x:.2f}, {y:.2f}, {z:.2f}) mm"
        )
        panels.append(Solid(title, robot(geometry, solution.position, mode), View(-118.0, 12.0)))
    caption = (
        "The forward solutions of one triple of carriages (Table 2). The arm's sign v follows from"
        " the pose: rows 2 and 4 have v = -1, which the paper does not say; v and n are"
        " independent. Only (a) is the machine; the others pass through rails or carriages."
    )
    return Plate(4, "Forward solutions", caption, panels, 2, (7.0, 6.2), KEY)


def _mode_of(geometry: Geometry, position: FloatArray, carriages: FloatArray) -> WorkingMode:
    """Find the working mode in which a position has these carriages."""
    found = min(
        inverse_all(geometry, position),
        key=lambda solution: float(np.abs(solution.carriages - carriages).max()),
    )
    return found.mode


def figure_5(geometry: Geometry) -> Plate:
    """The realisable inverse solutions."""
    position = TABLE_3
    if geometry != Geometry():
        position = forward(geometry, example_carriages(geometry))
    panels = []
    for number, solution in enumerate(inverse_all(geometry, position), start=1):
        if not solution.realisable:
            continue
        kind = "singular: legs parallel" if solution.singular else "regular"
        y1, y2, y3 = solution.carriages
        title = f"No. {number}  ({kind})\n$y_A$ = ({y1:.2f}, {y2:.2f}, {y3:.2f}) mm"
        scene = robot(geometry, position, solution.mode, labels=False)
        panels.append(Solid(title, scene, View(-118.0, 14.0)))
    caption = (
        "The inverse solutions of one pose whose carriages stand in order (Table 3). Nos. 3 and 4"
        " would need carriage 2 on the wrong side of carriage 1. As in the paper, only two are"
        " regular: in the others the legs are parallel, and the platform is free to move with the"
        " carriages held."
    )
    return Plate(5, "Inverse solutions", caption, panels, 3, (8.4, 5.0), KEY)


def figure_6(geometry: Geometry) -> Plate:
    """Serial singularities."""
    g = geometry
    panels = []
    for letter, name, edge in (
        (
            "a",
            "strut across the rail, $p_3 = 0$",
            Curve(g, CurveKind.STRUT_TOP, g.strut_length),
        ),
        ("b", "legs vertical, $p_1 = p_2 = 0$", Curve(g, CurveKind.LEGS, g.leg_length)),
    ):
        for pose in _middle_of_reachable(edge, -1e-6, 0.95, 191):
            title = f"({letter})  {name}\nO' = ({pose[0]:.1f}, {pose[1]:.0f}, {pose[2]:.1f}) mm"
            panels.append(Solid(title, robot(geometry, pose), View(-118.0, 14.0)))
    caption = (
        "Serial singularities, both edges of the workspace: (a) the paper's example, where carriage"
        " 3 passes under C3; (b) both legs upright, which the paper names without a picture."
    )
    return Plate(6, "Serial singularities", caption, panels, 2, (7.0, 3.8), KEY)


def _middle_of_reachable(curve: Curve, lift: float, share: float, count: int) -> FloatArray:
    """Return the middle one of the poses on a curve that the links reach, shape (1, 3) or (0, 3).

    Args:
        curve: Where to look.
        lift: By how much above it [mm]; beside the edge of reach, rounding decides nothing.
        share: How far along x from where the arm stands upright, as a share of its length.
        count: How many poses to look at.
    """
    g = curve.geometry
    x = Plane.of(g).cx + g.arm_length * np.linspace(-share, share, count)
    poses = np.stack([x, np.zeros_like(x), curve.z(x) + lift], axis=-1)
    poses = poses[np.isfinite(poses[:, 2])]
    poses = poses[reachable(g, poses)]
    middle: FloatArray = poses[len(poses) // 2 :][:1]
    return middle


def figure_7(geometry: Geometry) -> Plate:
    """Parallel singularities, with the motion that is free."""
    position = forward(geometry, example_carriages(geometry))
    parallel = WorkingMode(w1=1, w2=1)
    flat, case_2 = _flat_pose(geometry), _case_2_pose(geometry)
    stages: list[tuple[str, str, FloatArray, WorkingMode]] = [
        ("a", "case 1: legs parallel", position[None, :], parallel),
        ("b", "case 2: arm in line with strut", case_2, WORKING),
        ("c", "legs flat (not in the paper)", flat, WORKING),
    ]
    panels = []
    shown = [(letter, name, pose, mode) for letter, name, poses, mode in stages for pose in poses]
    for letter, name, pose, mode in shown:
        scene = robot(geometry, pose, mode, labels=False)
        free = free_motion(geometry, pose, mode)
        scene.add(arrow(pose, free), arrow(pose, -free))
        title = f"({letter})  {name}\nO' = ({pose[0]:.1f}, {pose[1]:.1f}, {pose[2]:.1f}) mm"
        view = View(-92.0, 4.0) if letter == "b" else View(-118.0, 14.0)
        panels.append(Solid(title, scene, view))
    caption = (
        "Parallel singularities; the arrows show the motion that is free although the carriages are"
        " held, confirmed by the MuJoCo model. (b) The paper says that case 2 does not exist for"
        " these lengths: it does, at x above 150 mm, where its search ended. (c) The paper divides"
        " by h and so loses the legs lying flat."
    )
    return Plate(7, "Parallel singularities", caption, panels, 3, (9.0, 3.5), KEY)


def free_motion(geometry: Geometry, pose: FloatArray, mode: WorkingMode) -> FloatArray:
    """Return the direction in which O' can move with the carriages held, at a parallel singularity.

    In the modes w1 = w2 the first two rows of the Jacobian agree, and the third decides.
    """
    _, _, rows = np.linalg.svd(jacobian(geometry, pose, mode))
    direction: FloatArray = rows[-1]
    return direction


def _flat_pose(g: Geometry) -> FloatArray:
    """Return a pose with both legs along the rail, shape (1, 3), or none."""
    return _middle_of_reachable(Curve(g, CurveKind.LEGS), 1e-9, 0.9, 181)


def _case_2_pose(g: Geometry) -> FloatArray:
    """Return a pose of case 2, that of erratum 3 for Table 1, shape (1, 3), or none."""
    if g == Geometry():
        return _on_case_2(g, 250.0, 187.0, 188.0)
    return _middle_of_reachable(Curve(g, CurveKind.CASE_2), 0.0, 0.999, 4001)


def _on_case_2(g: Geometry, z: float, low: float, high: float) -> FloatArray:
    """Return the pose of case 2 at height z, by bisection between two x [mm], shape (1, 3)."""
    for _ in range(60):
        x = 0.5 * (low + high)
        inside = bool(margins(g, (x, 0.0, z)).arm_strut > 0.0)
        low, high = (x, high) if inside else (low, x)
    return np.array([[low, 0.0, z]])
