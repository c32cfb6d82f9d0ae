from __future__ import annotations

import time
from math import inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.errors import ConfigError, InputError
from duoglide.kinematics.workspace import (
    Constraints,
    CurveKind,
    Range,
    WorkspaceReport,
    admissible,
    along_rails,
    analyse,
    columns,
    count_poses,
    grid_over_reach,
    interference_gap,
    largest_cuboid,
    largest_rectangle,
    section,
    volume,
)

TABLE_1 = dg.Geometry()
GEOMETRIES = [
    TABLE_1,
    dg.Geometry(riser_height=20.0, arm_drop=10.0, strut_drop=-15.0),
    dg.Geometry(platform_half_width=120.0, strut_length=260.0),
]


@pytest.fixture(scope="module")
def report() -> WorkspaceReport:
    """Table 1, links alone, on the paper page's grid."""
    return analyse(TABLE_1, step=0.25)


def test_volume_per_metre_is_39_58_litres(report: WorkspaceReport) -> None:
    assert report.litres_per_metre == pytest.approx(39.58, abs=0.005)
    assert report.exact_area == pytest.approx(report.area, rel=1e-4)


def test_ignoring_case_2_would_give_41_30_litres() -> None:
    loose = Constraints(beyond_case_2=True)
    assert section(TABLE_1, loose).area * 1e-3 == pytest.approx(41.30, abs=0.005)
    assert grid_over_reach(TABLE_1, loose, 0.5).area * 1e-3 == pytest.approx(41.30, abs=0.01)


def test_bounding_box_is_that_of_the_links(report: WorkspaceReport) -> None:
    assert report.low[[0, 2]] == pytest.approx([-135.0, 77.0], abs=1.0)
    assert report.high[[0, 2]] == pytest.approx([225.0, 370.0], abs=0.3)


def test_largest_boxes_without_and_with_room(report: WorkspaceReport) -> None:
    # PAPER.md has 207 x 82 and 179 x 70; tests/paper/test_errata.py says why these are too large.
    assert report.largest_box.size == pytest.approx((204.4, 82.0), abs=0.5)
    assert report.largest_box.area == pytest.approx(16765.0, abs=10.0)
    assert report.largest_cuboid.low == (report.largest_box.low[0], -inf, report.largest_box.low[1])
    roomy = analyse(TABLE_1, Constraints(clearance=10.0), step=2.0)
    assert roomy.largest_box.area == pytest.approx(12326.0, abs=10.0)


def test_the_largest_box_is_free_up_to_its_corners(report: WorkspaceReport) -> None:
    (x0, z0), (x1, z1) = report.largest_box.low, report.largest_box.high
    way = np.linspace(0.0, 1.0, 101)
    x, z = np.meshgrid(x0 + way * (x1 - x0), z0 + way * (z1 - z0))
    poses = np.stack([x, np.zeros_like(x), z], axis=-1)
    sides = dg.margins(TABLE_1, poses)
    assert min(sides.legs_flat.min(), sides.arm_strut.min()) >= -1e-6


def test_deepest_point_and_best_conditioned_point(report: WorkspaceReport) -> None:
    assert report.deepest[[0, 2]] == pytest.approx([-41.0, 302.0], abs=0.5)
    assert report.depth == pytest.approx(67.7, abs=0.05)
    assert report.best_conditioned[[0, 2]] == pytest.approx([-70.0, 331.0], abs=0.5)
    assert report.inverse_condition == pytest.approx(0.244, abs=5e-4)


@pytest.mark.parametrize("geometry", GEOMETRIES, ids=["Table 1", "drops", "wide platform"])
@pytest.mark.parametrize(
    ("constraints", "y"),
    [
        (Constraints(), 0.0),
        (Constraints(travel=360.0, carriage_width=60.0), 0.0),
        (Constraints(travel=360.0), 120.0),
        (Constraints(travel=330.0), -90.0),
        (Constraints(carriage_width=300.0, beyond_case_2=True), 0.0),
    ],
)
def test_exact_sections_agree_with_the_grid(
    geometry: dg.Geometry, constraints: Constraints, y: float
) -> None:
    found = section(geometry, constraints, y)
    grid = grid_over_reach(geometry, constraints, 0.5)
    cells = (grid.lines.low <= y) & (y <= grid.lines.high)
    outline = sum(piece.end - piece.start for piece in found.pieces) + 300.0
    assert found.area == pytest.approx(cells.sum() * 0.25, abs=0.1 * outline)


