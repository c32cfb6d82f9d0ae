from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.kinematics.headroom.room import locate, room
from duoglide.motion.path.transfer import TransferPath
from duoglide.planning.transfer.transfer import transfer_carriages

MACHINE = dg.Machine.default()
A, B = (-80.0, -100.0, 300.0), (40.0, 100.0, 290.0)


def admissible(machine: dg.Machine, rng: np.random.Generator) -> np.ndarray:
    """Draw a position at which the machine may stand."""
    g = machine.geometry
    middle = np.array([0.0, 0.0, g.carriage_height + 0.6 * g.strut_length])
    spread = np.array([g.arm_length, 0.7 * g.rail_half_length, 0.6 * g.strut_length])
    for _ in range(20_000):
        position = middle + spread * rng.uniform(-1.0, 1.0, 3)
        if dg.reachable(g, position):
            carriages = dg.inverse(g, position)[None]
            same = np.allclose(locate(machine, carriages)[0], position, atol=1e-6)
            if same and room(machine, carriages).least()[0] > 1e-3:
                return position
    pytest.skip("this geometry leaves hardly any room")


def require_sound(trajectory: dg.Trajectory, start: np.ndarray, goal: np.ndarray) -> None:
    machine = trajectory.machine
    times = np.linspace(0.0, trajectory.duration, 2001)
    state = trajectory.at(times)
    for values, limit in (
        (state.velocity, machine.limits.velocity),
        (state.acceleration, machine.limits.acceleration),
        (state.jerk, machine.limits.jerk),
    ):
        assert np.all(np.abs(values) <= limit * (1 + 1e-4))
    assert trajectory.starts_at_rest
    assert trajectory.ends_at_rest
    positions = trajectory.position_at(times)
    np.testing.assert_allclose(positions[[0, -1]], [start, goal], atol=1e-6)
    np.testing.assert_allclose(dg.inverse(machine.geometry, positions), state.carriages, atol=1e-6)
    assert dg.clearance(machine.geometry, positions).min() > machine.clearance
    assert np.abs(state.carriages).max() < machine.geometry.rail_half_length
    assert np.diff(state.carriages[:, :2]).min() > machine.carriage_width


def test_a_transfer_takes_as_long_as_the_slowest_carriage_needs() -> None:
    start, goal = np.array([-41.0, -152.5, 300.0]), np.array([-41.0, 152.5, 300.0])
    trajectory = dg.transfer(MACHINE, start, goal, brake_safe=False)
    assert trajectory.duration == pytest.approx(0.16399, abs=1e-5)  # ruckig, 305 mm
    assert trajectory.audit().worst <= 1.0005


