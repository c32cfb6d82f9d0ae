"""The house: no import circle, nothing private borrowed, and a page that knows where things are."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"
MODULES = {
    ".".join(file.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): file
    for file in SOURCE.rglob("*.py")
}
PAGE = ROOT / "docs" / "where.md"


@cache
def _parse(file: Path) -> ast.Module:
    """Read a module once for all tests."""
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def _imports(module: str) -> tuple[tuple[str, str], ...]:
    """Return (module, name) of each import, those in functions and under TYPE_CHECKING included."""
    return tuple(_find_imports(_parse(MODULES[module])))


def _find_imports(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield the imports of a module as ``_imports`` returns them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("duoglide"):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield (whole, "") if whole in MODULES else (str(node.module), alias.name)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name in MODULES)


def test_no_module_imports_what_imports_it() -> None:
    # The package's own face names every home for type checkers, and is imported by nobody inside.
    graph = {m: {to for to, _ in _imports(m)} - {m, "duoglide"} for m in MODULES if m != "duoglide"}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"a circle of imports: {' -> '.join(error.args[1])}")


def test_nothing_private_is_imported_from_another_folder() -> None:
    borrowed = [
        f"{module} imports {to} {name}".rstrip()
        for module in MODULES
        for to, name in _imports(module)
        if to != "duoglide"
        and MODULES[module].parent not in (MODULES[to].parent, *MODULES[to].parent.parents)
        and (any(p.startswith("_") and p != "__main__" for p in to.split(".")) or name[:1] == "_")
    ]
    inside = {
        f"{module} imports {to} {name}"
        for module in MODULES
        for to, name in _imports(module)
        if name.startswith("_") and not name.startswith("__")
    }
    assert not borrowed
    assert not inside, "a name with an underscore is for its own module"


def _rows() -> list[tuple[str, str, str]]:
    rows = []
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 3 and cells[1].startswith("`"):
            rows.append((cells[0], cells[1].strip("`"), cells[2].strip("`")))
    return rows


def test_the_page_answers_ten_questions_and_more() -> None:
    assert len(_rows()) >= 10
    assert len({file for _, file, _ in _rows()}) == len(_rows()), "one file each"


@pytest.mark.parametrize(("question", "file", "name"), _rows())
def test_what_the_page_names_is_defined_there_and_only_there(
    question: str, file: str, name: str
) -> None:
    del question
    found = [path for path in MODULES.values() if name in _defined(path)]
    assert [path.relative_to(SOURCE / "duoglide").as_posix() for path in found] == [file]


@cache
def _defined(file: Path) -> set[str]:
    """Return the functions, classes, methods (as Class.method) and constants of a module."""
    names: set[str] = set()
    for node in _parse(file).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            names |= {f"{node.name}.{n.name}" for n in node.body if isinstance(n, ast.FunctionDef)}
        if isinstance(node, ast.Assign):
            names |= {t.id for t in node.targets if isinstance(t, ast.Name)}
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    return names
