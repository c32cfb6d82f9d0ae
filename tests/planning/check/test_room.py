"""One answer to how much room there is: by carriages, by positions, and by the check's rules."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

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


@pytest.mark.parametrize("seed", [1012, 1024, 1109, 1113, 5003])
def test_the_least_carriage_margin_that_is_told_is_the_one_that_decides(seed: int) -> None:
    """In the first four it is where the curve changes its bend, or where two surfaces change."""
    rng = np.random.default_rng(seed)
    geometry = {
        k: v * rng.uniform(0.93, 1.07) for k, v in dg.Machine().to_dict()["geometry"].items()
    }
    geometry |= {k: rng.uniform(-25.0, 25.0) for k in ("riser_height", "arm_drop", "strut_drop")}
    g = dg.Geometry(**geometry)
    clearance = float(rng.choice([0.1, 2.0]))
    machine = dg.Machine(geometry=g, carriage_margin=0.0, clearance=clearance)
    middle = np.array([0.0, 0.0, g.carriage_height + 0.75 * g.strut_length])
    spread = np.array([0.6 * g.arm_length, 60.0, 0.25 * g.strut_length])
    points = middle + rng.uniform(-1.0, 1.0, (4, 3)) * spread
    path = dg.Path.polyline(points, tolerance=float(rng.choice([0.0, 4.0, 15.0])))
    checked = dg.check_path(machine, path)
    told = checked.report["carriage_margin"].margin
    dense = checked.curve.position(np.linspace(0.0, checked.curve.end, 20_001))
    assert told <= dg.carriage_margin(g, dense).min() + 1e-6
    dg.check_path(replace(machine, carriage_margin=told - 1e-5), path)
    with pytest.raises(dg.PathError, match="carriage margin"):
        dg.check_path(replace(machine, carriage_margin=told + 1e-5), path)
