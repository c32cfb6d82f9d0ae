"""Every mistake of [Shen2021] that we know, proven; and those of our own notes on it.

The numbers are those of docs/errata.md.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin, sqrt

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics.singularity.margins import margins
from duoglide.kinematics.workspace import Constraints, admissible, grid_over_reach
from duoglide.paper.topology import (
    Joint,
    JointKind,
    Mechanism,
    analyse,
    decompositions,
    duoglide_robot,
    screw_mobility,
)

G = dg.Geometry()
B, D, L1, L2, L3, L6, L9 = 90.0, 45.0, 70.0, 160.0, 120.0, 180.0, 300.0
POSE = (-80.39, 66.73, 307.23)  # measured, Section 2.3.4; what Table 3 starts from


def residual(
    position: np.ndarray, carriages: np.ndarray, cos_beta: float, sin_beta: float
) -> float:
    """Greatest error of the lengths of arm, legs and strut [mm], from the joints' coordinates."""
    x, y, z = position
    e2, c3 = np.array([x + D, y, z]), np.array([x - D, y, z])
    d2 = e2 + L6 * np.array([cos_beta, 0.0, -sin_beta])
    feet = [np.array([side, q, L1]) for side, q in zip((B, B, -B), carriages, strict=True)]
    half = np.array([0.0, L3 / 2, 0.0])
    lengths = [
        np.linalg.norm(d2 - half - feet[0]) - L2,
        np.linalg.norm(d2 + half - feet[1]) - L2,
        np.linalg.norm(c3 - feet[2]) - L9,
        d2[0] - B,
    ]
    return float(np.abs(lengths).max())


def test_1_l3_of_eq_15_has_the_signs_of_b_and_d_swapped() -> None:
    x, y, z = POSE

    def third(L: float) -> list[float]:
        root = sqrt(-L - ((z - L1) ** 2 - L9**2))
        return [y + root, y - root]

    assert third((x - B + D) ** 2) == pytest.approx([200.89, -67.43], abs=0.005)  # as printed
    assert third((x - D + B) ** 2) == pytest.approx([246.9229, -113.4629], abs=1e-4)  # Table 3
    found = [solution.carriages[2] for solution in dg.inverse_all(G, POSE)[:2]]
    assert found == pytest.approx([246.9229, -113.4629], abs=1e-4)


def test_2_no_point_of_the_paper_s_search_box_is_within_reach() -> None:
    x, y, z = np.meshgrid(
        np.linspace(-150, 150, 31), np.linspace(-200, 200, 5), np.linspace(380, 550, 35)
    )
    box = np.stack([x, y, z], axis=-1)
    for v in (1, -1):
        assert not dg.reachable(G, box, dg.WorkingMode(v=v)).any()
    assert L1 + L9 == 370.0  # the strut, straight up
    assert L1 + L2 + L6 == 410.0  # the other chain


def case_2_pose() -> np.ndarray:
    low, high = 187.27, 187.29
    for _ in range(60):
        x = 0.5 * (low + high)
        inside = dg.margins(G, (x, 0.0, 250.0)).arm_strut > 0.0
        low, high = (x, high) if inside else (low, x)
    return np.array([low, 0.0, 250.0])


def test_3_case_2_exists_within_reach() -> None:
    pose = case_2_pose()
    assert pose[0] == pytest.approx(187.2797, abs=1e-4)
    carriages = dg.inverse(G, pose)
    assert carriages == pytest.approx((-203.9995, 203.9995, 60.3834), abs=2e-3)
    x, _, z = pose
    beta = atan2(sqrt(L6**2 - (B - D - x) ** 2), B - D - x)
    assert np.degrees(beta) == pytest.approx(142.23, abs=0.01)
    h, p, q = z - L1 - L6 * sin(beta), 60.0 - carriages[1], -carriages[2]
    cot = cos(beta) / sin(beta)
    A = np.array([[cot * h, p, -h], [cot * h, -p, -h], [x + D, q, z - L1]])
    scale = np.prod(np.linalg.norm(A, axis=1))
    assert abs(np.linalg.det(A)) < 1e-9 * scale
    with pytest.raises(dg.SingularityError, match=r"arm|line"):
        dg.forward(G, carriages)


def test_3_case_2_is_absent_where_the_paper_searched() -> None:
    grid = grid_over_reach(G, Constraints(beyond_case_2=True), 2.0)
    inside = grid.lines.mask & (np.abs(grid.x) <= 150.0)[:, None]
    i, k = np.nonzero(inside)
    poses = np.stack([grid.x[i], np.zeros(len(i)), grid.z[k]], axis=-1)
    assert dg.margins(G, poses).arm_strut.min() > 0.0


