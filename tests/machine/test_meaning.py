from __future__ import annotations

import inspect
from dataclasses import fields

import pytest

import duoglide as dg
from duoglide.machine import Box, CarriageLimits, DriveSettings, Geometry, Homing, Masses, Quirks
from duoglide.machine.meaning import phrases, unit_of

KINDS = [dg.Machine, Geometry, CarriageLimits, DriveSettings, Homing, Quirks, Box, Masses]


@pytest.mark.parametrize("kind", KINDS)
def test_every_field_of_a_machine_has_words_of_its_own(kind: type) -> None:
    words = phrases(kind)
    assert list(words) == [item.name for item in fields(kind)]
    assert len(set(words.values())) == len(words)
    for phrase in words.values():
        assert phrase == phrase.strip()
        assert not phrase.endswith(".")
        assert phrase[0].islower() or not phrase[0].isalpha() or phrase[1].isupper(), phrase


@pytest.mark.parametrize("kind", KINDS)
def test_the_docstring_of_a_class_says_what_its_fields_mean(kind: type) -> None:
    doc = inspect.getdoc(kind) or ""
    text = " ".join(doc.lower().split())
    assert "\nAttributes:\n" in doc
    for name, phrase in phrases(kind).items():
        assert f"{name}: {phrase.lower()}." in text
    assert max(map(len, doc.splitlines())) <= 100


def test_an_error_says_what_the_key_that_was_meant_is() -> None:
    meant = r"did you mean geometry\.leg_length\? \(l2, the legs B1C1 and B2C2 \[mm\]\)"
    with pytest.raises(dg.ConfigError, match=meant):
        dg.Machine.from_dict({"geometry": {"leg_lenght": 1.0}})
    missing = r"keep_out\[0\]\.low: missing; it has no default \(its corner with the smallest"
    with pytest.raises(dg.ConfigError, match=missing):
        dg.Machine.from_dict({"keep_out": [{"high": [0, 0, 0]}]})


def test_an_error_names_the_unit_of_the_field() -> None:
    assert unit_of(Homing, "search_speed") == "mm/s"
    with pytest.raises(dg.ConfigError, match=r"search_speed = -1: must be above 0 \[mm/s\]"):
        Homing(search_speed=-1.0)
