from __future__ import annotations

import json
from pathlib import Path

import pytest

from duoglide.cli.main import run

PLAN = ["plan", "--pick", "-41,0,300", "--place", "-41,40,300"]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_plan_is_shown_as_it_was_when_it_was_made(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(PLAN) == 0
    told, bound, *facts = capsys.readouterr().out.splitlines()
    assert bound.strip() == "(toppra)"  # what no motion can beat, is for who plans
    first, _ = told.split(";")
    assert run(["log", "plan.mcap"]) == 0
    shown = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert len(facts) > 5
    for line in facts:
        assert " ".join(line.split()) in shown
    assert f"duration {first.removeprefix('plan.mcap: ')}" in shown
    assert run(["log", "plan.mcap", "--json"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert f"{numbers['plan']['duration']:.4f} s" in first


def test_a_log_is_written_for_programs_that_show_robots(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(PLAN) == 0
    capsys.readouterr()
    goals = {"foxglove": "full.mcap", "layout": "l.json", "rerun": "plan.rrd", "ros2": "bag"}
    options = [word for name, goal in goals.items() for word in (f"--{name}", goal)]
    assert run(["log", "plan.mcap", *options, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"] == goals
    for goal in goals.values():
        assert Path(goal).exists()
    assert run(["log", "plan.mcap", "--ros2", "bag"]) == 1
    assert "cannot write bag: it is a folder" in capsys.readouterr().err
    Path("taken").touch()
    assert run(["log", "plan.mcap", "--ros2", "taken"]) == 1
    assert "cannot write taken: it is there already" in capsys.readouterr().err
