from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.playback.compare import Streamed, compare, compare_streamed
from duoglide.playback.pace import slowed
from duoglide.playback.rebuild import rebuild
from duoglide.storage import Phase, read_log

Pace = Sequence[tuple[float, float, Phase]]
WriteRun = Callable[[Pace, str], Path]
WritePlan = Callable[[Pace, str, dg.Trajectory], Path]
Paced = Callable[[dict[int, float]], Pace]


@pytest.fixture
def usual(write_run: WriteRun, at_full_speed: Pace) -> Path:
    return write_run(at_full_speed, "usual.mcap")


def test_a_run_is_the_same_as_itself(usual: Path) -> None:
    result = compare(read_log(usual), read_log(usual))
    assert result.same_setpoints
    assert result.same_path
    assert result.same_pace
    assert result.actual == (0.0, 0.0, 0.0)


def test_at_another_pace_setpoints_are_the_same_at_the_same_path_time(
    usual: Path, write_run: WriteRun, paced: Paced
) -> None:
    other = write_run(paced({0: 0.5, 60: 0.25}), "other.mcap")
    result = compare(read_log(usual), read_log(other))
    assert result.same_setpoints
    assert result.same_path
    assert not result.same_pace
    fast, slow = result.runs
    assert (fast.paces, slow.paces) == ((1.0,), (0.5, 0.25))
    assert slow.duration > 2.0 * fast.duration
    assert slow.planned == fast.planned
    assert 0.0 < max(result.actual) < 0.045, "the noise of both"
    assert slow.lateness.median <= slow.lateness.p99 <= 150.0
    json.dumps(result.to_dict())


def test_a_plan_that_was_slowed_down_is_the_same_path(usual: Path) -> None:
    read = Streamed.parts_of(read_log(usual))[0]
    plan = slowed(read.plan, 0.5)
    other = Streamed(plan, replace(read.data, path_time=2.0 * read.data.path_time))
    result = compare_streamed(read, other)
    assert result.same_path
    assert result.same_setpoints
    assert result.same_pace, "these are the same setpoints in the same cycles"
    assert result.runs[1].planned == pytest.approx(2.0 * result.runs[0].planned)


@pytest.mark.parametrize("share", [0.5, 0.2, 0.125])
def test_a_replay_at_another_speed_has_the_pace_that_it_has(
    share: float, usual: Path, write_run: WritePlan, trajectory: dg.Trajectory
) -> None:
    slow = slowed(trajectory, share)
    end = slow.duration
    moving = [(0.002 * k, 1.0, Phase.PROGRAM) for k in range(1, int(end / 0.002) + 1)]
    again = write_run([(0.0, 0.0, Phase.HOLD), *moving], "again.mcap", slow)
    for pair in ((usual, again), (again, usual)):
        result = compare(*map(read_log, pair))
        assert result.same_path
        paces = {run.planned: run.paces for run in result.runs}
        assert paces == {trajectory.duration: (1.0,), end: (share,)}


def test_a_replay_of_a_run_with_a_changed_pace_has_that_pace(
    usual: Path, write_run: Callable[..., Path], paced: Paced
) -> None:
    once = write_run(paced({0: 0.5, 100: 0.25}), "once.mcap")
    motion = rebuild(read_log(once)).motion
    moving = [(0.002 * k, 1.0, Phase.PROGRAM) for k in range(1, int(motion.duration / 0.002) + 1)]
    again = write_run([(0.0, 0.0, Phase.HOLD), *moving], "again.mcap", motion)
    fast, slow = compare(read_log(usual), read_log(again)).runs
    assert fast.paces == (1.0,)
    assert slow.paces[0] == 0.5
    assert slow.paces[-1] == 0.25
    assert set(slow.paces) == {0.5, 0.25}


def test_a_setpoint_that_is_not_the_others_is_found_either_way(usual: Path) -> None:
    read = Streamed.parts_of(read_log(usual))[0]
    wrong = read.data.setpoint.copy()
    row = int(read.rows()[40])
    wrong[row, 1] += 3
    other = replace(read, data=replace(read.data, setpoint=wrong))
    result = compare_streamed(read, other)
    assert result.setpoint == (0, 3, 0)
    assert result.first == 40
    assert not result.same_setpoints
    back = compare_streamed(other, read)
    assert (back.setpoint, back.first) == ((0, 3, 0), 40)


def test_two_paths_are_compared_at_equal_path_time(usual: Path) -> None:
    read = Streamed.parts_of(read_log(usual))[0]
    x, y, z = read.plan.position_at(0.0)
    moved = dg.transfer(read.data.machine, (x, y, z), (x + 5.0, y, z))
    result = compare_streamed(read, replace(read, plan=moved))
    assert not result.same_path
    assert not result.same_setpoints
    assert result.setpoint[0] > 1000


def test_an_answer_that_did_not_come_is_no_difference(usual: Path) -> None:
    read = Streamed.parts_of(read_log(usual))[0]
    data, row = read.data, len(read.data) // 2
    actual, missing = data.actual.copy(), data.missing.copy()
    actual[row] += 5000
    wrong = replace(read, data=replace(data, actual=actual))
    assert max(compare_streamed(read, wrong).actual) == pytest.approx(5.0)
    missing[row] = 0b111
    silent = replace(read, data=replace(data, actual=actual, missing=missing))
    assert compare_streamed(read, silent).actual == (0.0, 0.0, 0.0)
    assert compare_streamed(silent, read).actual == (0.0, 0.0, 0.0)


def test_the_command_shows_both_runs_side_by_side(
    usual: Path, write_run: WriteRun, paced: Paced, capsys: pytest.CaptureFixture[str]
) -> None:
    other = write_run(paced({0: 0.5}), "other.mcap")
    assert run(["log", str(usual), "--compare", str(other)]) == 0
    out = capsys.readouterr().out
    words = " ".join(out.split())  # where the lines break depends on the length of the folder
    assert "the same path at another pace; every setpoint is the same" in words
    assert "100 %" in out
    assert "50 %" in out
    assert run(["log", str(usual), "--compare", str(other), "--json"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["same_setpoints"]
    assert [side["paces"] for side in numbers["runs"]] == [[1.0], [0.5]]


def test_a_run_that_never_began_is_refused(usual: Path, write_run: WriteRun) -> None:
    still = write_run([(0.0, 0.0, Phase.HOLD)], "still.mcap")
    with pytest.raises(dg.LogError, match="without a cycle on its plan"):
        compare(read_log(usual), read_log(still))
