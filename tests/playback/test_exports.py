from __future__ import annotations

import csv
import json
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

import duoglide as dg
from duoglide.playback.can_log import Frame, play, read_frames
from duoglide.playback.candump import frames_of, write_candump
from duoglide.playback.columns import platform
from duoglide.playback.run_data import read_run
from duoglide.playback.shown.foxglove import write_foxglove
from duoglide.playback.summary import summarise
from duoglide.playback.tables import write_csv, write_parquet
from duoglide.storage import Phase, read_log

Pace = Sequence[tuple[float, float, Phase]]
WriteRun = Callable[[Pace], Path]


def test_a_summary_says_what_the_log_holds(run_log: Path, trajectory: dg.Trajectory) -> None:
    summary = summarise(read_log(run_log))
    run = summary.run
    assert run is not None
    assert sum(count for _, count in run.lateness.histogram) == run.cycles
    assert run.period == pytest.approx(0.002, abs=1e-9)
    assert run.skipped == 0
    assert max(run.following_error) == pytest.approx(0.020, abs=0.005)
    assert [event.text for _, event in summary.events] == ["program started", "oh"]
    assert [t for t, _ in summary.events] == pytest.approx([0.0, 1.0])
    json.dumps(summary.to_dict())


def test_an_empty_run_has_a_summary(write_run: WriteRun) -> None:
    run = summarise(read_log(write_run([(0.0, 0.0, Phase.HOLD)]))).run
    assert run is not None
    assert (run.cycles, run.duration, run.following_error) == (1, 0.0, (0.0, 0.0, 0.0))


def test_csv_and_parquet_hold_the_same_numbers(run_log: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    log = read_log(run_log)
    rows = write_csv(log, tmp_path / "run.csv")
    assert write_parquet(log, tmp_path / "run.parquet") == rows == len(read_run(log))
    with (tmp_path / "run.csv").open(newline="") as stream:
        read = list(csv.DictReader(stream))
    table = parquet.read_table(tmp_path / "run.parquet")
    assert list(read[0]) == table.column_names
    for name in ("setpoint_1_inc", "actual_3_mm", "x_mm", "clearance_mm", "lateness_us"):
        values = [float(row[name]) for row in read]
        assert values == table.column(name).to_pylist(), name


def test_the_tool_follows_from_the_carriages(run_log: Path, trajectory: dg.Trajectory) -> None:
    data = read_run(read_log(run_log))
    position = platform(data.machine.geometry, data.setpoint_mm)
    assert np.abs(position - trajectory.position_at(data.path_time)).max() < 0.005


def test_carriages_that_hold_no_platform_give_no_numbers() -> None:
    rows = np.array([[-200.0, 200.0, 60.0], [-1000.0, 1000.0, 0.0]])
    position = platform(dg.Geometry(), rows)
    assert np.isfinite(position[0]).all()
    assert np.isnan(position[1]).all()


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".trc"])
def test_the_frames_are_those_of_the_bus(suffix: str, run_log: Path, tmp_path: Path) -> None:
    log = read_log(run_log)
    data = read_run(log)
    file = tmp_path / f"run{suffix}"
    count = write_candump(log, file)
    frames = list(read_frames(file))
    assert count == len(frames) == 7 * len(data) + 1
    assert [frame.can_id for frame in frames[:7]] == [
        0x80,
        0x181,
        0x182,
        0x183,
        0x201,
        0x202,
        0x203,
    ]
    setpoints = [f for f in frames if f.can_id == 0x202]
    targets = [int.from_bytes(f.data[2:], "little", signed=True) for f in setpoints]
    assert targets == data.setpoint[:, 1].tolist()
    stamps = [frame.stamp for frame in frames]
    assert stamps == sorted(stamps)
    assert [f.data[:2] for f in frames if f.can_id == 0x082] == [b"\x11\x86"]


def test_can_utils_reads_the_frames(run_log: Path, tmp_path: Path) -> None:
    if shutil.which("log2asc") is None:
        pytest.skip("needs can-utils")
    file = tmp_path / "run.log"
    count = write_candump(read_log(run_log), file)
    out = subprocess.run(
        ["log2asc", "-I", str(file), "can0"], capture_output=True, text=True, check=True
    ).stdout
    assert len([line for line in out.splitlines() if " Rx " in line]) == count


def test_frames_are_played_with_the_time_between_them() -> None:
    now, sent = [100.0], []

    class Bus:
        def send(self, message: object) -> None:
            sent.append((now[0], message))
            now[0] += 0.0004  # sending takes time, and later frames do not pay for it

    def sleep(seconds: float) -> None:
        now[0] += seconds

    frames = [Frame(17.0 + 0.001 * k, 0x80 + k, b"") for k in range(50)]
    count = play(frames, Bus(), clock=lambda: now[0], sleep=sleep)  # type: ignore[arg-type]
    assert count == 50
    assert [t for t, _ in sent] == pytest.approx([100.0 + 0.001 * k for k in range(50)])


def test_the_foxglove_export_has_every_derived_topic(run_log: Path, tmp_path: Path) -> None:
    file = tmp_path / "fox.mcap"
    count = write_foxglove(read_log(run_log), file)
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        messages = list(reader.iter_messages())
    assert len(messages) == count
    topics = {channel.topic for _, channel, _ in messages}
    assert topics == {
        "/path", "/carriage_1", "/carriage_2", "/carriage_3", "/platform", "/margins", "/drives",
        "/pose", "/log", "/tf", "/joint_states", "/mechanism", "/path_planned", "/path_done",
    }  # fmt: skip
    by_topic = {channel.topic: json.loads(message.data) for _, channel, message in messages}
    assert by_topic["/drives"]["state_1"] == "operation_enabled"
    assert by_topic["/margins"]["clearance_mm"] > 2.0


def test_a_plan_has_no_frames_and_no_cycles(trajectory: dg.Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "plan.mcap"
    trajectory.save(file)
    log = read_log(file)
    with pytest.raises(dg.LogError, match="not a run"):
        list(frames_of(log))
    with pytest.raises(dg.LogError, match="not a run"):
        read_run(log)
    assert write_csv(log, tmp_path / "plan.csv") > 50
    assert write_foxglove(log, tmp_path / "plan_fox.mcap") > 50


def test_an_export_that_fails_leaves_the_old_file(run_log: Path, tmp_path: Path) -> None:
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(dg.LogError, match="is a directory"):
        write_csv(read_log(run_log), tmp_path / "folder.csv")
    with pytest.raises(dg.LogError, match="cannot write"):
        write_csv(read_log(run_log), tmp_path / "none" / "run.csv")