def test_3_beyond_case_2_the_forward_solution_is_another_pose() -> None:
    pose = np.array([190.0, 0.0, 248.0])
    assert dg.reachable(G, pose)
    assert dg.margins(G, pose).arm_strut < 0.0
    carriages = dg.inverse(G, pose)
    other = dg.forward(G, carriages)
    assert np.linalg.norm(other - pose) > 1.0
    assert dg.forward(G, carriages, dg.AssemblyMode(n=-1)) == pytest.approx(pose)


def test_4_legs_flat_is_a_parallel_singularity() -> None:
    pose = np.array([0.0, 0.0, L1 + sqrt(L6**2 - 45.0**2)])
    assert pose[2] == pytest.approx(244.284, abs=5e-4)
    carriages = dg.inverse(G, pose)
    assert carriages == pytest.approx((-220.0, 220.0, 240.0), abs=0.06)
    assert abs(margins(G, pose).legs_flat) < 1e-9
    with pytest.raises(dg.SingularityError, match="flat"):
        dg.forward(G, carriages)


def test_4_at_flat_arms_the_two_branches_merge() -> None:
    for x in (B - D - L6, B - D + L6):
        pose = np.array([x, 0.0, 200.0])
        near = (x + (1e-9 if x < 0 else -1e-9), 0.0, 200.0)
        up, down = (dg.inverse(G, near, dg.WorkingMode(v=v)) for v in (1, -1))
        assert up == pytest.approx(down, abs=2e-3)
        assert margins(G, pose).arm_flat == pytest.approx(0.0, abs=1e-9)


def test_5_where_the_legs_are_parallel_a_continuum_of_poses_fits() -> None:
    carriages = np.array([124.6992, 244.6992, 246.9229])  # Table 3, column 1
    assert carriages[1] - carriages[0] == pytest.approx(L3)
    found = []
    for alpha in np.linspace(0.8, 2.0, 7):
        y = carriages[0] + L2 * cos(alpha) + L3 / 2
        F1, F2, F3 = 90.0, y - carriages[2], L2 * sin(alpha)
        G1, G2 = 2 * F3 * L6, -2 * F1 * L6
        G3 = F1**2 + F2**2 + F3**2 + L6**2 - L9**2
        beta = 2 * atan2(-G1 + sqrt(G1**2 + G2**2 - G3**2), G3 - G2)
        pose = np.array([B - L6 * cos(beta) - D, y, L1 + F3 + L6 * sin(beta)])
        assert residual(pose, carriages, cos(beta), sin(beta)) < 1e-9
        found.append(pose)
    assert np.ptp(np.array(found), axis=0).min() > 10.0
    with pytest.raises(dg.SingularityError, match="parallel"):
        dg.forward(G, carriages)


def test_5_eqs_9_and_11_return_another_pose_there() -> None:
    y, F3 = 124.6992 + L3 / 2, L2  # cos(alpha) = 0
    F1, F2 = 90.0, y - 246.9229
    G1, G2, G3 = 2 * F3 * L6, -2 * F1 * L6, F1**2 + F2**2 + F3**2 + L6**2 - L9**2
    roots = [2 * np.arctan((-G1 + n * sqrt(G1**2 + G2**2 - G3**2)) / (G3 - G2)) for n in (1, -1)]
    heights = [L1 + F3 + L6 * sin(beta) for beta in roots]
    assert max(heights) == pytest.approx(361.64, abs=0.01)
    assert abs(max(heights) - POSE[2]) > 50.0


def sign_of_sine(carriages: np.ndarray, position: np.ndarray, m: int) -> int:
    """Return v of a forward solution, from the rise of the arm."""
    rise = sqrt(L2**2 - (carriages[1] - carriages[0] - L3) ** 2 / 4)
    return 1 if position[2] - L1 - m * rise >= 0.0 else -1


def test_6_v_and_n_are_independent() -> None:
    carriages = np.array([-111.24, 244.70, 246.92])
    signs = {
        (s.mode.m, s.mode.n): sign_of_sine(carriages, s.position, s.mode.m)
        for s in dg.forward_all(G, carriages)
    }
    assert signs == {(1, 1): 1, (1, -1): -1, (-1, 1): 1, (-1, -1): -1}  # rows 2 and 4: v = -1


def test_6_with_n_plus_1_the_sine_is_negative_for_some_carriages() -> None:
    random = np.random.default_rng(5)
    total = negative = 0
    for carriages in random.uniform(-360.0, 360.0, (4000, 3)):
        try:
            position = dg.forward(G, carriages)
        except (dg.UnreachableError, dg.SingularityError):
            continue
        total += 1
        negative += sign_of_sine(carriages, position, 1) < 0
    print(f"{negative} of {total} real (+1, +1) solutions have sin(beta) < 0")
    assert total > 300
    assert 0.10 < negative / total < 0.20  # "about 15 %"


