"""The pages and the library say the same: names, commands, code."""

from __future__ import annotations

import ast
import re
import runpy
import shlex
from pathlib import Path

import pytest
import typer

import duoglide as dg
from duoglide.cli.main import app, run
from duoglide.control.channel.events import Condition
from duoglide.machine.drive_contract import CONTRACT

ROOT = Path(__file__).parent.parent
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
DESCRIBED = [
    name for page in PAGES for name in re.findall(r"^::: (\S+)$", page.read_text("utf-8"), re.M)
]
"""What the pages describe."""


def blocks(page: Path, language: str) -> list[str]:
    """Return the fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)


def test_every_public_name_is_described_once_under_that_name() -> None:
    under_its_name = sorted(name for name in DESCRIBED if name.startswith("dg."))
    assert under_its_name == sorted(f"dg.{name}" for name in dg.__all__)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_command_is_one_that_the_command_line_takes(page: Path) -> None:
    group = typer.main.get_command(app)
    inline = re.findall(r"`(duoglide [a-z]+ [^`]*-[^`]*)`", page.read_text("utf-8"))
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    for line in [*inline, *(line for line in lines if line.startswith("duoglide "))]:
        verb, *words = shlex.split(line, comments=True)[1:]
        assert verb in group.commands, line  # type: ignore[attr-defined]  # a group has them
        if not any(word.isupper() for word in words):  # a placeholder
            group.commands[verb].make_context(verb, words)  # type: ignore[attr-defined]


def test_the_machine_files_that_are_shown_are_some(tmp_path: Path) -> None:
    machines = []
    for shown in blocks(ROOT / "docs" / "howto" / "machine.md", "toml"):
        file = tmp_path / "cell.toml"
        file.write_text(shown, "utf-8")
        machines.append(dg.Machine.load(file))
    machine, weighed, strong = machines
    assert strong.limits.rms_force.tolist() == [25.0] * 3
    assert weighed.masses.drive == (0.15, 0.15, 0.15)
    assert machine.keep_out[0].name == "feeder"
    assert machine.drives.quirks[2].setpoint_timer is False


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_piece_of_python_is_python_with_names_that_exist(page: Path) -> None:
    for block in blocks(page, "python"):
        if ">>>" in block:  # a doctest, which is run
            continue
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                assert node.value.id != "dg" or node.attr in dg.__all__, f"dg.{node.attr}"


def messages(folder: Path) -> list[str]:
    """Return every text of a folder's code, with … for what is put in."""
    found = []
    for file in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = (p.value if isinstance(p, ast.Constant) else "…" for p in node.values)
                found.append("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return found


def test_every_heading_of_troubleshooting_is_a_message_of_the_code() -> None:
    page = (ROOT / "docs" / "howto" / "troubleshooting.md").read_text("utf-8")
    said = messages(ROOT / "src" / "duoglide")
    headings = re.findall(r"^### (.+)$", page, re.M)
    assert len(headings) > 60
    for heading in headings:
        words = ".*".join(map(re.escape, re.split("…", heading)))
        assert any(re.search(words, text, re.S) for text in said), heading


def test_every_condition_that_ends_a_run_is_in_troubleshooting() -> None:
    page = (ROOT / "docs" / "howto" / "troubleshooting.md").read_text("utf-8")
    missing = [c.value for c in Condition if f"\n| {c.value} |" not in page]
    assert not missing, missing


def test_the_table_of_gaps_and_the_dictionary_shown_are_those_of_the_code(
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = (ROOT / "docs" / "howto" / "foreign.md").read_text("utf-8")
    hooks = runpy.run_path(str(ROOT / "docs" / "hooks.py"))
    made = hooks["on_page_markdown"](page)
    for item in CONTRACT:
        assert f"| 0x{item.index:04X}" in made, item
        assert item.cost in made, item
    eds = ROOT / "docs" / "howto" / "acme_sd1.eds"
    assert run(["drives", "probe", "--eds", str(eds)]) == 0
    assert f"\n```toml\n{capsys.readouterr().out}```\n" in made
