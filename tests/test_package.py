"""What the package says of itself elsewhere: its metadata, its page on an index, its citation."""

from __future__ import annotations

import importlib.util
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

import duoglide as dg

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


@pytest.fixture
def hook(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The build hook, without the build backend, which only a build has."""
    interface = ModuleType("hatchling.metadata.plugin.interface")
    interface.MetadataHookInterface = SimpleNamespace  # type: ignore[attr-defined]
    for name in ("hatchling", "hatchling.metadata", "hatchling.metadata.plugin"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, interface.__name__, interface)
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def described(hook: Any) -> str:
    metadata: dict[str, Any] = {}
    hook.ReadmeHook(root=str(ROOT)).update(metadata)
    return str(metadata["readme"]["text"])


def links(text: str) -> list[str]:
    return re.findall(r"\]\(([^)]+)\)", text)


def test_an_index_shows_pictures_and_links_from_where_the_files_are(
    hook: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DUOGLIDE_FILES_URL", "https://example.org/raw/v1/")
    text = described(hook)
    assert "](https://example.org/raw/v1/docs/images/demo.png)" in text
    assert all(link.startswith("https://") for link in links(text))
    assert text.count("![") == README.count("![")


def test_without_an_address_nothing_on_the_index_is_broken(
    hook: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DUOGLIDE_FILES_URL", raising=False)
    text = described(hook)
    assert all(link.startswith("https://") for link in links(text))
    assert "![" not in text and "what\n`duoglide demo` draws" not in text
    for heading in re.findall(r"^## .*", README, re.M):
        assert heading in text


def test_every_link_of_the_readme_leads_somewhere() -> None:
    for link in links(README):
        assert link.startswith("https://") or (ROOT / link).exists(), link


def test_the_metadata_names_its_authors_and_its_place() -> None:
    assert PROJECT["authors"] and PROJECT["urls"]
    assert "readme" in PROJECT["dynamic"]


def test_the_citation_names_this_version_and_the_paper() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= set(citation)
    assert (citation["version"], citation["license"]) == (dg.__version__, PROJECT["license"])
    (paper,) = citation["references"]
    assert "Partially-decoupled" in paper["title"]
    assert [author["family-names"] for author in paper["authors"]] == [
        "Shen", "Zhao", "Li", "Wu", "Chablat",
    ]  # fmt: skip
