from __future__ import annotations

from itertools import count, islice

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.actions import Dwell, SetOutput
from duoglide.motion.path.rounded import round_corners
from duoglide.motion.rounding.blend import Blend
from duoglide.planning.programs.pick_and_place import chain, picks

PICK, PLACE = (-41.0, -100.0, 295.0), (-41.0, 100.0, 290.0)


def track_of(path: dg.Path) -> np.ndarray:
    curve = round_corners(path).curve
    return curve.position(np.linspace(0.0, curve.end, 4001))


def test_it_goes_up_to_lift_over_the_higher_end_across_and_down() -> None:
    path = dg.pick_and_place(PICK, PLACE, lift=25.0, tolerance=2.0)
    assert path.waypoints == (PICK, (-41, -100, 320), (-41, 100, 320), PLACE)
    assert track_of(path)[:, 2].max() == pytest.approx(320.0)


def test_depart_and_approach_stay_vertical_whatever_the_tolerance() -> None:
    track = track_of(dg.pick_and_place(PICK, PLACE, tolerance=15.0, depart=8.0, approach=12.0))
    np.testing.assert_allclose(track[(track[:, 2] < 303.0) & (track[:, 1] < 0)][:, 1], -100.0)
    np.testing.assert_allclose(track[(track[:, 2] < 302.0) & (track[:, 1] > 0)][:, 1], 100.0)
    free = track_of(dg.pick_and_place(PICK, PLACE, tolerance=15.0))
    assert free[free[:, 2] < 303.0][:, 1].std() != pytest.approx(100.0)


def test_an_explicit_blend_has_its_first_cut_back_on_both_verticals() -> None:
    rounded = round_corners(dg.pick_and_place(PICK, PLACE, tolerance=Blend(12.0, 30.0)))
    np.testing.assert_allclose(rounded.before[1:3], (12.0, 30.0))
    np.testing.assert_allclose(rounded.after[1:3], (30.0, 12.0))


def test_dwell_and_actions_come_in_order_at_both_ends() -> None:
    grip, drop = SetOutput(1, 16, True), SetOutput(1, 16, False)
    path = dg.pick_and_place(PICK, PLACE, dwell=0.05, at_pick=[grip], at_place=[drop])
    assert path.actions == ((0, grip), (0, Dwell(0.05)), (3, drop), (3, Dwell(0.05)))


def test_degenerate_moves_are_right_or_refused() -> None:
    straight = dg.pick_and_place(PICK, (-41, 100, 295), lift=0.0)
    assert straight.waypoints == (PICK, (-41, 100, 295))
    up_and_down = dg.pick_and_place(PICK, PICK, lift=10.0)
    assert len(round_corners(up_and_down).curve.rests) == 1
    with pytest.raises(dg.InputError, match="same point"):
        dg.pick_and_place(PICK, PICK, lift=0.0)
    with pytest.raises(dg.InputError, match="lift"):
        dg.pick_and_place(PICK, PLACE, lift=-1.0)
    with pytest.raises(dg.InputError, match="depart"):
        dg.pick_and_place(PICK, PLACE, depart=26.0)
    with pytest.raises(dg.InputError, match="pick"):
        dg.pick_and_place((0, float("nan"), 0), PLACE)


def test_picks_are_made_one_at_a_time_from_any_stream_of_stations() -> None:
    grip, drop = SetOutput(1, 0, True), SetOutput(1, 0, False)
    stations = ((-41.0, 10.0 * i, 295.0) for i in count())
    moves = list(islice(picks(stations, dwell=0.1, actions=[[drop], [grip]]), 4))
    assert [move.start for move in moves[1:]] == [move.end for move in moves[:-1]]
    assert [move.actions[-2][1] for move in moves] == [drop, grip, drop, grip]
    assert all(move.actions[-1] == (3, Dwell(0.1)) for move in moves)
    with pytest.raises(dg.InputError, match="from station 1 to station 2"):
        list(picks([PICK, PLACE, (0, 0, "z")]))


def test_a_chain_rests_between_its_parts_and_keeps_their_actions() -> None:
    path = chain(picks([PICK, PLACE, PICK], actions=[[SetOutput(1, 0, True)]]))
    assert path.corners == (2.0, 2.0, 0.0, 2.0, 2.0)
    assert [waypoint for waypoint, _ in path.actions] == [3, 6]
    assert len(round_corners(path).curve.rests) == 1
    assert dg.check_path(dg.Machine.default(), path).curve.count == 10
    with pytest.raises(dg.InputError, match="no paths"):
        chain([])
    with pytest.raises(dg.InputError, match="next path starts"):
        chain([dg.pick_and_place(PICK, PLACE)] * 2)