@pytest.mark.parametrize("mode", [dg.WorkingMode(), dg.WorkingMode(-1, -1, 1, -1)])
def test_points_inside_the_outline_are_admissible_and_points_outside_are_not(
    mode: dg.WorkingMode,
) -> None:
    limits = Constraints(travel=360.0, carriage_width=60.0)
    y = -60.0
    found = section(TABLE_1, limits, y, mode)
    assert found.area > 100.0
    for piece in found.pieces:
        x = np.linspace(piece.start, piece.end, 33)[1:-1]
        for curve, inward in ((piece.low, 1.0), (piece.high, -1.0)):
            z = curve.z(x)
            thick = piece.high.z(x) - piece.low.z(x) > 1e-3
            for side, expected in ((1e-6, True), (-1e-6, False)):
                poses = np.stack([x, np.full_like(x, y), z + inward * side], axis=-1)[thick]
                assert (admissible(TABLE_1, poses, limits, mode) == expected).all()


def test_the_boundary_is_made_of_arcs_and_one_quartic() -> None:
    kinds = {curve.kind for curve in section(TABLE_1).curves}
    assert kinds == {CurveKind.LEGS, CurveKind.STRUT_TOP, CurveKind.CASE_2}
    for curve, line in section(TABLE_1).outline():
        if curve.kind is not CurveKind.CASE_2:
            radii = np.hypot(*(line - curve.centre).T)
            assert radii == pytest.approx(curve.radius, abs=1e-9)


def test_volume_on_finite_rails_is_the_integral_of_exact_sections() -> None:
    limits = Constraints(travel=360.0, carriage_width=60.0)
    assert volume(TABLE_1, limits, tolerance=0.05) == pytest.approx(
        grid_over_reach(TABLE_1, limits, 0.5).volume, rel=1e-2
    )
    assert volume(TABLE_1, Constraints()) == inf


@settings(max_examples=40, derandomize=True, deadline=None)
@given(st.floats(-140, 230), st.floats(-400, 400), st.floats(60, 380), st.floats(100, 500))
def test_admissible_means_the_carriages_stay_on_their_rails(
    x: float, y: float, z: float, travel: float
) -> None:
    limits = Constraints(travel=travel, carriage_width=60.0)
    pose = np.array([x, y, z])
    if admissible(TABLE_1, pose, limits):
        carriages = dg.inverse(TABLE_1, pose)
        assert np.abs(carriages).max() <= travel + 1e-9
        assert carriages[1] - carriages[0] >= 60.0 - 1e-9
        assert dg.forward(TABLE_1, carriages) == pytest.approx(pose, abs=1e-3)
    elif dg.reachable(TABLE_1, pose):
        carriages = dg.inverse(TABLE_1, pose)
        sides = dg.margins(TABLE_1, pose)
        assert (
            np.abs(carriages).max() > travel - 1e-9
            or carriages[1] - carriages[0] < 60.0 + 1e-9
            or min(sides.legs_flat, sides.arm_strut) < 1e-9
        )


def test_clearance_is_kept() -> None:
    grid = grid_over_reach(TABLE_1, Constraints(clearance=15.0), 4.0)
    i, k = np.nonzero(grid.lines.mask)
    poses = np.stack([grid.x[i], np.zeros(len(i)), grid.z[k]], axis=-1)
    assert dg.clearance(TABLE_1, poses).min() >= 15.0


