"""One answer to how much room there is: by carriages, by positions, and by the check's rules."""

from __future__ import annotations

import numpy as np

import duoglide as dg
from duoglide.kinematics.headroom.room import room, room_at
from duoglide.motion.path.rounded import round_corners
from duoglide.planning.check.judge import judge_points
from duoglide.planning.check.rules import Rules

BOX = dg.Box(low=(-200.0, -40.0, 200.0), high=(-60.0, 40.0, 290.0))
MACHINE = dg.Machine(keep_out=(BOX,), carriage_width=380.0)
POSITIONS = np.random.default_rng(5).uniform([-120, -320, 180], [120, 320, 420], (4000, 3))


def test_carriages_and_their_positions_have_the_same_room() -> None:
    reached = POSITIONS[room_at(MACHINE, POSITIONS).clearance > -1e6]
    here = room_at(MACHINE, reached)
    there = room(MACHINE, dg.inverse(MACHINE.geometry, reached))
    assert len(reached) > 500
    for name in ("clearance", "travel", "order", "keep_out"):
        values = getattr(here, name)
        assert (values > 0.0).any() and (values < 0.0).any(), name
        np.testing.assert_allclose(getattr(there, name), values, atol=2e-6)


def test_the_check_judges_points_by_the_same_room() -> None:
    curve = round_corners(dg.Path.line((-41, -50, 300), (-41, 50, 300))).curve
    here = room_at(MACHINE, POSITIONS)
    judged = judge_points(Rules.of(MACHINE, curve), POSITIONS)
    reached = np.isfinite(here.clearance)  # in the machine's own assembly mode
    assert reached.sum() > 500
    rows = judged[reached]
    np.testing.assert_allclose(rows[:, 0], here.clearance[reached], atol=1e-9)
    np.testing.assert_allclose(rows[:, 1], here.carriage_margin[reached], atol=1e-9)
    np.testing.assert_allclose(rows[:, 2:5].min(axis=1), here.travel[reached], atol=1e-9)
    np.testing.assert_allclose(rows[:, 5], here.order[reached], atol=1e-9)
    np.testing.assert_allclose(rows[:, 6], here.keep_out[reached], atol=1e-9)
