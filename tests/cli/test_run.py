"""``duoglide run``: programs that are planned while they run, from a shell."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from duoglide.cli.main import run
from duoglide.storage import Topic, read_log

ROUND = """\
G90 G21
G0 X-41 Y0 Z302
G1 Y20 F6000
G1 Z306
G1 Y0
G1 Z302
"""


@pytest.fixture(autouse=True)
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("round.nc").write_text(ROUND)


def test_a_program_is_run_again_and_again_into_one_log(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "round.nc", "--repeat", "3", "--approach", "--log", "shift.mcap", "--json"]
    assert run([*words, "--no-brake-safe"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["completed"] and not said["program"]["ended"]  # early, by something
    assert said["program"]["paths"] % 3 == 0 and said["program"]["parts"] > 0
    assert said["log"] == "shift.mcap"
    records = [record for _, record in read_log("shift.mcap").records(Topic.CYCLE)]
    assert len(records) == said["cycles"]
    assert run(["log", "shift.mcap", "--compare", "shift.mcap"]) == 0
    capsys.readouterr()
    assert run(words) == 1  # the log is there
    assert "shift.mcap" in json.loads(capsys.readouterr().out)["error"]


def test_what_does_not_lead_back_to_its_start_is_not_repeated(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("round.nc").write_text(ROUND.removesuffix("G1 Z302\n"))
    assert run(["run", "round.nc", "--repeat", "2", "--approach"]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "4 mm from where it begins: to be repeated it has to lead back to its start" in said
