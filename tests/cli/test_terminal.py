"""Texts of files and drives cannot command the terminal on which they are shown."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.storage import EventKind, EventRecord, LogKind, LogWriter, Topic

ESCAPE = "\x1b]0;mine\x07\x1b[2J\x9b31m\u202e"
IN_TOML = r"\u001b]0;mine\u0007\u001b[2J\u009b31m\u202e"
PROGRAM = '[[path]]\npoints = [[0, 0, 300], [0, 10, 300]]\n"{key}" = 1\n'
LINE = ((-41, 0, 302), (-41, 10, 302))


def program(folder: Path) -> list[str]:
    file = folder / "program.toml"
    file.write_text(PROGRAM.format(key=IN_TOML))
    return ["check", str(file)]


def machine(folder: Path) -> list[str]:
    file = folder / "machine.toml"
    file.write_text(f'[drives]\nhoming = "{IN_TOML}"\n')
    return ["check", str(file), "--machine", str(file)]


def gcode(folder: Path) -> list[str]:
    file = folder / "program.gcode"
    file.write_text(f"G1 X0 {ESCAPE} Y0\n")
    return ["check", str(file)]


def name_of_a_file(folder: Path) -> list[str]:
    return ["log", str(folder / f"{ESCAPE}.mcap")]


def event_of_a_run(folder: Path) -> list[str]:
    file = folder / "run.mcap"
    trajectory = dg.plan(dg.Machine.default(), dg.Path.line(*LINE), brake_safe=False)
    with LogWriter(file, LogKind.RUN) as log:
        log.attach("machine", trajectory.machine.to_dict())
        log.attach("trajectory", trajectory.to_document())
        log.write(Topic.EVENT, 1.0, EventRecord(EventKind.STARTED, f"go {ESCAPE}"))
    return ["log", str(file)]


def dictionary_of_a_drive(folder: Path) -> list[str]:
    sample = Path(__file__).parents[2] / "docs" / "howto" / "acme_sd1.eds"
    text = sample.read_text()
    assert "ProductName=" in text
    file = folder / "drive.eds"
    file.write_text(text.replace("ProductName=", f"ProductName={ESCAPE}"))
    return ["drives", "probe", "--eds", str(file)]


@pytest.mark.parametrize(
    "make", [program, machine, gcode, name_of_a_file, event_of_a_run, dictionary_of_a_drive]
)
def test_what_a_text_says_is_shown_and_not_obeyed(
    make: Callable[[Path], list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(make(tmp_path))
    said, told = capsys.readouterr()
    assert all(line.isprintable() for line in f"{said}\n{told}".split("\n"))
    assert said + told


def test_the_reason_that_a_plan_gives_is_shown_and_not_obeyed() -> None:
    trajectory = dg.plan(dg.Machine.default(), dg.Path.line(*LINE), brake_safe=False)
    document = trajectory.to_document()
    document["report"]["reason"] = ESCAPE
    again = dg.Trajectory.from_document(document)
    assert all(line.isprintable() for line in str(again.audit()).split("\n"))
    assert r"\x1b]0;mine" in str(again.audit())


def test_an_error_that_nobody_catches_commands_no_terminal_either() -> None:
    error = dg.InputError(f"what is\n{ESCAPE}?")
    assert str(error) == "what is\n" + r"\x1b]0;mine\x07\x1b[2J\x9b31m\u202e?"