@settings(max_examples=12, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_transfers_on_any_machine_keep_every_limit_and_all_room(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table = MACHINE.to_dict()["geometry"]
    scaled = {name: value * rng.uniform(0.92, 1.08) for name, value in table.items()}
    limits = dg.CarriageLimits(
        velocity=10 ** rng.uniform(2, 4, 3),
        acceleration=10 ** rng.uniform(3, 5, 3),
        jerk=10 ** rng.uniform(5, 7, 3),
    )
    machine = dg.Machine(geometry=dg.Geometry(**scaled), limits=limits)
    start, goal = admissible(machine, rng), admissible(machine, rng)
    require_sound(dg.transfer(machine, start, goal, brake_safe=False), start, goal)


def test_a_saved_transfer_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    trajectory = dg.transfer(MACHINE, A, B)
    trajectory.save(tmp_path / "plan.mcap")
    again = dg.Trajectory.load(tmp_path / "plan.mcap")
    times = np.linspace(0.0, trajectory.duration, 500)
    for name in ("carriages", "velocity", "acceleration", "jerk"):
        np.testing.assert_array_equal(
            getattr(again.at(times), name), getattr(trajectory.at(times), name)
        )
    assert again.stops == trajectory.stops
    assert again.to_document() == trajectory.to_document()


def test_to_stay_is_a_motion_of_one_cycle() -> None:
    trajectory = dg.transfer(MACHINE, A, A)
    assert trajectory.duration == MACHINE.drives.cycle
    np.testing.assert_allclose(trajectory.position_at([0.0, 1.0]), [A, A], atol=1e-9)
    assert trajectory.audit().worst == 0.0


@pytest.mark.parametrize("step", [1e-8, 1e-6, 1e-3])
def test_tiny_transfers_arrive(step: float) -> None:
    goal = np.add(A, (0.0, step, 0.0))
    trajectory = dg.transfer(MACHINE, A, goal)
    assert 0.0 < trajectory.duration < 0.01
    np.testing.assert_allclose(trajectory.position_at(1.0), goal, atol=1e-9)


def test_an_end_that_is_not_admissible_is_refused_by_name() -> None:
    with pytest.raises(dg.PathError, match=r"goal.*arm is 275 mm too short"):
        dg.transfer(MACHINE, A, (500.0, 0.0, 300.0))
    with pytest.raises(dg.PathError, match=r"start.*clearance is 1\.") as caught:
        dg.transfer(MACHINE, (0.0, 0.0, 244.9), A)
    with pytest.raises(dg.PathError, match="beyond a singularity"):
        dg.transfer(MACHINE, A, (200.0, 0.0, 150.0))
    assert caught.value.quantity == "clearance"
    with pytest.raises(dg.PathError, match="travel"):
        dg.transfer(MACHINE, A, (-41.0, 200.0, 300.0))
    with pytest.raises(dg.InputError, match="start"):
        dg.transfer(MACHINE, (0.0, 0.0), A)  # type: ignore[arg-type]
    with pytest.raises(dg.InputError, match="finite"):
        dg.transfer(MACHINE, A, (0.0, float("nan"), 300.0))


def test_a_box_in_the_way_is_gone_round_or_named() -> None:
    wall = dg.Box(low=(-300, -5, 0), high=(300, 5, 500), name="wall")
    with pytest.raises(dg.PathError, match="no safe transfer") as caught:
        dg.transfer(replace(MACHINE, keep_out=(wall,)), A, B)
    for way in ("through carriage space", "straight"):
        assert way in str(caught.value)
    assert caught.value.quantity == "keep_out"


def test_a_box_in_the_way_of_the_carriages_leaves_the_straight_line() -> None:
    goal = (60.0, -100.0, 300.0)
    direct = dg.transfer(MACHINE, A, goal, brake_safe=False)
    middle = direct.position_at(0.5 * direct.duration)
    line = np.array([middle[0], -100.0, 300.0])
    assert np.linalg.norm(middle - line) > 0.5  # the carriages' way bows off the line
    away = (middle - line) / np.linalg.norm(middle - line)
    centre = middle + 0.25 * away
    half = 0.4 * np.abs(middle - line).max()
    box = dg.Box(low=tuple(centre - half), high=tuple(centre + half), name="post")
    machine = replace(MACHINE, keep_out=(box,))
    trajectory = dg.transfer(machine, A, goal)
    assert not isinstance(trajectory.path, TransferPath)


def test_the_room_in_carriage_space_is_that_of_the_platform() -> None:
    rng = np.random.default_rng(2)
    g = MACHINE.geometry
    positions = np.array([admissible(MACHINE, rng) for _ in range(50)])
    carriages = dg.inverse(g, positions)
    found, closed = locate(MACHINE, carriages)
    assert closed.all()
    np.testing.assert_allclose(found, positions, atol=1e-8)
    np.testing.assert_allclose(
        room(MACHINE, carriages).clearance, dg.clearance(g, positions) - 2.0, atol=1e-5
    )


def test_carriages_whose_links_do_not_close_have_no_room() -> None:
    carriages = np.array([[-300.0, 300.0, 0.0], [0.0, 0.0, 0.0], [-100.0, 100.0, -200.0]])
    _, closed = locate(MACHINE, carriages)
    assert not closed.any()
    assert np.all(room(MACHINE, carriages).least() == -np.inf)


def test_one_carriage_can_be_moved_by_itself() -> None:
    start = dg.inverse(MACHINE.geometry, (-41.0, 0.0, 302.0))
    trajectory = transfer_carriages(MACHINE, start, np.add(start, (0.0, 1.0, 0.0)))
    np.testing.assert_allclose(trajectory.end - start, [0.0, 1.0, 0.0], atol=1e-9)
    with pytest.raises(dg.PathError, match="crosses a singularity"):
        transfer_carriages(MACHINE, start, np.add(start, (0.0, 0.0, 200.0)))


def test_a_transfer_that_braking_slows_accelerates_as_before() -> None:
    """Along the rails nothing but the speed counts; stretched in time it would take 0.208 s."""
    ends = (-41.0, -150.0, 302.0), (-41.0, 150.0, 302.0)
    draft = dg.transfer(MACHINE, *ends, brake_safe=False)
    safe = dg.transfer(MACHINE, *ends)
    assert safe.report.brake_safe
    assert draft.duration < safe.duration < 0.175
    accelerations = (np.abs(m.sample(1e-4)[1].acceleration).max() for m in (draft, safe))
    assert next(accelerations) == pytest.approx(next(accelerations), rel=0.02)