@pytest.mark.parametrize(
    ("name", "limits", "measure"),
    [
        ("leg_angle", Range(0.5, 1.0), lambda x, z, h, beta: np.arcsin(h / 160.0)),
        ("arm_angle", Range(1.0, 2.0), lambda x, z, h, beta: beta),
        ("strut_swing", Range(-0.2, 0.2), lambda x, z, h, beta: np.arctan2(x + 45, z - 70)),
        (
            "strut_tilt",
            Range(0.3, 0.9),
            lambda x, z, h, beta: np.arccos(np.hypot(x + 45, z - 70) / 300.0),
        ),
    ],
)
def test_passive_joints_stay_in_their_ranges(name, limits, measure) -> None:  # type: ignore[no-untyped-def]
    grid = grid_over_reach(TABLE_1, Constraints(**{name: limits}), 3.0)
    free = grid.lines.mask
    everything = grid_over_reach(TABLE_1, Constraints(), 3.0).lines.mask
    x, z = np.meshgrid(grid.x, grid.z, indexing="ij")
    x, z = x[everything], z[everything]
    beta = np.arccos((45.0 - x) / 180.0)
    angle = measure(x, z, z - 70.0 - 180.0 * np.sin(beta), beta)
    expected = (limits.low <= angle) & (angle <= limits.high)
    assert 0 < expected.sum() < expected.size
    assert (free[everything] == expected).all()


def test_thick_links_take_away_what_is_too_close() -> None:
    thick = grid_over_reach(TABLE_1, Constraints(link_radius=15.0), 3.0)
    thin = grid_over_reach(TABLE_1, Constraints(), 3.0)
    assert not (thick.lines.mask & ~thin.lines.mask).any()
    assert 0.0 < thick.area < thin.area
    i, k = np.nonzero(thin.lines.mask & ~thick.lines.mask)
    taken = np.stack([thin.x[i], np.zeros(len(i)), thin.z[k]], axis=-1)
    assert interference_gap(TABLE_1, taken).max() < 30.0


def test_interference_gap_is_the_distance_of_dense_points_on_the_links() -> None:
    from duoglide.kinematics.skeleton import joints

    pose = np.array([120.0, 0.0, 250.0])
    at = joints(TABLE_1, pose)
    t = np.linspace(0, 1, 400)[:, None]

    def points(a: str, b: str) -> np.ndarray:
        return at[a] + t * (at[b] - at[a])

    apart = [
        (("B1", "C1"), ("B2", "C2")), (("B1", "C1"), ("D2", "E2")), (("B1", "C1"), ("S", "T")),
        (("B1", "C1"), ("B3", "C3")), (("C1", "C2"), ("S", "T")), (("C1", "C2"), ("B3", "C3")),
        (("D2", "E2"), ("B3", "C3")), (("B2", "C2"), ("B3", "C3")), (("B2", "C2"), ("D2", "E2")),
    ]  # fmt: skip
    least = min(
        np.linalg.norm(points(*a)[:, None] - points(*b)[None], axis=-1).min() for a, b in apart
    )
    assert interference_gap(TABLE_1, pose) == pytest.approx(least, abs=0.5)


def test_the_largest_rectangle_is_found_by_brute_force_too() -> None:
    grid = grid_over_reach(TABLE_1, Constraints(travel=300.0), 20.0)
    mask = (grid.lines.low <= 0) & (grid.lines.high >= 0)
    best = 0
    nx = len(mask)
    for i0 in range(nx):
        for i1 in range(i0, nx):
            free = mask[i0 : i1 + 1].all(axis=0)
            run = longest = 0
            for cell in free:
                run = run + 1 if cell else 0
                longest = max(longest, run)
            best = max(best, (i1 - i0 + 1) * longest)
    assert largest_rectangle(grid, mask).area == pytest.approx(best * 400.0)


@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("mode", [(1, -1, 1, 1), (-1, -1, 1, -1), (1, 1, 1, 1)])
def test_the_extent_along_the_rails_is_that_of_the_worst_line_of_a_rectangle(
    geometry: dg.Geometry, mode: tuple[int, int, int, int]
) -> None:
    signs, limits = dg.WorkingMode(*mode), Constraints(travel=300.0, beyond_case_2=True)
    rng, side, found = np.random.default_rng(4), np.linspace(0.0, 1.0, 41), 0
    grid = grid_over_reach(geometry, limits, 12.0, signs)
    cells = rng.permutation(np.argwhere(grid.lines.mask))
    for i, k in cells[:60]:
        x, z = grid.x[i] + rng.uniform(1, 40) * side, grid.z[k] + rng.uniform(1, 40) * side
        lines = columns(geometry, *np.meshgrid(x, z), limits, signs)
        if not lines.mask.all():
            continue
        low, high = along_rails(geometry, 300.0, (x[0], x[-1]), (z[0], z[-1]), signs)
        worst = lines.low.max(), lines.high.min()
        assert worst[0] - 1e-9 <= low <= worst[0] + 0.1  # lines between the samples are no better
        assert worst[1] - 0.1 <= high <= worst[1] + 1e-9
        found += 1
    assert found >= 10


