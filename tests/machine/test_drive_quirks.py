from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from duoglide.errors import ConfigError
from duoglide.machine import DriveSettings, Homing, Machine, Quirks


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"vendor_id": -1}, "vendor_id = -1: must be from 0"),
        ({"product_code": 1 << 32}, "product_code"),
        ({"quick_stop_option": "6"}, "quick_stop_option.*whole number"),
        ({"home_offset_sign": 0}, r"home_offset_sign = 0: must be \+1 or -1"),
        ({"setpoint_timer": 1}, "setpoint_timer = 1: must be true or false"),
        ({"absent": 0x6065}, "absent.*list"),
        ({"absent": [0x6041]}, "absent: 0x6041 is not optional; these are: 0x1006"),
        ({"absent": ["0x6065"]}, "absent: '0x6065' is not optional"),
        ({"writes": [[0x2000, 1, 5]]}, r"writes: \[8192, 1, 5\]: must be \[index, subindex"),
        ({"writes": [[0x2000, 1, 256, 1]]}, "writes: value = 256: must be from -128 to 255"),
        ({"writes": [[0x2000, 1, 0, 8]]}, "writes: bytes = 8: must be from 1 to 4"),
        ({"writes": [[0x100, 1, 0, 1]]}, "writes: index"),
    ],
)
def test_a_quirk_that_breaks_its_rule_is_refused_by_name(
    fields: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        Quirks(**fields)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"method": (37, 37)}, "method.*three whole numbers"),
        ({"method": (37, 38, 37)}, r"method\[1\] = 38: must be from -128 to 37"),
        ({"method": (37, 0, 37)}, "0 finds no reference"),
        ({"switch_position": (0.0, float("nan"), 0.0)}, "switch_position"),
        ({"search_speed": 0.0}, r"search_speed = 0: must be above 0 \[mm/s\]"),
        ({"acceleration": -1.0}, r"acceleration = -1: must be above 0 \[mm/s\^2\]"),
        ({"timeout": "soon"}, r"timeout = 'soon'.*\[s\]"),
    ],
)
def test_a_homing_setting_that_breaks_its_rule_is_refused_by_name(
    fields: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        Homing(**fields)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"host_id": 2}, "host_id = 2: is the node number of a drive"),
        ({"setpoint_timeout": 0.0}, r"setpoint_timeout = 0: must be from 0.001 to 65.535 \[s\]"),
        ({"heartbeat_timeout": 0.06}, "at least twice heartbeat_period = 0.05 s"),
        ({"missing_frames": 2.5}, "missing_frames = 2.5: must be a whole number"),
        ({"quirks": [{}, {}]}, "quirks.*three tables"),
        ({"quirks": [{}, {"vendor": 1}, {}]}, r"quirks\[1\].vendor: no such key.*vendor_id"),
        ({"homing": {"metod": [37, 37, 37]}}, "homing.metod: no such key.*homing.method"),
    ],
)
def test_a_watch_that_breaks_its_rule_is_refused_by_name(
    fields: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        DriveSettings(**fields)


def test_a_slow_cycle_is_granted_three_of_its_own() -> None:
    assert DriveSettings().setpoint_patience == 0.02
    assert DriveSettings(cycle=0.05).setpoint_patience == pytest.approx(0.15)


def test_quirks_and_homing_survive_the_machine_file(tmp_path: Path) -> None:
    quirks = (
        Quirks(vendor_id=0x539, absent=(0x6065,), writes=((0x2000, 1, -5, 2),)),
        Quirks(home_offset_sign=-1, setpoint_timer=False),
        Quirks(quick_stop_option=2),
    )
    homing = Homing(method=(17, 18, -3), switch_position=(-350.0, 350.0, 0.0))
    machine = Machine(drives=DriveSettings(quirks=quirks, homing=homing))
    machine.save(tmp_path / "cell.toml")
    assert Machine.load(tmp_path / "cell.toml") == machine


def test_a_machine_file_may_leave_quirks_and_homing_out() -> None:
    machine = Machine.from_dict({"drives": {"node_ids": [4, 5, 6]}})
    assert machine.drives == replace(DriveSettings(), node_ids=(4, 5, 6))
