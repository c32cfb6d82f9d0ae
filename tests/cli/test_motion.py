"""The verbs that move the machine, on the virtual bus, as a person runs them."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import can
import cantools
import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.drives import pdo
from duoglide.drives.bus.buses import open_bus
from duoglide.kinematics.home import home_carriages
from duoglide.storage import EventKind, Topic, read_log
from duoglide.viewer.join import JoinedRobot, find

DBC = Path(__file__).parents[2] / "firmware_interface" / "linear_axis.dbc"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with plan.mcap: slow, so that a busy computer can stream it."""
    here = tmp_path_factory.mktemp("motion")
    machine = dg.Machine(
        limits=dg.CarriageLimits(velocity=400.0, acceleration=8e3, jerk=300e3),
        stop_limits=dg.CarriageLimits(),
    )
    path = dg.Path.line((-41, -40, 302), (-41, 40, 302))
    dg.plan(machine, path, brake_safe=False).save(here / "plan.mcap")
    return here


def test_the_helps_examples_stream_a_plan_replay_it_and_compare(
    folder: Path,
    examples: dict[str, list[list[str]]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    assert run([*examples["stream"][0], "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["completed"]
    assert "approaching" in said.err
    assert run(examples["replay"][0]) == 0
    assert "cycles in" in capsys.readouterr().out
    summary, exports, shown, picture, comparison = examples["log"]
    assert run(summary) == 0
    assert "worst following error" in capsys.readouterr().out
    for words in (exports, shown, picture):
        assert run(words) == 0
    files = {"run.csv", "run.log", "full.mcap", "layout.json", "run.png"}
    assert files <= {file.name for file in folder.iterdir()}
    capsys.readouterr()
    assert run([*comparison, "--json"]) == 0
    compared = json.loads(capsys.readouterr().out)
    assert compared["same_setpoints"]
    assert compared["setpoint"] == [0, 0, 0]
    assert run(["log", "run.mcap", "--candump", "frames.log"]) == 0
    sent = decode_setpoints(folder / "frames.log")
    logged = [record.setpoint for _, record in read_log(folder / "run.mcap").records(Topic.CYCLE)]
    assert sent == logged


def decode_setpoints(frames: Path) -> list[tuple[int, ...]]:
    """Read the setpoints of a run as somebody with the DBC and other people's tools does."""
    database = cantools.database.load_file(DBC)
    targets: dict[str, list[int]] = {}
    for message in can.LogReader(frames):
        name = database.get_message_by_frame_id(message.arbitration_id).name
        if name.endswith("_RPDO1"):
            values = database.decode_message(name, message.data)
            targets.setdefault(name, []).append(values["TargetPosition"])
    return list(zip(*(targets[name] for name in sorted(targets)), strict=True))


def test_away_from_the_start_it_is_refused_and_no_log_is_left(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert run(["stream", "plan.mcap", "--log", "refused.mcap"]) == 1
    assert "--approach" in capsys.readouterr().err.splitlines()[-1]
    assert not list(folder.glob("*refused*"))


def test_a_replay_is_watched_slowed_and_stopped_by_another_program(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert run(["stream", "plan.mcap", "--log", "joined.mcap", "--approach"]) == 0
    capsys.readouterr()
    words = ["replay", "joined.mcap", "--approach", "--override", "2"]
    with subprocess.Popen(
        [sys.executable, "-m", "duoglide.cli", *words], stderr=subprocess.PIPE, text=True
    ) as process:
        robot = joined(process.pid)
        assert robot.current_run is not None
        robot.current_run.set_override(0.5)
        assert robot.current_run.status.override == 0.5
        robot.stop()
        _, errors = process.communicate(timeout=600.0)
    assert process.returncode == 1
    assert re.fullmatch(r"duoglide: stopped on the \w+ at path time \d\.\d{4} s", last_line(errors))


def joined(pid: int) -> JoinedRobot:
    """Join a program as soon as it moves."""
    deadline = time.monotonic() + 600.0
    while time.monotonic() < deadline:
        with contextlib.suppress(dg.BusError):
            robot = JoinedRobot(find(pid))
            if robot.current_run is not None:
                return robot
        time.sleep(0.05)
    raise TimeoutError(f"nothing to join in process {pid}")


def test_the_status_of_a_machine_that_another_host_moves_is_overheard(
    capsys: pytest.CaptureFixture[str],
) -> None:
    machine = dg.Machine.default()
    with dg.Robot.connect(machine) as robot:
        robot.enable()
        robot.home()
        with open_bus(robot.bus) as witness:
            assert run(["status", "--bus", robot.bus, "--json"]) == 0
            status = json.loads(capsys.readouterr().out)
            seen = {frame.arbitration_id & ~0x7F for frame in iter(lambda: witness.recv(0.0), None)}
        assert robot.enabled
        assert run(["status", "--bus", robot.bus]) == 0
        assert "only listened, nothing was sent" in capsys.readouterr().out
    assert status["listening"]
    assert "SYNC" in status["host"]
    assert status["states"] == ["operation enabled"] * 3
    assert status["carriages"] == pytest.approx(home_carriages(machine), abs=0.1)
    assert status["heartbeats"] == ["operational"] * 3
    assert pdo.TPDO1 in seen
    assert not seen & {pdo.SDO_REQUEST, pdo.SDO_REPLY}


def last_line(text: str) -> str:
    return text.splitlines()[-1]


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_and_sigterm_stop_on_the_path_and_leave_a_whole_log(
    folder: Path, number: signal.Signals, times: int
) -> None:
    name = f"{number.name}{times}.mcap"
    words = ["stream", "plan.mcap", "--log", name, "--approach", "--override", "4"]
    before = signal.signal(number, signal.SIG_DFL)  # a shell's "&" has Ctrl-C ignored: inherited
    process = subprocess.Popen(
        [sys.executable, "-m", "duoglide.cli", *words],
        cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    signal.signal(number, before)
    log = folder / name
    with process:
        deadline = time.monotonic() + 600.0
        while not log.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(1.0)
        for _ in range(times):
            os.killpg(process.pid, number)  # as a terminal does
            time.sleep(0.02)
        _, errors = process.communicate(timeout=600.0)
    assert process.returncode == 130
    said = re.search(r"stopped on the (path|approach) at path time (\d\.\d{4}) s; log: ", errors)
    assert said is not None, errors
    assert last_line(errors).endswith(f"log: {name}")
    assert "Traceback" not in errors
    opened = read_log(log)
    assert opened.missing == ""
    kinds = [event.kind for _, event in opened.records(Topic.EVENT)]
    assert EventKind.STARTED in kinds
    assert EventKind.FAULT not in kinds
    stops = [event.text for _, event in opened.records(Topic.EVENT) if event.kind == EventKind.STOP]
    assert stops[-1] == said.group().removesuffix("; log: "), "one number for one stop"


def test_simulated_drives_play_their_scenario_and_end_in_order_when_they_are_asked_to(
    tmp_path: Path,
) -> None:
    scenario = tmp_path / "play.toml"
    scenario.write_text('[plant]\nbandwidth = 30\n[[fault]]\nkind = "device_fault"\naxis = 3\n')
    command = [sys.executable, "-m", "duoglide.cli", "drives", "--scenario", str(scenario)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert "three drives on --bus socketcand:" in process.stdout.readline()
        assert process.stdout.readline() == "Ctrl-C ends them\n"
        assert process.stdout.readline().endswith(" s, axis 3: device fault\n")
        process.terminate()
        said, _ = process.communicate(timeout=600.0)
    assert process.returncode == 0
    assert said == "ended\n"
