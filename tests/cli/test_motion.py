"""The verbs that move the machine, on the virtual bus, as a person runs them."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.storage import EventKind, Topic, read_log


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


def test_a_plan_is_streamed_replayed_and_compared(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert run(["stream", "plan.mcap", "--log", "run.mcap", "--approach", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["completed"]
    assert run(["replay", "run.mcap", "--log", "again.mcap", "--approach"]) == 0
    assert "cycles in" in capsys.readouterr().out
    assert run(["log", "run.mcap", "--compare", "again.mcap", "--json"]) == 0
    compared = json.loads(capsys.readouterr().out)
    assert compared["same_setpoints"]
    assert compared["setpoint"] == [0, 0, 0]
    assert run(["log", "run.mcap"]) == 0
    assert "worst following error" in capsys.readouterr().out


def test_away_from_the_start_it_is_refused_and_no_log_is_left(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert run(["stream", "plan.mcap", "--log", "refused.mcap"]) == 1
    assert "--approach" in capsys.readouterr().err.splitlines()[-1]
    assert not list(folder.glob("*refused*"))


def test_ctrl_c_stops_on_the_path_and_leaves_a_whole_log(folder: Path) -> None:
    words = ["stream", "plan.mcap", "--log", "stopped.mcap", "--approach", "--override", "4"]
    process = subprocess.Popen(
        [sys.executable, "-m", "duoglide.cli", *words],
        cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    log = folder / "stopped.mcap"
    with process:
        deadline = time.monotonic() + 30.0
        while not log.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30.0)
    assert process.returncode == 1
    assert errors.splitlines()[-1] == "duoglide: interrupted"
    assert "Traceback" not in errors
    opened = read_log(log)
    assert opened.missing == ""
    kinds = [event.kind for _, event in opened.records(Topic.EVENT)]
    assert EventKind.STARTED in kinds
    assert EventKind.FAULT not in kinds