def test_the_largest_cuboid_is_found_by_brute_force_too() -> None:
    geometry, limits = GEOMETRIES[1], Constraints(travel=260.0, carriage_width=60.0)
    grid = grid_over_reach(geometry, limits, 16.0)
    low, high = grid.lines.low, grid.lines.high
    best = 0.0
    for i0 in range(len(low)):
        floor, ceiling = low[i0].copy(), high[i0].copy()
        for i1 in range(i0, len(low)):
            floor, ceiling = np.maximum(floor, low[i1]), np.minimum(ceiling, high[i1])
            for k0 in np.flatnonzero(floor < ceiling):
                runs = np.maximum.accumulate(floor[k0:]), np.minimum.accumulate(ceiling[k0:])
                sizes = np.arange(len(runs[0])) * np.maximum(runs[1] - runs[0], 0.0)
                best = max(best, (i1 - i0) * sizes.max() * 16.0**2)
    found = largest_cuboid(
        geometry, grid, limits, lambda x, z: columns(geometry, x, z, limits).mask
    )
    assert best < found.volume < 1.4 * best  # of the centres of large cells: a little less
    way = [np.linspace(a, b, 25) for a, b in zip(found.low, found.high, strict=True)]
    poses = np.stack(np.meshgrid(*way), axis=-1)
    assert admissible(geometry, poses, limits).all()
    for axis, sign in ((1, -1), (1, 1)):  # and no longer along the rails
        beyond = poses.copy()
        beyond[..., axis] += sign * 0.5
        assert not admissible(geometry, beyond, limits).all()


def test_ten_million_poses_take_seconds() -> None:
    limits = Constraints(travel=360.0, carriage_width=60.0, clearance=2.0)
    start = time.process_time()
    grid = grid_over_reach(TABLE_1, limits, 0.9)
    y = np.linspace(-360.0, 360.0, int(np.ceil(1e7 / grid.lines.mask.size)))
    count = count_poses(grid, y)
    used = time.process_time() - start
    poses = grid.lines.mask.size * y.size
    print(f"{poses} poses, {count} admissible, {used:.2f} s of processor time")
    assert poses >= 10_000_000
    assert used < 6.0  # under 2 s on a quiet core


def test_the_machine_file_sets_the_constraints() -> None:
    machine = dg.Machine.default()
    found = analyse(machine, step=8.0)
    assert found.constraints == Constraints(travel=360.0, carriage_width=60.0, clearance=2.0)
    assert found.volume < 2 * 360.0 * found.area
    assert np.abs([found.low[1], found.high[1]]).max() < 360.0
    assert found.largest_cuboid.size == pytest.approx((199.6, 261.5, 79.3), abs=0.5)
    assert found.largest_cuboid.volume == pytest.approx(4.140e6, rel=5e-4)
    (x0, z0), (x1, z1) = found.largest_box.low, found.largest_box.high
    low, high = along_rails(machine.geometry, 360.0, (x0, x1), (z0, z1))
    assert found.largest_box.area * (high - low) < found.largest_cuboid.volume


def test_contradictions_are_refused() -> None:
    with pytest.raises(InputError, match="ends must rise"):
        Range(1.0, 0.0)
    with pytest.raises(InputError, match="travel"):
        Constraints(travel=-1.0)
    with pytest.raises(InputError, match="step"):
        grid_over_reach(TABLE_1, Constraints(), 0.0)
    with pytest.raises(ConfigError, match="no pose"):
        analyse(TABLE_1, Constraints(clearance=100.0), step=5.0)
    with pytest.raises(InputError, match="no cell"):
        grid = grid_over_reach(TABLE_1, Constraints(), 20.0)
        largest_rectangle(grid, np.zeros(grid.lines.mask.shape, dtype=bool))


def test_columns_beyond_reach_are_empty() -> None:
    lines = columns(TABLE_1, np.array([500.0]), np.array([300.0]), Constraints(travel=360.0))
    assert not lines.mask.any()
    assert lines.length.tolist() == [0.0]
