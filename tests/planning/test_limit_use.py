from __future__ import annotations

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics.derivatives import root_bounds, root_jet_bounds
from duoglide.motion.motion import Motion
from duoglide.motion.profile import Profile
from duoglide.planning.limit_use import ALLOWED, NAMES, measure_uses, require_limits

RNG = np.random.default_rng(5)


@pytest.fixture(scope="module")
def pick() -> dg.Trajectory:
    machine = dg.Machine.default()
    return dg.plan(machine, dg.pick_and_place((-41, -40, 295), (-41, 40, 295)), brake_safe=False)


def sampled(motion: Motion) -> np.ndarray:
    """Return the largest use at 300 instants of every piece, (3, 3)."""
    knots = motion.profile.knots[:, 0]
    state = motion.at((knots[:-1, None] + np.diff(knots)[:, None] * np.linspace(0, 1, 300)).ravel())
    rows = (state.velocity, state.acceleration, state.jerk)
    limits = motion.machine.limits
    return np.stack(
        [
            np.abs(row / getattr(limits, name)).max(axis=0)
            for row, name in zip(rows, NAMES, strict=True)
        ]
    )


def test_what_the_planner_makes_is_within_the_limits_for_certain(pick: dg.Trajectory) -> None:
    uses = require_limits(pick, pick.machine.limits)
    assert uses.sure.max() <= ALLOWED
    assert sampled(pick) == pytest.approx(uses.seen, abs=2e-3)


def test_no_sample_exceeds_what_is_certain(pick: dg.Trajectory) -> None:
    judged = 0
    for _ in range(25):
        knots = pick.profile.knots.copy()
        row, column = RNG.integers(1, len(knots) - 1), RNG.integers(0, 4)
        knots[row, column] *= 1.0 + RNG.normal() * 10.0 ** RNG.uniform(-9.0, -2.0)
        try:
            motion = Motion(pick.path, Profile(knots))
            uses = measure_uses(motion, pick.machine.limits)
        except dg.DuoglideError:  # backwards
            continue
        judged += 1
        assert (sampled(motion) <= uses.sure * (1.0 + 1e-9) + 1e-12).all()
    assert judged > 8


@pytest.mark.parametrize("seconds", [1e-3, 1e-6, 1e-8])
def test_a_jump_is_seen_however_short_it_is(pick: dg.Trajectory, seconds: float) -> None:
    knots = pick.profile.knots
    k = len(knots) // 2
    later = np.array([knots[k, 0] + seconds - knots[k + 3, 0], 0.0, 0.0, 0.0])
    jump = Profile(np.concatenate([knots[: k + 1], knots[k + 3 :] + later]))
    with pytest.raises(dg.DuoglideError, match=r"would need|backwards"):
        require_limits(Motion(pick.path, jump), pick.machine.limits)


def test_a_profile_keeps_to_its_curve(pick: dg.Trajectory) -> None:
    longer = Profile(pick.profile.knots * np.array([1.0, 1.01, 1.01, 1.01]))
    with pytest.raises(dg.PathError, match=r"leaves its curve by \d"):
        measure_uses(Motion(pick.path, longer), pick.machine.limits)


def test_bounds_of_a_root_to_any_order_are_those_to_the_third() -> None:
    low, a, b = RNG.uniform(5.0, 9.0), RNG.uniform(1.0, 3.0, 4), RNG.uniform(1.0, 3.0, 4)
    columns = [[np.array([value]) for value in side] for side in (a, b)]
    found = root_jet_bounds(np.array([low]), *columns)
    assert [float(v[0]) for v in found[1:]] == pytest.approx(
        root_bounds(low, (a[0], b[0]), tuple(a[1:]), tuple(b[1:]))
    )
