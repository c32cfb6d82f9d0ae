"""Programs that are planned while they run, on the virtual bus."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.host.run import run_log
from duoglide.playback.compare import compare
from duoglide.storage import Document, Topic, read_log

CHAIN = Path(__file__).parents[1] / "benchmarks" / "chain.py"
HOME = (-41.0, 0.0, 302.0)
AWAY = (-41.0, 25.0, 302.0)


def to_and_fro(moves: int | None, fail: Exception | None = None) -> Iterator[dg.Path]:
    """Yield short lines between two places; raise after them where asked to."""
    for k in count() if moves is None else range(moves):
        yield dg.Path.line(*((HOME, AWAY) if k % 2 == 0 else (AWAY, HOME)))
    if fail is not None:
        raise fail


@pytest.fixture(scope="module")
def robot() -> Iterator[dg.Robot]:
    with dg.Robot.connect(dg.Machine.default()) as robot:
        robot.enable()
        robot.home()
        robot.move_to(HOME, override=1.0)
        yield robot


@pytest.fixture
def ready(robot: dg.Robot) -> dg.Robot:
    if np.abs(robot.position - HOME).max() > 0.05:
        robot.move_to(HOME, override=1.0)
    return robot


def _until(come: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not come():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_a_program_runs_to_its_end_and_its_log_can_be_replayed_and_compared(
    ready: dg.Robot, tmp_path: Path
) -> None:
    file, again = tmp_path / "shift.mcap", tmp_path / "again.mcap"
    report = ready.run_program(to_and_fro(6), brake_safe=False, log=file)
    assert report.completed and report.program is not None
    assert (report.program.parts, report.program.paths) == (6, 6)
    log = read_log(file)
    assert not log.missing
    plans = {name for name in log.documents if name.startswith(Document.TRAJECTORY)}
    assert plans == {"trajectory", *(f"trajectory_{part}" for part in range(1, 6))}
    records = [record for _, record in log.records(Topic.CYCLE)]
    assert {record.part for record in records} == set(range(6))
    numbers = [record.cycle for record in records]
    assert numbers[-1] - numbers[0] + 1 == len(numbers) + report.skipped
    from duoglide.playback.replay import prepare

    rerun = prepare(file)
    assert rerun.run(ready, again).completed
    found = compare(log, read_log(again))
    assert found.same_path and found.same_setpoints and not any(found.by_cycle)


def test_two_hundred_moves_have_every_setpoint_as_somebody_else_hears_them(
    ready: dg.Robot, tmp_path: Path
) -> None:
    """The listener is a process of its own; ten thousand moves: tests/benchmarks/chain.py."""
    turn = 2.0 * np.pi * np.arange(26) / 25
    points = np.column_stack([-51.0 + 10.0 * np.cos(turn), 30.0 * np.sin(turn), 302.0 + 0.0 * turn])
    points[-1] = points[0]
    lines = (dg.Path.line(here, there) for here, there in pairwise(points))
    parts = list(dg.plan_program(ready.machine, lines, tolerance=1.0))
    words = [sys.executable, str(CHAIN), "--listen", ready.bus]
    with subprocess.Popen(words, stdin=-1, stdout=-1, text=True) as ear:
        assert ear.stdout is not None and ear.stdin is not None
        ear.stdout.readline()
        report = ready.run_parts(parts * 8, log=tmp_path / "shift.mcap", override=0.5)
        ear.stdin.close()
        heard = json.loads(ear.stdout.read())
    assert report.completed and report.program is not None
    assert report.program.parts == 8 * len(parts)
    assert heard["wrong"] == 0
    assert heard["moved"] <= report.cycles <= heard["syncs"]
    logged = sum(1 for _ in read_log(tmp_path / "shift.mcap").records(Topic.CYCLE))
    assert logged == report.cycles


def test_a_full_log_goes_on_in_files_that_open_by_themselves(
    ready: dg.Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_log.RunLog.__init__, "__kwdefaults__", {"number": 0, "full": 40_000})
    report = ready.run_program(to_and_fro(6), brake_safe=False, log=tmp_path / "shift.mcap")
    files = sorted(tmp_path.iterdir())
    assert [file.name for file in files][:2] == ["shift.mcap", "shift_0002.mcap"]
    cycles = 0
    _until(lambda: not any(thread.name == "duoglide-log" for thread in threading.enumerate()))
    for file in files:
        log = read_log(file)
        assert not log.missing
        cycles += sum(1 for _ in log.records(Topic.CYCLE))
        assert compare(log, log).same_setpoints
    assert cycles == report.cycles


def test_a_program_without_an_end_is_asked_for_no_more_than_a_few_paths_ahead_and_stops(
    ready: dg.Robot,
) -> None:
    asked = []

    def paths() -> Iterator[dg.Path]:
        for path in to_and_fro(None):
            asked.append(path)
            yield path

    handle = ready.start_program(paths(), brake_safe=False, override=0.02)
    time.sleep(1.0)
    handle.hold()
    _until(lambda: handle.status.rate == 0.0)
    assert len(asked) < 40
    handle.resume()
    handle.set_override(1.0)
    handle.stop()
    report = handle.wait(20.0)
    assert not report.completed and report.program is not None and not report.program.ended
    assert ready.enabled and ready.current_run is None


def test_a_source_that_fails_is_named_and_the_machine_rests_at_the_end_of_what_there_was(
    ready: dg.Robot,
) -> None:
    with pytest.raises(dg.DuoglideError, match=r"source .* failed: KeyError: 'part 3'"):
        ready.run_program(to_and_fro(3, KeyError("part 3")), brake_safe=False)
    np.testing.assert_allclose(ready.position, AWAY, atol=0.05)
    assert ready.enabled and not ready.latched


def test_a_path_that_cannot_be_followed_ends_the_program_before_it(ready: dg.Robot) -> None:
    paths = [dg.Path.line(HOME, AWAY), dg.Path.line(AWAY, (-41.0, 25.0, 450.0))]
    with pytest.raises(dg.PathError, match="path 2"):
        ready.run_program(paths, brake_safe=False)
    np.testing.assert_allclose(ready.position, AWAY, atol=0.05)


def test_a_planner_that_dies_is_named_and_the_machine_rests_where_its_plans_end(
    ready: dg.Robot,
) -> None:
    handle = ready.start_program(to_and_fro(None), brake_safe=False)
    feed: Any = handle._plan.feed
    os.kill(feed._source.pid, signal.SIGKILL)
    report = handle.wait(30.0)
    assert not report.completed and report.program is not None
    assert "the planning process has ended (exit code -9)" in report.program.ended
    assert any("ended early" in remark for remark in report.remarks)
    assert ready.enabled and not ready.latched


def test_a_source_that_stalls_is_waited_for_at_rest_and_counted(ready: dg.Robot) -> None:
    go_on = threading.Event()

    def paths() -> Iterator[dg.Path]:
        yield from to_and_fro(2)
        go_on.wait(30.0)
        yield from to_and_fro(2)

    handle = ready.start_program(paths(), brake_safe=False)
    _until(lambda: handle.status.state.name == "WAITING")
    time.sleep(0.1)
    go_on.set()
    report = handle.wait(30.0)
    assert report.completed and report.program is not None
    assert report.program.waits >= 1 and report.program.waited > 0.1
    assert any(remark.startswith("waited for the planner: ") for remark in report.remarks)


@pytest.mark.parametrize("wrong", [5, [5], [], "program.toml"])
def test_what_is_no_program_is_refused_before_anything_moves(ready: dg.Robot, wrong: Any) -> None:
    with pytest.raises(dg.InputError):
        ready.start_program(wrong)
    assert ready.current_run is None


def test_a_run_leaves_its_path_for_another_goal_or_refuses_and_goes_on(
    ready: dg.Robot, tmp_path: Path
) -> None:
    goal = (-41.0, -20.0, 305.0)
    file = tmp_path / "left.mcap"
    handle = ready.start_program(to_and_fro(None), brake_safe=False, log=file)
    with pytest.raises(dg.PathError):
        handle.go_to((-41.0, 0.0, 500.0))
    assert not handle.done
    handle.go_to(goal)
    report = handle.wait(30.0)
    assert report.completed and report.program is not None and not report.program.ended
    np.testing.assert_allclose(ready.position, goal, atol=0.05)
    from duoglide.playback.replay import prepare

    np.testing.assert_allclose(prepare(file).parts[-1].position_at(9.0), goal, atol=1e-6)
    with pytest.raises(dg.DriveError, match="over"):
        handle.go_to(HOME)
