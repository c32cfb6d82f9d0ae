"""The schema of a machine file takes what the reader takes, and is the one that ships."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.machine.schema import SCHEMA, explain, machine_schema

DOCS = Path(__file__).parents[2] / "docs" / "howto"
WRONG = [
    'clearance = "wide"',
    "clearence = 2.0",
    "[drives]\nnode_ids = 1",
    "[drives]\nnode_ids = [1, 2]",
    '[drives]\nreference = "relative"',
    '[drives]\nprofile = "maxon"',
    "[[drives.quirks]]\nabsent = 0x2010",
    "[[keep_out]]\nlow = [0.0, 0.0, 0.0]",
    "[limits]\nvelocity = [1.0, 2.0]",
]
RIGHT = [
    "",
    "[limits]\nvelocity = 1000\njerk = [1e6, 2e6, 3e6]",
    "[drives]\ndirection = -1\nlag = 1e-4",
    '[drives]\nprofile = ["elmo-gold", "", "trinamic-tmcm"]',
    "[[drives.quirks]]\nabsent = [0x2010]\nwrites = [[0x2000, 1, -5, 2]]",
    "home_position = [-41.0, 0.0, 302.0]",
]


@pytest.fixture(scope="module")
def check() -> Any:
    schemas = pytest.importorskip("jsonschema")
    schemas.Draft7Validator.check_schema(machine_schema())
    return schemas.Draft7Validator(machine_schema()).is_valid


def test_the_schema_that_ships_is_not_stale() -> None:
    made = json.dumps(machine_schema(), indent=2) + "\n"
    assert SCHEMA.read_text("utf-8") == made, f"duoglide machine --schema machine > {SCHEMA}"


@pytest.mark.parametrize("text", RIGHT)
def test_what_the_reader_takes_the_schema_takes(text: str, check: Any) -> None:
    tables = tomllib.loads(text)
    dg.Machine.from_dict(tables)
    assert check(tables)


@pytest.mark.parametrize("text", WRONG)
def test_what_the_schema_refuses_the_reader_refuses(text: str, check: Any) -> None:
    tables = tomllib.loads(text)
    assert not check(tables)
    with pytest.raises(dg.ConfigError):
        dg.Machine.from_dict(tables)


def test_files_of_the_docs_and_of_the_verb_are_valid_and_name_their_schema(
    tmp_path: Path, check: Any
) -> None:
    for page in ("machine.md", "foreign.md"):
        texts = re.findall(r"^```toml\n(.*?)^```", (DOCS / page).read_text("utf-8"), re.M | re.S)
        assert texts and all(check(tomllib.loads(text)) for text in texts), page
    file = tmp_path / "cell.toml"
    assert run(["machine", "--out", str(file), "--profile", "elmo-gold"]) == 0
    assert check(tomllib.loads(file.read_text("utf-8")))
    first = file.read_text("utf-8").splitlines()[0]
    assert first == f"#:schema {SCHEMA.as_uri()}"
    assert set(dg.Machine.load(file).drives.profile) == {"elmo-gold"}


def test_a_key_is_explained_or_the_nearest_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["machine", "--explain", "drives.cycle"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("drives.cycle: SYNC period and setpoint period [s].")
    assert "default  0.002" in said
    assert explain("drives.quirks.absent")["type"] == "array"
    with pytest.raises(dg.ConfigError, match=r"did you mean drives\.cycle\?"):
        explain("cycle")
    with pytest.raises(dg.ConfigError, match="no such key"):
        explain("nonsense")
