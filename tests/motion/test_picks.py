from __future__ import annotations

from math import isnan

import pytest

import duoglide as dg
from duoglide.motion.picks import count_picks

PICK = dg.pick_and_place((-41, -20, 300), (-41, 20, 300))
BACK = dg.pick_and_place((-41, 20, 300), (-41, -20, 300))


@pytest.mark.parametrize(
    ("path", "count"),
    [
        (PICK, 1),
        (PICK.then(BACK), 2),
        (dg.pick_and_place((-41, -20, 300), (-21, 20, 310), depart=5, approach=8), 1),
        (dg.Path.line((-41, -20, 300), (-41, 20, 300)), 0),
        (dg.Path.polyline([(-41, -20, 300), (-41, -20, 325), (-41, 20, 325)]), 0),
        (PICK.then(dg.Path.line((-41, 20, 300), (-41, 0, 300))), 0),
        (dg.Path.arc((-41, -20, 300), (-41, 0, 320), (-41, 20, 300)), 0),
    ],
)
def test_picks_are_moves_up_across_and_down(path: dg.Path, count: int) -> None:
    assert count_picks(path) == count


def test_what_is_no_pick_has_no_rate() -> None:
    machine = dg.Machine.default()
    line = dg.plan(machine, dg.Path.line((-41, -20, 300), (-41, 20, 300)), brake_safe=False).audit()
    assert isnan(line.picks_per_minute)
    assert "picks" not in str(line)
    both = dg.plan(machine, PICK.then(BACK), brake_safe=False).audit()
    assert both.picks_per_minute == pytest.approx(60.0 / both.duration)


def test_the_programs_own_feed_is_named_where_it_holds_the_motion_back() -> None:
    machine = dg.Machine.default()
    path = dg.Path.line((-41, -40, 300), (-41, 40, 300), speed=100.0)
    slow = dg.plan(machine, path, brake_safe=False).audit()
    assert 0.9 < slow.feed_share <= 1.0
    assert slow.explain().startswith("the program's own feed, 9")
    free = dg.Path.line((-41, -40, 300), (-41, 40, 300), speed=1e5)
    assert dg.plan(machine, free, brake_safe=False).audit().feed_share == 0.0
    gentle = dg.Path.line((-41, -40, 300), (-41, 40, 300)).capped(acceleration=500.0)
    assert "own feed" in dg.plan(machine, gentle, brake_safe=False).audit().explain()
