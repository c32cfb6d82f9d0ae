"""The numbers and tables of firmware_interface/README.md are those of the code."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from duoglide.drives.cia402 import State, emergency_words
from duoglide.drives.linear_axis import object_dictionary
from duoglide.drives.simulation.firmware.objects import error_register
from duoglide.machine import DriveSettings

README = (Path(__file__).parents[2] / "firmware_interface" / "README.md").read_text()


def frame_bits(size: int) -> int:
    """Worst case of an 11-bit frame with stuffing."""
    return 47 + 8 * size + (34 + 8 * size - 1) // 4


def test_the_bus_load_is_what_the_formula_says() -> None:
    cycle = frame_bits(0) + 6 * frame_bits(6)
    assert f"{cycle} bits" in README
    rows = re.findall(r"\| (\d+) ([Mk])bit/s \| ([\d.]+) % \| (?:([\d.]+) %|does not fit)", README)
    assert len(rows) == 3
    for number, unit, slow, fast in rows:
        rate = int(number) * (1e6 if unit == "M" else 1e3)
        assert float(slow) == pytest.approx(100.0 * cycle * 500 / rate, abs=0.5)
        if fast:
            assert float(fast) == pytest.approx(100.0 * cycle * 1000 / rate, abs=0.5)
        else:
            assert cycle * 1000 > rate


def test_the_table_of_states_is_the_one_in_the_code() -> None:
    rows = re.findall(r"^\| ([a-z ]+) \| 0x(\w\w), 0x(\w\w) \|", README, re.MULTILINE)
    assert {name: (int(m, 16), int(p, 16)) for name, m, p in rows} == {
        state.words: (state.mask, state.pattern) for state in State
    }


def test_every_emergency_code_has_words_and_the_register_that_the_table_says() -> None:
    rows = re.findall(r"^\| 0x(\w{4}) \| 0x(\w\w) \|", README, re.MULTILINE)
    assert len(rows) == 10
    for code, register in ((int(c, 16), int(r, 16)) for c, r in rows):
        assert "not named" not in emergency_words(code)
        if code not in (0x8210, 0x8240):  # of the communication, not of the application
            assert error_register(code) == register


def test_the_braking_distance_of_the_example_is_right() -> None:
    settings = DriveSettings()
    assert settings.quick_stop_deceleration[0] == 60e3
    assert f"brakes in {4000.0**2 / (2 * 60e3):.0f} mm" in README
    assert f"({4000.0 * settings.cycle:.0f} mm)" in README
    assert "20 ms" in README
    assert settings.setpoint_timeout == 0.02


def test_every_object_of_the_communication_profile_is_explained() -> None:
    section = README.split("## Communication objects")[1].split("\n## ")[0]
    explained = {int(word, 16) for word in re.findall(r"0x(1\w{3})", section.split("Left out")[0])}
    assert explained >= {index for index in object_dictionary(1) if 0x1000 <= index < 0x1400}
    left_out = {int(word, 16) for word in re.findall(r"0x(1\w{3})", section.split("Left out")[1])}
    assert not left_out & set(object_dictionary(1))
