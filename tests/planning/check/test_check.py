from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.kinematics.singularity.margins import clearance_gradient
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.actions import Dwell, SetOutput
from duoglide.motion.path.checked import CheckedPath
from duoglide.motion.path.rounded import round_corners
from duoglide.planning.check.check import check_curve
from duoglide.planning.check.rules import Rules
from duoglide.planning.check.search import first_failure

SETTINGS = settings(max_examples=4, deadline=None, derandomize=True)
STANDARD = ((-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0))
FREE = 50_000.0  # [mm], rails that never end
KINDS: dict[str, Callable[[np.ndarray], dg.Path]] = {
    "line": lambda points: dg.Path.line(points[0], points[1]),
    "arc": lambda points: dg.Path.arc(*points[:3]),
    "spline": dg.Path.through,
    "blend": lambda points: dg.Path.polyline(points, tolerance=3.0),
    "corner": dg.Path.polyline,
}


def random_geometry(rng: np.random.Generator) -> dg.Geometry:
    if rng.random() < 0.3:
        return dg.Geometry()
    drop = rng.uniform(-20.0, 20.0, 3)
    return dg.Geometry(
        rail_half_spacing=rng.uniform(60, 120),
        platform_half_width=rng.uniform(20, 60),
        carriage_height=rng.uniform(30, 90),
        leg_length=rng.uniform(120, 200),
        coupler_length=rng.uniform(90, 150),
        riser_height=drop[0],
        arm_length=rng.uniform(140, 220),
        arm_drop=drop[1],
        strut_drop=drop[2],
        strut_length=rng.uniform(250, 350),
    )


def is_assembled(geometry: dg.Geometry, points: np.ndarray) -> bool:
    if not dg.reachable(geometry, points).all():
        return False
    margins = dg.margins(geometry, points)
    clear = dg.clearance(geometry, points).min()
    return bool(margins.legs_flat.min() > 0.0 and margins.arm_strut.min() > 0.0 and clear > 0.1)


def random_path(rng: np.random.Generator, geometry: dg.Geometry, kind: str) -> dg.Path:
    """A path well inside reach, of one kind of segment."""
    middle = geometry.rail_half_spacing - geometry.platform_half_width
    while True:
        x = middle + rng.uniform(-1, 1) * geometry.arm_length
        centre = np.array([x, rng.uniform(-60, 60), rng.uniform(60, 480)])
        points = centre + rng.normal(size=(4, 3)) * rng.uniform(2.0, 40.0)
        path = KINDS[kind](points)
        curve = round_corners(path).curve
        if is_assembled(geometry, curve.position(np.linspace(0.0, curve.end, 500))):
            return path


def least(curve: Curve, margin: Callable[[np.ndarray], np.ndarray]) -> float:
    """Brute force, then a closer and closer look at the best few samples."""
    grid = np.union1d(np.linspace(0.0, curve.end, 1001), curve.breaks)
    values = margin(curve.position(grid))
    best = grid[np.argsort(values)[:4]]
    width = curve.end / 500.0
    for _ in range(6):
        close = (best[:, None] + width * np.linspace(-1.0, 1.0, 21)).clip(0.0, curve.end)
        near = margin(curve.position(close.ravel())).reshape(close.shape)
        best = close[np.arange(best.size), near.argmin(axis=1)]
        width /= 8.0
    return float(min(values.min(), near.min()))


def bounds(path: dg.Path, geometry: dg.Geometry) -> dict[str, Callable[[float], dg.Machine]]:
    """Machines that leave a path a given room, one for each rule."""
    curve = round_corners(path).curve
    free = dg.Machine(
        geometry=replace(geometry, rail_half_length=FREE),
        clearance=0.0,
        carriage_margin=0.0,
        carriage_width=0.0,
    )

    def carriages(p: np.ndarray) -> np.ndarray:
        return dg.inverse(geometry, p)

    clear = least(curve, lambda p: dg.clearance(geometry, p))
    travel = -least(curve, lambda p: -np.abs(carriages(p)).max(axis=1))
    order = least(curve, lambda p: carriages(p)[:, 1] - carriages(p)[:, 0])
    top = -least(curve, lambda p: -p[:, 2])

    def box(room: float) -> dg.Box:
        return dg.Box(low=(-FREE, -FREE, top + room), high=(FREE, FREE, FREE), name="lid")

    return {
        "clearance": lambda room: replace(free, clearance=clear - room),
        "travel": lambda room: replace(
            free, geometry=replace(geometry, rail_half_length=travel + room)
        ),
        "order": lambda room: replace(free, carriage_width=max(order - room, 0.0)),
        "keep_out": lambda room: replace(free, keep_out=(box(room),)),
    }


