from __future__ import annotations

import re
import tomllib
from pathlib import Path

import duoglide as dg

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_walk_visits_each_folder_once_and_every_file_is_there() -> None:
    walk = README.split("## The walk of one move")[1].split("\n## ")[0]
    files = re.findall(r"`([a-z_]+(?:/[a-z_]+)+\.py)`", walk)
    folders = [name.rpartition("/")[0] for name in files]
    assert len(files) > 12 and len(set(folders)) == len(folders)
    missing = [name for name in files if not (ROOT / "src" / "duoglide" / name).exists()]
    assert not missing


def test_the_layers_of_the_walk_are_those_that_are_enforced() -> None:
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = config["tool"]["importlinter"]["contracts"][0]["layers"]
    sentence = README.split("Imports run one way:")[1].split(".")[0]
    assert re.sub(r"\s+", " ", sentence).strip() == ", ".join(reversed(layers))


def test_the_set_up_commands_stand_on_lines_of_their_own() -> None:
    lines = README.splitlines()
    assert "python3 -m venv .venv && .venv/bin/pip install -e . && .venv/bin/duoglide demo" in lines
    assert (
        'python3 -m venv .venv && .venv/bin/pip install -e ".[test]"'
        " && .venv/bin/python -m pytest" in lines
    )


def test_every_dependency_has_its_reason() -> None:
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    table = README.split("## Dependencies, and why")[1].split("\n## ")[0]
    for requirement in config["project"]["dependencies"]:
        name = re.split(r"[<>=\[;]", requirement)[0]
        assert re.search(rf"[| ,]{re.escape(name)}[ ,|]", table), name


def test_every_link_within_the_project_leads_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if "://" not in target:
            assert (ROOT / target).exists(), target


def test_every_verb_is_in_the_table() -> None:
    import typer

    from duoglide.cli.main import app

    group = typer.main.get_command(app)
    for verb in group.commands:  # type: ignore[attr-defined]  # a group has them
        assert f"`duoglide {verb}" in README, verb


def test_the_public_names_are_the_outside_face() -> None:
    for name in dg.__all__:
        assert getattr(dg, name) is not None
