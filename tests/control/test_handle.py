"""What ``RunHandle`` says when a run ends badly."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.control.channel.setpoints import Fence
from duoglide.control.host import process
from duoglide.control.host.commission import creep
from duoglide.control.host.run.prepare import prepare_part

SLOW = dg.CarriageLimits(velocity=100.0, acceleration=2e3, jerk=2e4)


@pytest.fixture(scope="module")
def trajectory() -> dg.Trajectory:
    path = dg.Path.line((-41.0, 0.0, 302.0), (-41.0, 100.0, 302.0))
    return dg.plan(dg.Machine(limits=SLOW), path)


def test_whoever_polls_sees_that_a_killed_streamer_will_not_finish(
    trajectory: dg.Trajectory,
) -> None:
    with dg.Robot.connect(trajectory.machine) as robot:
        robot.enable()
        robot.home()
        handle = robot.start(trajectory, approach=True)
        os.kill(robot._connection.process.pid, signal.SIGKILL)
        pause = threading.Event()
        for _ in range(300):
            if handle.done:
                break
            pause.wait(0.01)
        assert handle.done
        with pytest.raises(dg.BusError, match="gone"):
            handle.wait()


def test_a_streamer_that_hangs_is_given_up_long_before_one_that_starts(
    trajectory: dg.Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert process._LOAD_PATIENCE <= 5.0 < process._START_PATIENCE
    monkeypatch.setattr(process, "_LOAD_PATIENCE", 0.2)
    with dg.Robot.connect(trajectory.machine) as robot:
        streamer = robot._connection.process
        begin = time.monotonic()
        os.kill(streamer.pid, signal.SIGSTOP)
        try:
            with pytest.raises(dg.BusError, match=r"is stuck: .* answered for 0\.\d s"):
                robot._load(prepare_part(trajectory, Fence.of(trajectory.machine), 1))
        finally:
            os.kill(streamer.pid, signal.SIGCONT)
        assert time.monotonic() - begin < 5.0


def test_a_run_says_whether_it_still_approaches(trajectory: dg.Trajectory) -> None:
    line = dg.Path.line((-41.0, 5.0, 302.0), (-41.0, 10.0, 302.0))
    away = dg.plan(trajectory.machine, line, brake_safe=False)
    with dg.Robot.connect(trajectory.machine) as robot:
        robot.enable()
        robot.home()
        handle = robot.start(away, approach=True)
        before = handle.approaching
        assert handle.wait().completed
        assert (before, handle.approaching) == (True, False)
        robot.park()
        assert not robot.start(trajectory, approach=True).approaching, "it is there already"


def test_a_robot_that_has_been_closed_says_so_whatever_it_is_asked_for(
    trajectory: dg.Trajectory,
) -> None:
    with dg.Robot.connect(trajectory.machine) as robot:
        robot.enable()
        robot.home()
        bus = robot.bus
    verbs: list[Callable[[], object]] = [
        lambda: robot.run(trajectory),
        lambda: robot.start(trajectory),
        lambda: robot.move_to((-41.0, 0.0, 302.0)),
        lambda: robot.jog((0.0, 1.0, 0.0)),
        lambda: creep(robot, 1),
        *(robot.park, robot.recover, robot.enable, robot.home, robot.reset_fault),
        *(lambda: robot.position, lambda: robot.carriages, lambda: robot.held),
        lambda: robot.states,
    ]
    for verb in verbs:
        with pytest.raises(dg.BusError, match=f"the connection to bus {bus} is closed"):
            verb()
    robot.close()  # once more does no harm


def test_a_log_that_cannot_be_written_is_named_once_and_for_all(
    trajectory: dg.Trajectory, tmp_path: Path
) -> None:
    with (
        pytest.raises(dg.LogError, match="it is a directory"),
        dg.Robot.connect(trajectory.machine) as robot,
    ):
        robot.enable()
        robot.home()
        robot.run(trajectory, log=tmp_path, approach=True)
