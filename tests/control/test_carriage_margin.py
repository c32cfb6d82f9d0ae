"""A plan's carriage margin at run time: no drive trails by more than its plan has left."""

from __future__ import annotations

import numpy as np
import pytest
from cell_by_hand import CellByHand
from drive_stops import closes

import duoglide as dg
from duoglide.control.channel.events import Condition
from duoglide.control.host.run.prepare import LEAST_DEVIATION, margin_of
from duoglide.drives.simulation.plant import PlantParameters

MACHINE = dg.Machine(carriage_margin=0.0)


def dive(height: float) -> dg.Trajectory:
    """Plan down to near legs flat and up again, quick, as nobody would who asks for a margin."""
    corners = [(45.0, -60.0, 320.0), (45.0, 0.0, height), (45.0, 60.0, 320.0)]
    return dg.plan(MACHINE, dg.Path.polyline(corners, tolerance=2.0), brake_safe=False)


def stream(plan: dg.Trajectory, feedforward: float, bounded: bool) -> tuple[CellByHand, int]:
    """Stream a plan to drives of which the first trails; count cycles in which links are apart."""
    plants = [PlantParameters(velocity_feedforward=share) for share in (feedforward, 1.0, 1.0)]
    cell = CellByHand(MACHINE, plan.at(0.0).carriages, plants).enable()
    cell.run(plan, margin_at=margin_of(plan, MACHINE) if bounded else None)
    places = []
    for _ in range(400):
        cell.cycles(1)
        places.append(cell.carriages)
    return cell, int((~closes(MACHINE.geometry, np.array(places))).sum())


def test_a_drive_that_trails_by_more_than_the_plan_leaves_is_stopped_for() -> None:
    plan = dive(256.1)
    assert 0.2 < plan.path.carriage_margin < 0.21
    cell, apart = stream(plan, 0.75, bounded=True)
    assert not cell.completed
    assert cell.tripped()[0] == (Condition.FOLLOWING_ERROR, 1)
    assert apart == 0
    cell, _ = stream(plan, 0.75, bounded=False)
    assert cell.completed, "or something else stops it"


def test_a_plan_that_leaves_less_than_can_be_told_is_not_streamed() -> None:
    plan = dive(252.3)
    assert plan.path.carriage_margin < LEAST_DEVIATION
    with pytest.raises(dg.PathError, match=r"leaves the carriages 0.05.* carriage_margin = 0.2"):
        margin_of(plan, MACHINE)
    _, apart = stream(plan, 0.9, bounded=False)
    assert apart > 0, "and 10 % of feed-forward that is missing takes the links apart"
