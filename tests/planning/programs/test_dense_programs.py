"""Programs whose paths are told by many points."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import duoglide as dg
from duoglide.arrays import FloatArray

MACHINE = dg.Machine.default()


def straight(start: tuple[float, ...], end: tuple[float, ...], count: int) -> FloatArray:
    return np.linspace(start, end, count + 1)


@pytest.mark.parametrize("count", [10, 40])
def test_seams_keep_off_waypoints_and_lose_no_action(count: int) -> None:
    corners = [(-41.0, -150.0, 300.0), (-41.0, 150.0, 300.0), (-20.0, 150.0, 310.0)]
    there = dg.Path.polyline(straight(corners[0], corners[1], count), 0.5)
    for waypoint in range(1, count):
        there = there.at(waypoint, dg.SetOutput(1, 16, bool(waypoint % 2)))
    away = dg.Path.polyline(straight(corners[1], corners[2], 4), 0.5)
    paths = [there, away, away.reversed(), there.reversed()] * 2
    parts = list(dg.plan_program(MACHINE, paths, brake_safe=False, tolerance=2.0))
    done = [action for part in parts for _, action in part.actions]
    assert len(done) == 4 * (count - 1)
    for one, other in pairwise(parts):
        end, start = one.at(one.duration), other.at(0.0)
        np.testing.assert_allclose(end.carriages, start.carriages, atol=1e-9)
        np.testing.assert_allclose(end.velocity, start.velocity, atol=1e-2)
