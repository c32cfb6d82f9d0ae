"""The index of the paper names everything that has a number, and only what exists."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

import pytest

import duoglide as dg

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "paper_index.md"
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.read_text("utf-8").splitlines()
    if re.match(r"\| (Eq\.|Table|Figure) ", line)
]


def test_every_number_of_the_paper_has_its_row_in_order() -> None:
    numbers = [
        *(f"Eq. {n}" for n in range(1, 17)),
        *(f"Table {n}" for n in range(1, 4)),
        *(f"Figure {n}" for n in range(1, 12)),
    ]
    assert [row[0] for row in ROWS] == numbers


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_function_test_and_page_of_a_row_exist(row: list[str]) -> None:
    _, _, function, test, page = row
    assert found(function.strip("`"))
    file, _, name = test.strip("`").partition("::")
    path = ROOT / (file if "/" in file else f"tests/paper/{file}")
    defined = {n.name for n in ast.parse(path.read_text("utf-8")).body if hasattr(n, "name")}
    assert name in defined, test
    (target,) = re.findall(r"\]\(([^)]+)\)", page)
    place, _, anchor = target.partition("#")
    text = (PAGE.parent / place).read_text("utf-8") if place else PAGE.read_text("utf-8")
    headings = [re.sub(r"\W+", "-", h.lower()) for h in re.findall(r"^#+ (.+)$", text, re.M)]
    assert not anchor or anchor in headings
    if number := re.search(r"\), (\d+)$", page):  # of an erratum
        assert re.search(rf"^\| {number[1]} \|", text, re.M), page


def found(name: str) -> bool:
    """Whether a dotted name leads to something: ``dg.`` or a module, then its attributes."""
    if name.startswith("dg."):
        return hasattr(dg, name.removeprefix("dg."))
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            value = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for part in parts[length:]:
            value = getattr(value, part)
        return True
    return False


def test_a_name_that_is_not_there_is_found_out() -> None:
    with pytest.raises(AttributeError):
        found("duoglide.paper.topology.Soc.nothing")
    assert not found("dg.nothing")
    assert not found("elsewhere.nothing")
