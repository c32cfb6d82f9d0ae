from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import duoglide as dg
from duoglide.planning.pick_and_place import picks
from duoglide.planning.program_planner import plan_program


def _stations(count: int, asked: list[int]) -> Iterator[tuple[float, float, float]]:
    rng = np.random.default_rng(7)
    for k in range(count):
        asked.append(k)
        x, y = rng.uniform([-70.0, -60.0], [-10.0, 60.0])
        yield float(x), float(y), 290.0


def test_each_trajectory_starts_where_the_last_one_ends(machine: dg.Machine) -> None:
    asked: list[int] = []
    told: list[tuple[int, float]] = []
    ends = None
    for trajectory in plan_program(
        machine, picks(_stations(6, asked), 20.0, 3.0), progress=lambda n, t: told.append((n, t))
    ):
        if ends is not None:
            assert trajectory.start == pytest.approx(ends, abs=1e-9)
        ends = trajectory.end
        assert trajectory.starts_at_rest
        assert trajectory.ends_at_rest
    assert [n for n, _ in told] == [1, 2, 3, 4, 5]
    assert told[-1][1] > told[0][1] > 0.0


def test_nothing_is_planned_before_it_is_asked_for(machine: dg.Machine) -> None:
    asked: list[int] = []
    program = plan_program(machine, picks(_stations(1_000_000, asked), 20.0, 3.0))
    next(program)
    next(program)
    assert len(asked) <= 4


def test_a_refused_path_is_named(machine: dg.Machine) -> None:
    good = dg.Path.line((-41, 0, 300), (-41, 50, 300))
    bad = dg.Path.line((-41, 50, 300), (-41, 50, 400))
    with pytest.raises(dg.PathError, match="path 2"):
        list(plan_program(machine, [good, bad]))
    with pytest.raises(dg.PathError, match="50 mm from where path 1 ends"):
        list(plan_program(machine, [good, good]))
