"""What a script reads: one envelope for all verbs, and the keys that the documentation names."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.paper import figures

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "scripts.md"
ENVELOPE = {"duoglide", "verb", "ok"}
FAILURE = {"error", "type", "exit_code"}
PICK = ["--pick", "-41,-20,300", "--place", "-41,20,300"]


def documented() -> dict[str, set[str]]:
    """Read the table of the page: the keys of each verb."""
    rows = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| (.*) \|$", PAGE.read_text("utf-8"), re.M)
    return {
        verb: set(re.findall(r"`(\w+)`", re.sub(r"\([^)]*\)", "", keys)))
        for verbs, keys in rows
        for verb in re.findall(r"`(\w+)`", verbs)
    }


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def answer(
    arguments: list[str], capsys: pytest.CaptureFixture[str], code: int = 0
) -> dict[str, Any]:
    """Run a verb with --json; return what it says, which has the envelope."""
    capsys.readouterr()
    assert run([*arguments, "--json"]) == code
    captured = capsys.readouterr()
    assert "duoglide:" not in captured.err, "everything is said once"
    document = json.loads(captured.out)
    assert list(document)[:3] == ["duoglide", "verb", "ok"]
    assert document["duoglide"] == dg.__version__
    assert document["verb"] == arguments[0]
    assert document["ok"] is (code == 0)
    return {key: value for key, value in document.items() if key not in ENVELOPE}


def test_verbs_that_need_no_drives_have_the_documented_keys(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "write_figures", lambda *_: [Path("figure.png")])
    keys = documented()
    for arguments in (
        ["plan", *PICK],
        ["check", *PICK],
        ["workspace"],
        ["figures", "pictures"],
    ):
        assert set(answer(arguments, capsys)) == keys[arguments[0]], arguments
    assert set(answer(["machine"], capsys)) == set(dg.Machine.default().to_dict())
    assert "file" in answer(["log", "plan.mcap"], capsys)


def test_verbs_that_move_drives_have_the_documented_keys(
    capsys: pytest.CaptureFixture[str],
) -> None:
    keys = documented()
    assert set(answer(["status"], capsys)) == keys["status"]
    demo = answer(["demo"], capsys)
    assert set(demo) == keys["demo"]
    run_keys = {*demo["run"], "log"}
    assert run_keys == keys["stream"] == keys["replay"]
    log = demo["files"]["log"]
    assert Path(log) == Path("run.mcap") and Path(log).exists()
    assert set(answer(["replay", log, "--approach"], capsys)) == keys["replay"]
    compared = answer(["log", log, "--compare", log], capsys)
    assert compared.pop("files") == {}
    assert set(compared) == set(demo["replay"])
    exported = answer(["log", log, "--csv", "run.csv", "--picture", "run.png"], capsys)
    assert exported["files"] == {"csv": "run.csv", "picture": "run.png"}


@pytest.mark.parametrize(
    ("arguments", "code", "kind"),
    [
        (["plan", "--pick", "-41,-60,300", "--place", "-41,60,390"], 1, "PathError"),
        (["check", "--pick", "-41,-60,300", "--place", "-41,60,390"], 1, "PathError"),
        (["stream", "none.mcap"], 1, "LogError"),
        (["replay", "none.mcap"], 1, "LogError"),
        (["status", "--bus", "nowhere"], 1, "BusError"),
        (["log", "none.mcap"], 1, "LogError"),
        (["machine", "none.toml"], 1, "ConfigError"),
        (["workspace", "--picture", "x.docx"], 1, "InputError"),
        (["figures"], 2, "UsageError"),
        (["demo", "--nonsense"], 2, "UsageError"),
    ],
)
def test_a_failure_is_said_once_and_as_documented(
    arguments: list[str], code: int, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = answer(arguments, capsys, code)
    assert set(said) >= FAILURE
    assert (said["exit_code"], said["type"]) == (code, kind)
    for key in FAILURE:
        assert f"| `{key}` |" in PAGE.read_text("utf-8")
