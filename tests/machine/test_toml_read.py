from __future__ import annotations

import pathlib

import pytest

import duoglide as dg
from duoglide.drives.simulation.scenario import Scenario
from duoglide.planning.programs.read import read_program

DEEP = "a = " + "[" * 2000
NESTED = "a = " + "[" * 60 + "]" * 60
TABLES = "a." * 60 + "b = 1"
HUGE = "a = 0x" + "f" * 4000
DIGITS = "a = " + "9" * 4000
TOO_MANY_DIGITS = "a = " + "9" * 9000


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (DEEP, "is not TOML: it nests too deeply"),
        (NESTED, "a: nested more than 32 levels deep"),
        (TABLES, "a: nested more than 32 levels deep"),
        (HUGE, "a: an integer of 16000 bits; TOML has 64"),
        (DIGITS, "a: an integer of 13288 bits; TOML has 64"),
        (TOO_MANY_DIGITS, "is not TOML"),
        ("a = 1\na = 2", "is not TOML"),
    ],
)
def test_toml_that_no_person_writes_is_refused_in_one_line(
    text: str, match: str, tmp_path: pathlib.Path
) -> None:
    file = tmp_path / "a.toml"
    file.write_text(text)
    for read, kind in (
        (dg.Machine.load, dg.ConfigError),
        (Scenario.load, dg.ConfigError),
        (read_program, dg.InputError),
    ):
        with pytest.raises(kind, match=match) as refusal:
            read(file)
        assert str(file) in str(refusal.value)
        assert len(str(refusal.value)) < 400 + len(str(file))


def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text("clearance = 3.0", encoding="utf-8-sig")
    assert dg.Machine.load(file).clearance == 3.0


def test_values_and_keys_are_shortened_in_refusals(tmp_path: pathlib.Path) -> None:
    file = tmp_path / "a.toml"
    for text in ("clearance = '" + "x" * 9000 + "'", "x" * 9000 + " = 1"):
        file.write_text(text)
        with pytest.raises(dg.ConfigError) as refusal:
            dg.Machine.load(file)
        assert len(str(refusal.value)) < 1000 + len(str(file))
