"""The examples of the help, as a person copies them into a shell."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer

from duoglide.cli.main import app, run

CSV = "x,y,z\n-41,-50,300\n-41,50,300\n"
TOML = 'start = [-41, -50, 300]\n[[moves]]\ntype = "line"\nto = [-41, 50, 300]\n'
Examples = dict[str, list[list[str]]]


def test_every_verb_has_examples_that_its_arguments_allow(examples: Examples) -> None:
    group = typer.main.get_command(app)
    for verb, lines in examples.items():
        assert lines, verb
        for words in lines:
            assert words[0] == verb
            command = group.commands[verb]  # type: ignore[attr-defined]  # a group has them
            command.make_context(verb, words[1:])  # raises where one is misused


def test_examples_that_need_no_drives_do_what_they_say(
    examples: Examples,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("program.csv").write_text(CSV)
    Path("program.toml").write_text(TOML)
    for verb in ("machine", "plan", "check"):
        for words in examples[verb]:
            assert run(words) == 0, words
            captured = capsys.readouterr()
            assert captured.out
            assert "duoglide:" not in captured.err
    written = {file.name for file in tmp_path.iterdir()}
    assert written >= {"cell.toml", "plan.mcap", "plan.png", "path.png"}


def test_units_in_the_help_are_not_taken_for_markup(capsys: pytest.CaptureFixture[str]) -> None:
    for verb in ("plan", "check"):
        assert run([verb, "--help"]) == 0
        assert capsys.readouterr().out.count("[mm]") >= 3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--point", "1,2,3", "--pick", "1,2,3"], "do not go with --point"),
        (["--point", "1,2"], "x,y,z"),
        (["--point", "1,2,3", "p.csv"], "do not go with a PROGRAM"),
    ],
)
def test_points_go_with_nothing_else(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["check", *arguments]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert run(["check", "--point", "1,2,3"]) == 1