def passes(machine: dg.Machine, path: dg.Path) -> bool:
    """What ``check_path`` decides, without the pains that it takes to explain a refusal."""
    curve = round_corners(path).curve
    return first_failure(Rules.of(machine, curve)) == np.inf


@pytest.mark.parametrize("kind", KINDS)
@SETTINGS
@given(seed=st.integers(0, 10**6))
def test_one_nanometre_decides_every_rule_on_every_kind_of_segment(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    geometry = random_geometry(rng)
    path = random_path(rng, geometry, kind)
    for rule, machine in bounds(path, geometry).items():
        assert passes(machine(1e-6), path), rule
        for room in (8e-8, 0.0, -1e-6):
            assert not passes(machine(room), path), (rule, room)


@pytest.mark.parametrize(
    ("surface", "start", "along"),
    [
        ("strut", (-45.0, 0.0, 366.0), (30.0, 0.0, 0.0)),
        ("legs_flat", (-41.0, 0.0, 232.0), (20.0, 0.0, 8.0)),
        ("legs_vertical", (-115.0, 0.0, 300.0), (18.0, 0.0, 15.0)),
        ("arm_flat", (-131.0, 0.0, 230.0), (0.0, 0.0, 20.0)),
        ("arm_strut", (185.0, 0.0, 240.0), (-9.0, 0.0, 19.0)),
    ],
)
def test_a_line_that_touches_a_surface_at_one_point_is_refused_by_its_name(
    surface: str, start: tuple[float, ...], along: tuple[float, ...]
) -> None:
    """Move a line against a surface until it touches; a nanometre away it passes."""
    machine = dg.Machine(
        geometry=dg.Geometry(rail_half_length=FREE), clearance=0.0, carriage_margin=0.0
    )
    geometry = machine.geometry
    ends = np.array([start, np.add(start, along)])

    def distance(line: np.ndarray) -> tuple[float, np.ndarray]:
        curve = round_corners(dg.Path.line(*line)).curve
        gap = least(curve, lambda p: dg.clearance(geometry, p))
        track = curve.position(np.linspace(0.0, curve.end, 2001))
        nearest = track[dg.clearance(geometry, track).argmin()]
        return gap, clearance_gradient(geometry, nearest)

    for _ in range(30):
        gap, away = distance(ends)
        ends = ends + away * (1e-6 - gap)
    assert gap == pytest.approx(1e-6, abs=1e-8)
    assert passes(machine, dg.Path.line(*ends))
    with pytest.raises(dg.PathError) as caught:
        dg.check_path(machine, dg.Path.line(*(ends - away * 1e-6)))
    assert caught.value.quantity in (surface, "reach")
    assert not passes(machine, dg.Path.line(*(ends - away * 1e-3)))


@pytest.mark.parametrize(("room", "expected"), [(1e-6, True), (5e-8, False)])
def test_a_line_along_a_bound_is_decided_as_finely(room: float, expected: bool) -> None:
    flat = dg.Geometry().rail_half_spacing - dg.Geometry().platform_half_width - 180.0
    x = flat + 2.0 + room
    machine = dg.Machine(geometry=dg.Geometry(rail_half_length=FREE), carriage_margin=0.0)
    assert passes(machine, dg.Path.line((x, -500, 230), (x, 500, 230))) is expected
    assert passes(machine, dg.Path.line((x, 0, 205), (x, 0, 225))) is expected


@pytest.mark.parametrize(("room", "expected"), [(1e-6, True), (5e-8, False)])
def test_an_arc_concentric_with_the_edge_of_reach_is_decided_as_finely(
    room: float, expected: bool
) -> None:
    angle = np.radians([80.0, 85.0, 90.0])
    radius = 300.0 - 2.0 - room
    points = np.stack(
        [-45.0 + radius * np.cos(angle), 0 * angle, 70.0 + radius * np.sin(angle)], axis=1
    )
    machine = dg.Machine(geometry=dg.Geometry(rail_half_length=FREE), carriage_margin=0.0)
    assert passes(machine, dg.Path.arc(*points)) is expected


def test_no_sample_sees_a_spike_but_the_check_does() -> None:
    """A blend on a spline's edge, 0.4 um past the lid, between any thousand samples."""
    path = dg.Path.polyline([(-41, -100, 290), (-41, 0, 310), (-41, 100, 290)], tolerance=1e-3)
    curve = round_corners(path).curve
    top = -least(curve, lambda p: -p[:, 2])
    for room, expected in ((1e-6, True), (-4e-7, False)):
        lid = dg.Box(low=(-FREE, -FREE, top + room), high=(FREE, FREE, FREE))
        assert passes(replace(dg.Machine(), keep_out=(lid,)), path) is expected


@SETTINGS
@given(seed=st.integers(0, 10**6))
def test_what_passes_is_admissible_at_every_sample_and_the_report_says_how_far(seed: int) -> None:
    rng = np.random.default_rng(seed)
    machine = dg.Machine()
    points = np.array([-41.0, 0.0, 300.0]) + rng.normal(size=(5, 3)) * [25.0, 60.0, 18.0]
    path = dg.Path.polyline(points, tolerance=rng.uniform(0.1, 5.0))
    curve = round_corners(path).curve
    sigma = np.union1d(np.linspace(0.0, curve.end, 3001), curve.breaks)
    track = curve.position(sigma)
    reachable = bool(dg.reachable(machine.geometry, track).all())
    if not passes(machine, path):
        with pytest.raises(dg.PathError) as caught:
            dg.check_path(machine, path)
        error = caught.value
        assert 0.0 <= error.arc_length <= curve.length
        gaps = np.linalg.norm(track - error.position, axis=1)
        assert gaps.min() < curve.end / 3000.0
        assert error.quantity
        before = sigma[curve.arc_length(sigma) < error.arc_length - 1e-3]
        if before.size:
            assert dg.clearance(machine.geometry, curve.position(before)).min() > 2.0
        return
    assert reachable
    report = dg.check_path(machine, path).report
    carriages = dg.inverse(machine.geometry, track)
    sampled = {
        "clearance": dg.clearance(machine.geometry, track).min(),
        "travel_2": 360.0 - np.abs(carriages[:, 1]).max(),
        "order": (carriages[:, 1] - carriages[:, 0]).min(),
        **{k: np.abs(v).min() for k, v in dg.margins(machine.geometry, track).by_family().items()},
    }
    for family, expected in sampled.items():
        assert report[family].margin == pytest.approx(expected, abs=1e-3), family
        there = curve.position(report[family].sigma)
        np.testing.assert_allclose(report[family].position, there, atol=1e-9)


def test_the_standard_move_passes_and_its_report_names_the_travel_as_tightest() -> None:
    checked = dg.check_path(dg.Machine.default(), dg.pick_and_place(*STANDARD))
    assert checked.report.tightest.family in ("travel_1", "travel_2")
    assert checked.report["travel_1"].margin == pytest.approx(2.14547, abs=1e-4)
    assert checked.report["clearance"].margin == pytest.approx(49.968, abs=1e-3)
    assert "mm along" in str(checked.report)


def test_a_checked_path_survives_its_dictionary() -> None:
    path = dg.pick_and_place(*STANDARD, at_place=[SetOutput(1, 16, False)], dwell=0.1)
    checked = dg.check_path(dg.Machine.default(), path.capped(900.0))
    again = CheckedPath.from_dict(checked.to_dict())
    assert again.to_dict() == checked.to_dict()
    assert again.machine == checked.machine
    with pytest.raises(dg.InputError, match="not a checked path"):
        CheckedPath.from_dict({"machine": {}})


def test_actions_and_caps_are_placed_on_the_curve() -> None:
    points = [(-41, -50, 300), (-41, 0, 300), (-41, 0, 320), (-41, 60, 320)]
    path = dg.Path.polyline(points, tolerance=2.0, speed=[100.0, 100.0, 400.0])
    path = path.at(2, SetOutput(2, 1, True)).at(1, Dwell(0.2)).capped(300.0)
    checked = dg.check_path(dg.Machine.default(), path)
    (rest, dwell), (passing, output) = checked.actions
    assert (dwell, output) == (Dwell(0.2), SetOutput(2, 1, True))
    assert checked.curve.rests == (rest,)
    np.testing.assert_allclose(checked.curve.position(rest), points[1], atol=1e-9)
    assert [cap.speed for cap in checked.speed_caps] == [100.0, 300.0]
    assert checked.speed_caps[0].end == checked.speed_caps[1].start == passing
    assert checked.speed_caps[1].end == checked.curve.end


def test_tool_and_work_frame_move_the_curve_into_the_base_frame() -> None:
    machine = dg.Machine(tool_offset=(5.0, 0.0, -30.0), work_frame=(100.0, 10.0, 20.0))
    shift = np.subtract(machine.work_frame, machine.tool_offset)
    path = dg.Path.line((-41.0 - shift[0], -50, 250), (-41.0 - shift[0], 50, 250))
    curve = dg.check_path(machine, path).curve
    np.testing.assert_allclose(curve.position(0.0), np.add(path.start, shift))


@pytest.mark.parametrize(
    ("a", "b", "quantity"),
    [
        ((0, 0, 300), (0, 0, 400), "reach"),
        ((0, 0, 300), (-400, 0, 300), "reach"),
        ((0, 0, 300), (0, 0, 150), "legs_flat"),
        ((0, 0, 300), (187.28, 0, 250), "arm_strut"),
        ((0, -300, 300), (0, 0, 300), "travel"),
        ((190, 0, 120), (200, 0, 125), "assembly"),
        ((-41, -152.5, 290), (-41, 152.5, 290), "travel"),
    ],
)
def test_a_refused_path_says_where_what_and_by_how_much(
    a: tuple[float, ...], b: tuple[float, ...], quantity: str
) -> None:
    with pytest.raises(dg.PathError, match="mm") as caught:
        dg.check_path(dg.Machine(carriage_margin=0.0), dg.Path.line(a, b))
    error = caught.value
    assert error.quantity == quantity
    assert error.amount > 0.0
    way = np.subtract(b, a) / np.linalg.norm(np.subtract(b, a))
    np.testing.assert_allclose(error.position, a + error.arc_length * way, atol=1e-6)
    assert "\n" not in str(error)


def test_the_height_and_the_part_that_a_refusal_offers_do_pass() -> None:
    machine = dg.Machine.default()
    with pytest.raises(dg.PathError) as caught:
        dg.check_path(machine, dg.Path.line((-41, -152.5, 290), (-41, 152.5, 290)))
    text = str(caught.value)
    assert "0.13 mm higher it would pass" in text
    assert passes(machine, dg.Path.line((-41, -152.5, 290.13), (-41, 152.5, 290.13)))
    assert not passes(machine, dg.Path.line((-41, -152.5, 290.11), (-41, 152.5, 290.11)))
    assert "its part from 0.31 to 304.69 mm passes as it is" in text
    assert passes(machine, dg.Path.line((-41, -152.19, 290), (-41, 152.19, 290)))


def test_carriages_1_and_2_keep_their_distance() -> None:
    geometry = dg.Geometry(coupler_length=40.0, rail_half_length=FREE)
    path = dg.Path.line((0, 0, 380), (0, 50, 380))
    gap = np.diff(dg.inverse(geometry, np.array([0.0, 0.0, 330.0]))[:2])[0]
    path = dg.Path.line((0, 0, 330), (0, 50, 330))
    assert passes(dg.Machine(geometry=geometry, carriage_width=gap - 1e-6), path)
    with pytest.raises(dg.PathError, match="carriages 1 and 2") as caught:
        dg.check_path(dg.Machine(geometry=geometry, carriage_width=gap + 1.0), path)
    assert caught.value.quantity == "order"
    assert caught.value.amount == pytest.approx(1.0, abs=1e-6)


def test_the_corner_of_a_keep_out_box_is_rounded_a_nanometre_away() -> None:
    box = dg.Box(low=(-60.0, -10.0, 290.0), high=(-20.0, 10.0, 310.0), name="camera")
    for room, expected in ((1e-6, True), (-1e-6, False)):
        ends = (-41, -30, 310 - 20 + room * 2), (-41, 10, 330 + room * 2)
        machine = replace(dg.Machine.default(), keep_out=(box,))
        assert passes(machine, dg.Path.line(*ends)) is expected
    with pytest.raises(dg.PathError, match="keep_out camera") as caught:
        dg.check_path(machine, dg.Path.line((-41, -50, 300), (-41, 50, 300)))
    assert caught.value.quantity == "keep_out"
    assert caught.value.amount == pytest.approx(10.0, abs=0.1)


def test_ten_thousand_segments_are_certified_together() -> None:
    angle = np.linspace(0.0, 60.0, 10_001)
    points = np.stack(
        [-41 + 20 * np.cos(angle), np.linspace(-90, 90, angle.size), 305 + 10 * np.sin(angle)],
        axis=1,
    )
    path = dg.Path.polyline(points, blends=dg.Blend.radius(0.03))
    checked = dg.check_path(dg.Machine.default(), path)
    assert checked.curve.count > 9_990
    assert checked.curve.rests == ()


def test_an_impossible_clearance_is_a_clear_error() -> None:
    machine = dg.Machine(clearance=100.0)
    with pytest.raises(dg.PathError, match="clearance of 100 mm"):
        dg.check_path(machine, dg.pick_and_place(*STANDARD))


def test_a_curve_that_is_torn_is_refused_whoever_made_it() -> None:
    machine = dg.Machine.default()
    curve = round_corners(dg.pick_and_place(*STANDARD)).curve
    check_curve(machine, curve)
    for row, jump in ((0, 1e-3), (1, 1e-2)):
        coefficients = curve.coefficients.copy()
        coefficients[2, row, 2] += jump
        torn = Curve(curve.spans, curve.rates, coefficients)
        with pytest.raises(dg.PathError, match="torn") as caught:
            check_curve(machine, torn)
        assert caught.value.quantity == "continuity"
    square = round_corners(dg.Path.polyline([(-41, 0, 300), (-41, 9, 300), (-41, 9, 309)])).curve
    check_curve(machine, square)
    with pytest.raises(dg.PathError, match="torn"):
        check_curve(machine, Curve(square.spans, square.rates, square.coefficients))


@pytest.mark.parametrize("far", [1e7, 1e9, 1e12])
def test_a_path_to_far_away_is_refused_where_it_leaves_reach(far: float) -> None:
    machine, start = dg.Machine.default(), (-41.0, 0.0, 302.0)
    bent = dg.Path.arc(start, (-41.0, far, 302.0), (-41.0, 0.0, far))
    for path in (dg.Path.line(start, (-41.0, far, 302.0)), bent):
        with pytest.raises(dg.PathError) as caught:
            dg.check_path(machine, path)
        assert 10.0 < caught.value.arc_length < 1000.0


def test_lines_from_a_micrometre_to_ten_metres_are_decided() -> None:
    machine = dg.Machine.default()
    assert dg.check_path(machine, dg.Path.line((-41, 0, 300), (-41, 1e-3, 300))).curve.end == (
        pytest.approx(1e-3)
    )
    with pytest.raises(dg.PathError) as caught:
        dg.check_path(machine, dg.Path.line((-41, 0, 300), (-41, 10_000, 300)))
    assert caught.value.quantity == "travel"
    assert caught.value.amount > 9_000.0
    long = dg.Machine(geometry=dg.Geometry(rail_half_length=20_000.0))
    checked = dg.check_path(long, dg.Path.line((-41, 0, 300), (-41, 10_000, 300)))
    assert checked.curve.end == 10_000.0


@pytest.mark.parametrize(("room", "expected"), [(1e-6, True), (5e-8, False)])
def test_an_arc_on_which_a_carriage_stands_still_is_decided_as_finely(
    room: float, expected: bool
) -> None:
    """Carriage 3 stays where it is while the strut's end goes round it."""
    x, stand = -41.0, 300.0
    radius = np.sqrt(300.0**2 - (x + 45.0) ** 2)
    angle = np.radians([36.5, 38.0, 40.0])
    points = np.stack(
        [x + 0 * angle, stand - radius * np.cos(angle), 70.0 + radius * np.sin(angle)], axis=1
    )
    np.testing.assert_allclose(dg.inverse(dg.Geometry(), points)[:, 2], stand)
    machine = dg.Machine(geometry=dg.Geometry(rail_half_length=stand + room))
    assert passes(machine, dg.Path.arc(*points)) is expected


@pytest.mark.parametrize(
    ("centre", "radius", "degrees", "side"),
    [
        ((-45.0, 70.0), 300.0, (80.0, 85.0, 90.0), -1.0),
        ((45.0, 230.0), 180.0, (150.0, 155.0, 165.0), -1.0),
        ((45.0, 70.0), 180.0, (100.0, 120.0, 140.0), 1.0),
    ],
    ids=["strut", "legs_vertical", "legs_flat"],
)
def test_a_path_may_follow_a_singular_surface_a_nanometre_away(
    centre: tuple[float, float], radius: float, degrees: tuple[float, ...], side: float
) -> None:
    """Without any clearance, where the carriages' speeds are nearly infinite all the way."""
    machine = dg.Machine(
        geometry=dg.Geometry(rail_half_length=FREE), clearance=0.0, carriage_margin=0.0
    )
    angle = np.radians(degrees)
    for room, expected in ((1e-6, True), (5e-8, False)):
        r = radius + side * room
        x, z = centre[0] + r * np.cos(angle), centre[1] + r * np.sin(angle)
        path = dg.Path.arc(*np.stack([x, 0.0 * angle, z], axis=1))
        assert passes(machine, path) is expected


@pytest.mark.parametrize("step", [1e-5, 1e-3])
def test_steps_of_ten_nanometres_are_rounded_and_certified(step: float) -> None:
    turns = np.random.default_rng(4).normal(size=(40, 3))
    points = np.array([-41.0, 100.0, 300.0]) + step * np.cumsum(turns, axis=0)
    checked = dg.check_path(dg.Machine.default(), dg.Path.polyline(points, tolerance=0.1 * step))
    assert checked.curve.length < 100.0 * step
    straight = np.linspace((-41.0, 100.0, 300.0), (-41.0 + 3 * step, 100.0, 300.0 + 7 * step), 5)
    assert dg.check_path(dg.Machine.default(), dg.Path.polyline(straight)).curve.rests == ()


def test_whatever_is_asked_the_answer_is_a_checked_path_or_a_path_error() -> None:
    rng = np.random.default_rng(7)
    aligned = dg.Geometry(rail_half_spacing=45.0, platform_half_width=45.0)
    machines = [dg.Machine(), dg.Machine(clearance=0.0), dg.Machine(geometry=aligned)]
    decided = {True: 0, False: 0}
    for turn in range(45):
        size = 10.0 ** rng.uniform(-4.0, 3.0) if turn % 2 else 60.0
        points = [-41.0, 0.0, 300.0] + rng.normal(size=(4, 3)) * size
        if turn % 5 == 0:
            points[2] = points[0]  # a way back
        paths = dg.Path.through(points), dg.Path.polyline(points, tolerance=size / 4.0)
        try:
            checked = dg.check_path(machines[turn % 3], paths[turn % 2])
            assert all(e.margin >= e.required for e in checked.report.least[:5])
            decided[True] += 1
        except dg.PathError as error:
            assert len(error.position) == 3
            decided[False] += 1
    assert min(decided.values()) > 5


def test_the_report_of_rounded_paths_names_the_least_margins_there_are() -> None:
    rng, machine = np.random.default_rng(1), dg.Machine(clearance=0.0)
    done = 0
    while done < 40:
        pick, place = rng.uniform([-100, -100, 240], [60, 100, 305], (2, 3))
        try:
            checked = dg.check_path(machine, dg.pick_and_place(pick, place, 25.0, 3.0))
        except dg.PathError:
            continue
        done += 1
        points = checked.curve.position(np.linspace(0.0, checked.curve.end, 8001))
        carriages = dg.inverse(machine.geometry, points)
        margins = dg.margins(machine.geometry, points)
        for family, values in {
            "order": carriages[:, 1] - carriages[:, 0],
            "clearance": dg.clearance(machine.geometry, points),
            "strut": margins.strut,
            "legs_flat": margins.legs_flat,
        }.items():
            assert checked.report[family].margin <= values.min()
