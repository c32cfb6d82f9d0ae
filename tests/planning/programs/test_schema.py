"""The schema of a program takes what the reader takes, and is the one that ships."""

from __future__ import annotations

import inspect
import json
import re
import textwrap
import tomllib
from typing import Any

import pytest

import duoglide as dg
from duoglide.planning.programs import read
from duoglide.planning.programs.schema import _KEYS, SCHEMA, program_schema
from duoglide.planning.programs.toml import KEYS, read_toml

START = "start = [-41, 0, 300]\n"
WRONG = [
    "start = [0, 0]\nmoves = []",
    START + '[[moves]]\ntype = "lime"\nto = [-41, 0, 310]',
    START + '[[moves]]\ntype = "line"',
    START + '[[moves]]\ntype = "line"\nto = [-41, 0, 310]\nvia = [-41, 0, 305]',
    START + '[[moves]]\ntype = "line"\nto = [-41, 0, 310]\nspede = 5',
    START + 'author = "me"\n[[moves]]\ntype = "line"\nto = [-41, 0, 310]',
    START + '[[moves]]\ntype = "set_output"\naxis = 4\nbit = 1\nvalue = true',
    START + '[[moves]]\ntype = "dwell"',
    START,
]
RIGHT = [
    START + '[[moves]]\ntype = "line"\nto = [-41, 0, 310]\nspeed = 5',
    START + 'ignore = ["author"]\nauthor = "me"\n[[moves]]\ntype = "line"\nto = [-41, 0, 310]',
    START + '[[moves]]\ntype = "line"\nto = [-41, 0, 310]\n[[moves]]\ntype = "dwell"\nseconds = 1',
]


@pytest.fixture(scope="module")
def check() -> Any:
    schemas = pytest.importorskip("jsonschema")
    schemas.Draft7Validator.check_schema(program_schema())
    return schemas.Draft7Validator(program_schema()).is_valid


def test_the_schema_that_ships_is_not_stale() -> None:
    made = json.dumps(program_schema(), indent=2) + "\n"
    assert SCHEMA.read_text("utf-8") == made, f"duoglide machine --schema program > {SCHEMA}"


def test_every_key_of_a_program_has_a_meaning() -> None:
    assert set(_KEYS) == KEYS - {"type", "moves"}


def test_the_program_of_the_documentation_is_valid(check: Any) -> None:
    text = inspect.getdoc(read) or ""
    (block,) = re.findall(r"\(``\.toml``\)::\n\n(.*?)\n\n\*\*CSV", text, re.S)
    tables = tomllib.loads(textwrap.dedent(block))
    assert check(tables)
    assert len({move["type"] for move in tables["moves"]}) == 9


@pytest.mark.parametrize("text", RIGHT)
def test_what_the_reader_takes_the_schema_takes(text: str, check: Any) -> None:
    read_toml(text)
    assert check(tomllib.loads(text))


@pytest.mark.parametrize("text", WRONG)
def test_what_the_schema_refuses_the_reader_refuses(text: str, check: Any) -> None:
    assert not check(tomllib.loads(text))
    with pytest.raises(dg.InputError):
        read_toml(text)
