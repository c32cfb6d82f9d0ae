"""A machine that is limited in velocity and acceleration alone, on the virtual bus."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.channel.events import RunState
from duoglide.storage import read_log

MACHINE = dg.Machine(limits=dg.CarriageLimits(jerk=np.inf))
PICK = dg.pick_and_place((-41.0, -100.0, 295.0), (-41.0, 100.0, 295.0), 25.0, 3.0)


@pytest.fixture(scope="module")
def robot() -> Iterator[dg.Robot]:
    with dg.Robot.connect(MACHINE) as found:
        found.enable()
        found.home()
        yield found


def _until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_a_run_is_held_resumed_logged_and_replayed(robot: dg.Robot, tmp_path: Path) -> None:
    there = dg.plan(MACHINE, PICK.then(PICK.reversed()))
    assert there.report.method.value == "toppra"
    handle = robot.start(there, approach=True, override=0.3, log=tmp_path / "run.mcap")
    _until(lambda: handle.status.path_time > 0.2 * there.duration)
    handle.hold()
    _until(lambda: handle.status.state is RunState.HELD)
    handle.resume()
    report = handle.wait(30.0)
    assert report.completed
    assert not report.faults
    assert max(report.following_error) < 5.0
    plan = dg.Trajectory.load(tmp_path / "run.mcap")
    assert plan.profile == there.profile
    assert plan.machine == MACHINE
    assert dg.Machine.from_dict(read_log(tmp_path / "run.mcap").documents["machine"]) == MACHINE
    again = dg.replay(tmp_path / "run.mcap", machine=MACHINE)
    assert again.completed


def test_a_run_is_stopped_on_its_path(robot: dg.Robot) -> None:
    there = dg.plan(MACHINE, PICK, timing="near-optimal")
    handle = robot.start(there, approach=True, override=0.3)
    _until(lambda: handle.status.path_time > 0.3 * there.duration)
    handle.stop()
    report = handle.wait(20.0)
    assert not report.completed
    assert not report.faults
    assert robot.enabled
    np.testing.assert_allclose(robot.position, there.position_at(report.path_time), atol=0.05)
