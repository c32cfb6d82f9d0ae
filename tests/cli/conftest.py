from __future__ import annotations

import shlex

import pytest
import typer

from duoglide.cli.main import app


@pytest.fixture(scope="session")
def examples() -> dict[str, list[list[str]]]:
    """The words of every example in the help, by verb, without ``duoglide``."""
    group = typer.main.get_command(app)
    found = {}
    for verb, command in group.commands.items():  # type: ignore[attr-defined]  # a group
        lines = [line for line in command.epilog.splitlines() if line.startswith("duoglide ")]
        found[verb] = [shlex.split(line)[1:] for line in lines]
    return found
