from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.arrays import FloatArray
from duoglide.motion.path.rounded import round_corners
from duoglide.motion.rounding.blend import Blend
from duoglide.planning.rounding.choice import choose_blends
from duoglide.planning.timing import interior_point

PICK, PLACE = (-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0)


@pytest.mark.parametrize("tolerance", [0.5, 2.0, 4.0, 8.0, 15.0])
def test_chosen_blends_keep_the_tolerance(machine: dg.Machine, tolerance: float) -> None:
    rounded = choose_blends(machine, dg.pick_and_place(PICK, PLACE, 25.0, tolerance))
    assert all(isinstance(corner, Blend) for corner in rounded.path.corners)
    deviation = rounded.deviation
    assert deviation.max() <= tolerance
    assert deviation[1] > 0.9 * tolerance or tolerance > 8.0  # there the lift is too short for more


def test_chosen_blends_are_quicker_than_the_checks_own(machine: dg.Machine) -> None:
    path = dg.pick_and_place(PICK, PLACE, 25.0, 2.0)
    own = [round_corners(path).blend(i) for i in range(2)]
    fixed = dg.Path.polyline(path.waypoints, blends=own)  # type: ignore[arg-type]
    chosen = dg.plan(machine, path, brake_safe=False).duration
    assert chosen < 0.985 * dg.plan(machine, fixed, brake_safe=False).duration


def test_explicit_blends_sharp_corners_and_rests_stay(machine: dg.Machine) -> None:
    given = Blend(12.0, 17.0, 0.4)
    path = dg.pick_and_place(PICK, PLACE, 25.0, given)
    assert choose_blends(machine, path).path.corners == path.corners
    back = dg.Path.polyline([(-41, -100, 300), (-41, 100, 300), (-41, -50, 300)], 2.0)
    assert choose_blends(machine, back).path == back
    exact = dg.pick_and_place(PICK, PLACE, 25.0, 0.0)
    assert choose_blends(machine, exact).path == exact


def test_a_path_out_of_reach_is_left_to_the_check(machine: dg.Machine) -> None:
    with pytest.raises(dg.PathError):
        dg.plan(machine, dg.pick_and_place((-41, -152.5, 350), (-41, 152.5, 350), 60.0, 4.0))


def test_neighbouring_blends_share_their_segment(machine: dg.Machine) -> None:
    zigzag = [(-41 + 6 * (k % 2), -50 + 5 * k, 300) for k in range(4)]
    path = choose_blends(machine, dg.Path.polyline(zigzag, 5.0)).path
    lengths = np.linalg.norm(np.diff(np.array(zigzag, dtype=float), axis=0), axis=1)
    for k in range(len(path.corners) - 1):
        one, other = path.corners[k], path.corners[k + 1]
        assert isinstance(one, Blend)
        assert isinstance(other, Blend)
        assert one.after + other.before <= lengths[k + 1] + 1e-12
    dg.check_path(machine, path)


def test_every_estimate_of_a_choice_converges_at_once_and_soon(
    machine: dg.Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = interior_point.solve
    steps: list[int] = []

    def watched(rows: Any, goal: Any, x: FloatArray, *how: float) -> tuple[int, bool]:
        count, converged = solve(rows, goal, x, *how)
        assert converged
        steps.append(count)
        return count, converged

    monkeypatch.setattr(interior_point, "solve", watched)
    for y in (40.0, 100.0, 140.0):
        choose_blends(machine, dg.pick_and_place((-80, -y, 290), (20, 0.6 * y, 290), lift=25))
    assert np.mean(steps) < 10.0
    assert max(steps) < 30  # 45 where one place within its limits slows all of a beginning
