"""The lower bounds of pyproject.toml are those that .ci/run tests."""

from __future__ import annotations

import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
TOOLS = {"duoglide", "mkdocs-material", "mkdocstrings", "mike", "playwright", "ruff", "mypy"}
TOOLS |= {"import-linter"}  # they look at the code, and nothing depends on what they compute


def requirements(lines: list[str]) -> dict[str, Requirement]:
    """Return requirements by name."""
    return {item.name: item for item in map(Requirement, lines)}


def test_each_lower_bound_is_what_is_tested_and_nothing_has_an_upper_one() -> None:
    extras = [line for lines in PROJECT["optional-dependencies"].values() for line in lines]
    asked = requirements(PROJECT["dependencies"] + extras)
    text = (ROOT / ".ci" / "lowest.txt").read_text("utf-8")
    tested = requirements([line for line in text.splitlines() if line and line[0] != "#"])
    assert set(tested) == set(asked) - TOOLS
    for name, item in asked.items():
        bounds = [(bound.operator, Version(bound.version)) for bound in item.specifier]
        if name in tested:
            (pin,) = tested[name].specifier
            assert bounds == [(">=", Version(pin.version))], name
        else:
            assert [operator for operator, _ in bounds] in ([], [">="]), name