def test_7_eq_11_divides_by_zero_where_beta_is_pi() -> None:
    # C3 straight out along x from D2: beta = pi, x = 225.
    h = 100.0
    x, z = B - D + L6, L1 + h
    half = sqrt(L9**2 - (x + D) ** 2 - (z - L1) ** 2)
    stroke = sqrt(L2**2 - h**2)
    carriages = np.array([-L3 / 2 - stroke, L3 / 2 + stroke, half])
    F1, F3 = 90.0, h
    G2, G3 = -2 * F1 * L6, F1**2 + half**2 + F3**2 + L6**2 - L9**2
    assert pytest.approx(0.0, abs=1e-9) == G3 - G2
    poses = [dg.forward(G, carriages, dg.AssemblyMode(n=n)) for n in (1, -1)]
    assert min(np.linalg.norm(pose - [x, 0.0, z]) for pose in poses) < 1e-6


def test_8_the_robot_has_14_links_and_the_sum_of_freedoms_is_right() -> None:
    robot = duoglide_robot()
    assert robot.physical_joints == 17
    assert robot.physical_links == 14
    loops = robot.physical_joints - robot.physical_links + 1
    assert loops == 4  # two loops, and one inside each parallelogram; 16 links would leave two
    assert 17 - (3 + 5 + 3 + 3) == analyse(robot).dof == (6 + 5) - (3 + 5)


def test_9_parallelogram_1_swings_about_axes_parallel_to_y() -> None:
    beta = np.linspace(0.3, 2.8, 9)
    along_y = np.stack([B - L6 * np.cos(beta) - D, 0 * beta, L6 * np.sin(beta)], axis=-1)
    motion = np.diff(along_y, axis=0)
    assert np.abs(motion[:, 1]).max() == 0.0  # Eq. 10: the swing is in the xz plane, normal to y
    assert np.abs(motion[:, 0]).min() > 1.0  # about an axis along x it could not change x


def test_10_slips_eq_12_has_three_functions() -> None:
    first = dg.forward(G, (-111.2392, 244.6992, 246.9229))
    second = dg.forward(G, (-111.2392, 244.6992, 240.0))
    assert first[1] == second[1]  # f2 has two arguments
    assert first[2] != second[2]  # so that z, with three, is another function: f3


def test_10_slips_case_1_is_columns_1_2_7_and_8() -> None:
    parallel = [
        i
        for i, solution in enumerate(dg.inverse_all(G, POSE), start=1)
        if solution.realisable and solution.mode.w1 == solution.mode.w2
    ]
    assert parallel == [1, 2, 7, 8]  # not "(2) and (7)"


def test_11_the_strut_s_revolutes_must_not_be_parallel_to_x() -> None:
    """PAPER.md puts them parallel to x; the topology, screws and MuJoCo all say four freedoms."""
    for axis, freedoms in (((1, 0, 0), 4), ((0, 1, 0), 3)):
        robot = duoglide_robot(strut_axis=axis)
        assert analyse(robot).dof == freedoms
        assert screw_mobility(robot).dof == freedoms


def test_12_the_largest_boxes_of_our_notes_stick_out() -> None:
    """PAPER.md has (-104..103) x (250..332); two corners of it are beyond reach."""
    assert hypot(103 + 45, 332 - 70) == pytest.approx(300.9, abs=0.05)
    assert not dg.reachable(G, (103.0, 0.0, 332.0))
    assert not dg.reachable(G, (-104.0, 0.0, 332.0))
    corners = np.array([(x, 0.0, z) for x in (-103.2, 100.9) for z in (250.001, 332.12)])
    assert admissible(G, corners, Constraints()).all()


def test_13_the_workspace_ends_in_a_cusp_at_z_70() -> None:
    """PAPER.md's lowest z, 77, is that of its grid."""
    cosine = -1 + 1e-10
    x, A = B - D - L6 * cosine, L6 * sqrt(1 - cosine**2)
    z = L1 + 1.2 * A  # between legs flat (1 A) and case 2 (1.5 A)
    assert admissible(G, (x, 0.0, z), Constraints())
    assert z == pytest.approx(70.0, abs=0.01)


def test_14_v_minus_1_reaches_some_positions_with_sixteen_solutions() -> None:
    """Section 2.3.3 counts 16 inverse solutions, 2.3.4 finds 8: both can be, by position."""
    assert len(dg.inverse_all(G, POSE)) == 8
    position = (200.0, 0.0, 120.0)
    assert len(dg.inverse_all(G, position)) == 16


def test_15_legs_vertical_and_legs_parallel_are_one_plane_of_the_carriages() -> None:
    for x in (-110.0, -90.0):
        z = L1 + L2 + sqrt(L6**2 - (45.0 - x) ** 2)
        carriages = dg.inverse(G, (x, 0.0, z - 1e-9))
        assert carriages[1] - carriages[0] == pytest.approx(L3, abs=2e-3)


