"""The bounds that braking and transfers are certified with, against brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import ruckig
from drive_stops import random_stops
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.kinematics.headroom.nearby import Patch, swing_of
from duoglide.kinematics.headroom.room import locate, room
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import Profile
from duoglide.motion.stop_bounds import StopBounds
from duoglide.planning.braking.certificate import brake_report
from duoglide.planning.transfer.certificate import keeps
from duoglide.planning.transfer.rest_to_rest import plan_rest_to_rest

TABLE = dg.Machine.default().to_dict()["geometry"]
ROUNDING = 2e-6  # mm, within which a clearance is known
FAST = dg.transfer(dg.Machine.default(), (-80, -100, 300), (40, 100, 290), brake_safe=False)
SEEDS = st.integers(0, 2**32 - 1)


def random_machine(rng: np.random.Generator) -> dg.Machine:
    """Draw dimensions, decelerations, and perhaps a box."""
    scaled = {name: value * rng.uniform(0.9, 1.1) for name, value in TABLE.items()}
    scaled |= {name: rng.uniform(-10, 10) for name in ("riser_height", "arm_drop", "strut_drop")}
    same = bool(rng.integers(2))
    deceleration = (6e4,) * 3 if same else tuple(rng.uniform(2e4, 1.2e5, 3).tolist())
    margin = float(rng.choice([0.0, 1.0, 4.0]))
    machine = dg.Machine(geometry=dg.Geometry(**scaled), carriage_margin=margin)
    drives = replace(machine.drives, quick_stop_deceleration=deceleration)
    box = dg.Box(low=(-30, -30, 200), high=(-10, 10, 230))
    return replace(machine, drives=drives, keep_out=(box,) if rng.integers(2) else ())


def random_motion(machine: dg.Machine, rng: np.random.Generator) -> dg.Trajectory:
    """Plan one without regard to braking: a transfer, a line, or a pick."""
    low, high = [-90.0, -120.0, 275.0], [90.0, 120.0, 315.0]
    for _ in range(50):
        start, goal, kind = rng.uniform(low, high), rng.uniform(low, high), rng.integers(3)
        try:
            if kind == 0:
                return dg.transfer(machine, start, goal, brake_safe=False)
            if kind == 1:
                return dg.plan(machine, dg.Path.line(start, goal), brake_safe=False)
            path = dg.pick_and_place(start, goal, lift=15.0, tolerance=3.0)
            return dg.plan(machine, path, brake_safe=False)
        except dg.DuoglideError:
            continue
    pytest.skip("this geometry leaves hardly any room")


@settings(max_examples=8, deadline=None, derandomize=True)
@given(SEEDS)
def test_brute_force_finds_no_less_than_the_report(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = random_motion(random_machine(rng), rng)
    report = brake_report(motion)
    carriages = random_stops(motion, 300, rng).at(motion, np.linspace(0.0, 1.0, 40))
    found = room(motion.machine, carriages)
    assert report.room <= found.least().min() + ROUNDING
    assert report.clearance <= float(found.clearance.min()) + motion.machine.clearance + ROUNDING
    assert report.safe == (len(report.unsafe) == 0)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(SEEDS)
def test_a_transfer_is_certain_to_keep_what_it_reports(seed: int) -> None:
    rng = np.random.default_rng(seed)
    machine = random_machine(rng)
    low, high = [-90.0, -120.0, 275.0], [90.0, 120.0, 315.0]
    try:
        motion = dg.transfer(machine, rng.uniform(low, high), rng.uniform(low, high))
    except dg.PathError:
        return
    positions = motion.position_at(np.linspace(0.0, motion.duration, 5001))
    least = float(dg.clearance(machine.geometry, positions).min())
    assert motion.path.least_clearance <= least + ROUNDING
    assert motion.path.least_clearance >= least - 2e-3


@settings(max_examples=20, deadline=None, derandomize=True)
@given(SEEDS)
def test_a_straight_way_of_the_carriages_keeps_what_dense_samples_show_and_no_more(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    machine = random_machine(rng)
    poses = rng.uniform((-90.0, -120.0, 275.0), (90.0, 120.0, 315.0), (2, 3))
    if not dg.reachable(machine.geometry, poses).all():
        return
    start, end = dg.inverse(machine.geometry, poses)
    shares = np.linspace(0.0, 1.0, 20_001)[:, None]
    found = room(machine, start + shares * (end - start))
    clear, free = float(found.clearance.min()), float(found.keep_out.min())
    if clear == -np.inf:
        assert not keeps(machine, start, end, (-1.0, -np.inf, -np.inf))
        return
    assert keeps(machine, start, end, (clear - 1e-4, min(free, 1e9) - 1e-4, -np.inf))
    assert not keeps(machine, start, end, (clear + 1e-5, -np.inf, -np.inf))
    if machine.keep_out:
        assert not keeps(machine, start, end, (-np.inf, free + 1e-5, -np.inf))


def test_the_way_of_the_platform_is_bounded_about_any_pose() -> None:
    rng = np.random.default_rng(3)
    machine = dg.Machine.default()
    poses = rng.uniform((-130.0, 0.0, 90.0), (200.0, 0.0, 365.0), (4000, 3))
    middle = dg.inverse(machine.geometry, poses[dg.reachable(machine.geometry, poses)])
    middle = middle[locate(machine, middle)[1]]
    position = locate(machine, middle)[0]
    size = 10.0 ** rng.uniform(-2.0, 1.5, (len(middle), 1))
    beyond = np.zeros((len(middle), 5))
    beyond[:, 3:] = size * rng.uniform(0.1, 1.0, (len(middle), 2))
    _, off, farthest = swing_of(
        machine, Patch(middle, np.zeros((len(middle), 0, 3)), beyond), position
    )
    bound = np.minimum(off, farthest)
    known = np.isfinite(bound)
    assert known.sum() > 500
    inside = bound < room(machine, middle).clearance + machine.clearance
    most = np.zeros(len(middle))
    corners = [[i, j] for i in (-1.0, 1.0) for j in (-1.0, 1.0)]
    for dB, dD in np.concatenate([rng.uniform(-1.0, 1.0, (200, 2)), corners]):
        far_B, far_D = dB * beyond[:, 3], dD * beyond[:, 4]
        found, closed = locate(machine, middle + np.stack([-0.5 * far_B, 0.5 * far_B, far_D], -1))
        assert closed[inside].all()
        most = np.fmax(most, np.linalg.norm((found - position)[:, ::2], axis=-1))
    assert np.all(most[known] <= bound[known] * (1.0 + 1e-9) + 1e-9)
    near = known & (size[:, 0] < 0.1)
    assert np.median(most[near] / bound[near]) > 0.7


def test_a_dart_between_two_samples_is_seen() -> None:
    """Forth and back by 1 mm in 2 ms; where cells of 4 ms have middles and ends, nothing moves."""
    machine = dg.Machine.default()
    start = dg.inverse(machine.geometry, (-41.0, 0.0, 302.0))
    goal = start + np.array([-0.5, 0.5, 0.0])
    limits = dg.CarriageLimits(velocity=1e4, acceleration=1e7, jerk=1e11)
    breaks, there = plan_rest_to_rest(start, goal, limits, ruckig.Synchronization.Phase)
    _, back = plan_rest_to_rest(goal, start, limits, ruckig.Synchronization.Phase)
    still = np.zeros((1, 4, 3))
    still[0, 0] = start
    leave, arrive = 0.0121, 0.0121 + 2.0 * breaks[-1]
    assert arrive < 0.0139
    times = np.concatenate([[0.0], leave + breaks, leave + breaks[-1] + breaks[1:], [0.032]])
    path = TransferPath(machine, times, np.concatenate([still, there, back, still]), 60.0)
    profile = Profile(np.array([[0.0, 0.0, 1.0, 0.0], [0.032, 0.032, 1.0, 0.0]]))
    motion = dg.Trajectory(path, profile, StopBounds.constant(0.032, 1.0, 1.0))
    samples = motion.at(np.linspace(0.0, 0.032, 17))
    assert not samples.velocity.any()
    report = brake_report(motion)
    assert leave - 0.02 < report.time < arrive
    stops = random_stops(motion, 2000, np.random.default_rng(1))
    found = room(machine, stops.at(motion, np.linspace(0.0, 1.0, 9)))
    assert report.clearance <= found.clearance.min() + machine.clearance < 60.0
