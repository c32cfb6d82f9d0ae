"""What the commands say of a program that they have read."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from duoglide.cli.main import run

SLICED = """\
M104 S200
G92 E0
G0 X-41 Y-20 Z300
G64
G1 Y-10 E0.5 F3000
G1 Z310 E1
M104 S0
"""


@pytest.fixture(autouse=True)
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("part.gcode").write_text(SLICED)


@pytest.mark.parametrize("verb", ["check", "plan"])
def test_skipped_words_are_counted_for_people_and_for_scripts(
    verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [verb, "part.gcode", "--ignore", "M104", "--ignore", "E,M106", "--tolerance", "0.5"]
    assert run(arguments) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "ignored M104 2 times, E 3 times" in said
    assert "line 4: G64 without P: the smoothest within 0.5 mm, the program's tolerance" in said
    again = ["--force"] if verb == "plan" else []  # the plan is there already
    assert run([*arguments, *again, "--json"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["ignored"] == {"M104": 2, "E": 3}
    assert len(numbers["remarks"]) == 1


def test_nothing_is_written_of_a_program_that_is_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["plan", "part.gcode"]) == 1
    assert "line 1: M104 is not known" in capsys.readouterr().err
    assert run(["plan", "part.gcode", "--ignore", "M104,X"]) == 1
    assert "ignore X: it moves" in capsys.readouterr().err
    assert run(["plan", "--pick", "-41,0,300", "--place", "-41,9,300", "--ignore", "E"]) == 2
    assert "--ignore goes with a PROGRAM" in capsys.readouterr().err
    assert not Path("plan.mcap").exists()