def test_16_tables_2_and_3_are_not_each_other_s_inverse_to_four_decimals() -> None:
    """Each starts from measured values with two decimals: 0.004 mm lie between them."""
    back = dg.inverse(G, dg.forward(G, (-111.24, 244.70, 246.92)))
    assert back == pytest.approx((-111.24, 244.70, 246.92), abs=1e-9)
    table_3 = dg.inverse(G, POSE)
    assert 5e-4 < np.abs(table_3 - back).max() < 5e-3


def test_residual_of_random_poses_vanishes() -> None:
    random = np.random.default_rng(17)
    poses = random.uniform([-135, -300, 70], [225, 300, 370], (100_000, 3))
    poses = poses[dg.reachable(G, poses)]
    q = dg.inverse(G, poses)
    cosine = (B - D - poses[:, 0]) / L6
    h = poses[:, 2] - L1 - L6 * np.sqrt(1 - cosine**2)
    legs = [np.hypot(poses[:, 1] + s * L3 / 2 - q[:, i], h) - L2 for i, s in ((0, -1), (1, 1))]
    offset = np.stack([poses[:, 0] + D, poses[:, 1] - q[:, 2], poses[:, 2] - L1], axis=-1)
    strut = np.linalg.norm(offset, axis=1) - L9
    assert len(poses) > 30_000
    assert np.abs([*legs, strut]).max() < 1e-9


def parallel_jacobian(pose: np.ndarray) -> np.ndarray:
    """Return A of Eq. 16 as printed, its rows e1, e2, e3."""
    x, y, z = pose
    carriages = dg.inverse(G, pose)
    beta = atan2(sqrt(L6**2 - (B - D - x) ** 2), B - D - x)
    h, cot = z - L1 - L6 * sin(beta), cos(beta) / sin(beta)
    p1, p2 = y - L3 / 2 - carriages[0], y + L3 / 2 - carriages[1]
    return np.array([[cot * h, -p1, -h], [cot * h, -p2, -h], [x - D + B, y - carriages[2], z - L1]])


def test_17_case_2_is_three_rows_in_one_plane_and_not_two_in_one_line() -> None:
    A = parallel_jacobian(case_2_pose())
    rows = A / np.linalg.norm(A, axis=1)[:, None]
    x, _, z = case_2_pose()
    beta = atan2(sqrt(L6**2 - (B - D - x) ** 2), B - D - x)
    assert sin(beta) / cos(beta) == pytest.approx(-(z - L1) / (x - D + B), rel=1e-6)  # as printed
    assert abs(np.linalg.det(rows)) < 1e-6
    angles = np.degrees(np.arccos((rows @ rows.T)[[0, 0, 1], [1, 2, 2]]))
    assert angles == pytest.approx([103.33, 116.72, 139.95], abs=0.01)  # no two are in line
    assert A[0, 0] / A[0, 2] == pytest.approx(A[2, 0] / A[2, 2])  # the printed condition
    assert A[0, 1] / A[0, 2] == pytest.approx(2.065, abs=1e-3)  # and the other, which fails
    assert A[2, 1] / A[2, 2] == pytest.approx(-0.335, abs=1e-3)


def test_18_a_constraint_degree_of_minus_3_exists() -> None:
    x, y, z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
    free = [(JointKind.UNIVERSAL, (x, y)), (JointKind.PRISMATIC, (z,)), (JointKind.SPHERICAL, ())]
    stiff = [(JointKind.REVOLUTE, (axis,)) for axis in (x, y, z)]
    joints = []
    for limb, steps in enumerate((free, free, stiff)):
        names = ["base", f"{limb} a", f"{limb} b", "platform"]
        joints += [
            Joint.of(kind, (names[k], names[k + 1]), *axes) for k, (kind, axes) in enumerate(steps)
        ]
    degrees = {
        soc.constraint_degree
        for found in decompositions(Mechanism("two limbs and a stiff one", tuple(joints)))
        for soc in found.socs
    }
    assert -3 in degrees  # three revolutes that close a loop of six equations: 3 - 0 - 6


def test_19_eq_4_gives_the_equations_of_one_loop_and_not_their_sum() -> None:
    robot = analyse(duoglide_robot())
    each = [soc.xi for soc in robot.decomposition.socs]
    freedoms = sum(soc.freedoms for soc in robot.decomposition.socs)
    assert each == [3, 5]  # the paper's own figures; the braces of Eq. 4 are 5 for the second
    assert freedoms - sum(each) == robot.dof == 3
    assert freedoms - each[-1] == 6  # what Eq. 3 would give were the braces the sum
