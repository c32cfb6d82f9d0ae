from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics import _batch, nearest
from duoglide.kinematics.nearest import nearest_surface
from duoglide.kinematics.singularity import FAMILIES
from duoglide.motion.curve import Curve
from duoglide.motion.rounded_path import round_corners
from duoglide.planning import _check_kernel, check_judge, check_least
from duoglide.planning.check_rules import Rules
from duoglide.planning.check_search import first_failure, first_intervals

BOXES = (
    dg.Box(low=(-60.0, -20.0, 240.0), high=(-20.0, 20.0, 270.0), name="camera"),
    dg.Box(low=(100.0, 0.0, 300.0), high=(140.0, 40.0, 340.0), name="feeder"),
)


@pytest.fixture
def in_numpy(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Whoever asks whether compiled loops pay hears that they do not."""
    for module in (check_judge, check_least):
        monkeypatch.setattr(module, "kernel_pays", lambda: False)
    monkeypatch.setattr(nearest, "nearest_loop_pays", lambda: False)
    return monkeypatch


def random_machine(rng: np.random.Generator) -> dg.Machine:
    geometry = dg.Geometry(
        rail_half_spacing=rng.uniform(60, 120),
        platform_half_width=rng.choice([60.0, rng.uniform(20, 60)]),
        carriage_height=rng.uniform(30, 90),
        leg_length=rng.uniform(120, 200),
        coupler_length=rng.uniform(90, 150),
        riser_height=rng.uniform(-20, 20),
        arm_length=rng.uniform(140, 220),
        arm_drop=rng.uniform(-20, 20),
        strut_drop=rng.uniform(-20, 20),
        strut_length=rng.uniform(250, 350),
    )
    boxes = BOXES[: rng.integers(0, 3)]
    return dg.Machine(geometry=geometry, clearance=rng.choice([0.0, 2.0, 40.0]), keep_out=boxes)


def random_curve(rng: np.random.Generator, geometry: dg.Geometry) -> Curve:
    """A curve about anywhere: most are partly out of reach."""
    middle = geometry.rail_half_spacing - geometry.platform_half_width
    centre = [middle + rng.uniform(-1, 1) * geometry.arm_length, 0.0, rng.uniform(60, 480)]
    points = np.array(centre) + rng.normal(size=(4, 3)) * rng.uniform(0.1, 100.0)
    paths = (
        lambda: dg.Path.polyline(points, tolerance=3.0),
        lambda: dg.Path.through(points),
        lambda: dg.Path.arc(*points[:3]),
    )
    return round_corners(paths[rng.integers(3)]()).curve


def assert_same(one: np.ndarray, other: np.ndarray) -> None:
    """Tell apart what is out of reach or bounded by nothing, and what is not."""
    np.testing.assert_array_equal(np.isfinite(one), np.isfinite(other))
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("seed", range(25))
def test_compiled_loops_judge_intervals_as_numpy_does(
    in_numpy: pytest.MonkeyPatch, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    machine = random_machine(rng)
    rules = Rules.of(machine, random_curve(rng, machine.geometry))
    intervals = first_intervals(rules).split(int(rng.integers(1, 20)))
    expected, found = check_judge.judge(rules, intervals), _check_kernel.judge(rules, intervals)
    assert_same(found.margins, expected.margins)
    assert_same(found.lowest, expected.lowest)


@pytest.mark.parametrize("seed", range(25))
def test_compiled_loops_measure_poses_as_numpy_does(
    in_numpy: pytest.MonkeyPatch, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    machine = random_machine(rng)
    curve = random_curve(rng, machine.geometry)
    rules = Rules.of(machine, curve)
    points = curve.position(np.linspace(0.0, curve.end, 400))
    found = _check_kernel.measure(rules, points)
    rest = found.shape[1] - len(FAMILIES)
    assert_same(found[:, :rest], check_judge.judge_points(rules, points))
    inside = np.isfinite(found[:, 0])
    margins = dg.margins(machine.geometry, points[inside]).by_family()
    sides = np.stack([np.abs(margins[name]) for name in FAMILIES], axis=1)
    np.testing.assert_allclose(found[inside, rest:], sides, rtol=0, atol=1e-10)
    many = nearest_surface(machine.geometry, 1, points[inside])
    in_numpy.setattr(nearest, "nearest_loop_pays", lambda: True)
    loops = nearest_surface(machine.geometry, 1, points[inside])
    in_numpy.setattr(nearest, "nearest_loop_pays", lambda: False)
    np.testing.assert_allclose(loops.distance, many.distance, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("room", "expected"), [(1e-6, True), (8e-8, False), (-1e-6, False)])
@pytest.mark.parametrize("compiled", [False, True], ids=["numpy", "compiled"])
def test_both_decide_what_grazes_a_rule_alike(
    in_numpy: pytest.MonkeyPatch, compiled: bool, room: float, expected: bool
) -> None:
    """Lines that touch legs flat between their ends, a box, and the end of a rail."""
    for module in (check_judge, check_least):
        in_numpy.setattr(module, "kernel_pays", lambda: compiled)
    free = dg.Machine(geometry=dg.Geometry(rail_half_length=9000.0), clearance=0.0)
    outward = np.array([np.sin(-0.4), 0.0, np.cos(-0.4)])  # from legs flat, a circle about the arm
    touch = np.array([45.0, 0.0, 70.0]) + (180.0 + room) * outward
    along = 10.0 * np.array([outward[2], 0.3, -outward[0]])
    lid = dg.Box(low=(-99.0, -99.0, 320.0 + room), high=(99.0, 99.0, 400.0))
    reach = np.abs(dg.inverse(dg.Geometry(), np.array([-41.0, 99.0, 300.0]))).max()
    short = replace(free.geometry, rail_half_length=float(reach) + room)
    cases = (
        (free, dg.Path.line(touch - along, touch + along)),
        (replace(free, keep_out=(lid,)), dg.Path.line((-41, 0, 300), (-41, 0, 320))),
        (replace(free, geometry=short), dg.Path.line((-41, 0, 300), (-41, 99, 300))),
    )
    for machine, path in cases:
        rules = Rules.of(machine, round_corners(path).curve)
        assert (first_failure(rules) == np.inf) is expected


def test_a_report_is_the_same_whoever_measures(in_numpy: pytest.MonkeyPatch) -> None:
    machine = dg.Machine(keep_out=BOXES)
    path = dg.pick_and_place((-41, -152.5, 295), (-41, 152.5, 295), tolerance=2.0)
    one = dg.check_path(machine, path).report
    for module in (check_judge, check_least):
        in_numpy.setattr(module, "kernel_pays", lambda: True)
    other = dg.check_path(machine, path).report
    assert [entry.family for entry in one.least] == [entry.family for entry in other.least]
    first, second = ([entry.margin for entry in report.least] for report in (one, other))
    np.testing.assert_allclose(first, second, rtol=0, atol=1e-9)


@pytest.mark.parametrize("ready", [False, True])
def test_compiled_loops_take_over_after_a_few_paths_or_once_compiling_pays(
    monkeypatch: pytest.MonkeyPatch, ready: bool
) -> None:
    enough = check_judge.WORTH_LOADING if ready else check_judge.WORTH_COMPILING
    monkeypatch.setattr(check_judge._Checked, "curves", 0)
    monkeypatch.setattr(check_judge._Checked, "enough", None)
    monkeypatch.setattr(_check_kernel, "ready", lambda: ready)
    path = dg.Path.line((-41, 0, 300), (-41, 9, 300))
    answers = []
    for _ in range(enough + 2):
        dg.check_path(dg.Machine.default(), path)
        answers.append(check_judge.kernel_pays())
    assert answers == [False] * enough + [True] * 2


@pytest.mark.parametrize("ready", [False, True])
def test_the_nearest_surface_is_found_compiled_when_it_is_asked_for_often(
    monkeypatch: pytest.MonkeyPatch, ready: bool
) -> None:
    asked = []

    def loop(*given: Any) -> None:
        asked.append(given)
        _batch.nearest_many(*given)

    enough = _batch.WORTH_ASKING if ready else _batch.WORTH_COMPILING
    monkeypatch.setattr(_batch._Answered, "nearest", 0)
    monkeypatch.setattr(_batch._Answered, "enough", None)
    monkeypatch.setattr(_batch, "kept", lambda loop: ready)
    monkeypatch.setattr(nearest, "nearest_many", loop)
    pose = np.array([[-41.0, 0.0, 300.0]])
    found = [nearest_surface(dg.Geometry(), 1, pose).distance[0] for _ in range(enough + 2)]
    assert len(asked) == 2
    assert np.ptp(found) < 1e-10
