from __future__ import annotations

import builtins
import shlex
from typing import Any

import pytest
import typer

from duoglide.cli import console
from duoglide.cli.main import app

COLUMNS = 80
LONG_WORD = 40  # letters of what may reach beyond them: a path or an address is never broken


@pytest.fixture(autouse=True)
def _messages_fit_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hold every line that any test of a command makes it say to 80 columns; JSON has its own."""
    monkeypatch.delenv("COLUMNS", raising=False)

    def checked(*words: Any, **options: Any) -> None:
        text = " ".join(map(str, words))
        if not text.startswith("{"):
            for line in text.splitlines():
                whole = max(map(len, line.split()), default=0)
                assert len(line) <= COLUMNS or whole > LONG_WORD, line
        builtins.print(*words, **options)

    monkeypatch.setattr(console, "print", checked, raising=False)


@pytest.fixture(scope="session")
def examples() -> dict[str, list[list[str]]]:
    """The words of every example in the help, by verb, without ``duoglide``."""
    group = typer.main.get_command(app)
    found = {}
    for verb, command in group.commands.items():  # type: ignore[attr-defined]  # a group
        lines = [line for line in command.epilog.splitlines() if line.startswith("duoglide ")]
        found[verb] = [shlex.split(line)[1:] for line in lines]
    return found
