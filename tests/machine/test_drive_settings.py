from __future__ import annotations

from typing import Any

import pytest

import duoglide as dg


@pytest.mark.parametrize(
    ("key", "value", "rule"),
    [
        ("node_ids", (1, 2), "must be three whole numbers"),
        ("node_ids", (1, 2, 2), "must all be different"),
        ("node_ids", (0, 1, 2), r"node_ids\[0\] = 0: must be from 1 to 127"),
        ("node_ids", (1, 2, 128), r"node_ids\[2\] = 128: must be from 1 to 127"),
        ("node_ids", (1, 2.0, 3), r"node_ids\[1\] = 2.0: must be a whole number"),
        ("node_ids", (1, True, 3), r"node_ids\[1\] = True: must be a whole number"),
        ("node_ids", 5, "must be three whole numbers"),
        ("increments_per_mm", 0.0, "above 0"),
        ("increments_per_mm", (1000.0, -1.0, 1.0), "above 0"),
        ("direction", (1, 0, 1), r"each must be \+1 or -1"),
        ("direction", (1, 2, 1), r"direction\[1\] = 2"),
        ("bit_rate", 123, "must be one of 125000, 250000, 500000, 800000, 1000000 bit/s"),
        ("cycle", -0.002, "cycle = -0.002: must be"),
        ("cycle", 1.0, r"must be from 0.0005 to 0.1 \[s\]"),
        ("quick_stop_deceleration", -1.0, "above 0"),
        ("following_error_window", 0.0, "above 0"),
        ("following_error_window", "wide", "one finite number"),
    ],
)
def test_a_setting_that_breaks_its_rule_is_refused_by_name(key: str, value: Any, rule: str) -> None:
    with pytest.raises(dg.ConfigError, match=rule) as caught:
        dg.DriveSettings(**{key: value})
    assert str(caught.value).startswith(key)


def test_one_scale_counts_for_all_three_drives() -> None:
    drives = dg.DriveSettings(increments_per_mm=512, quick_stop_deceleration=3e4)  # type: ignore[arg-type]
    assert drives.increments_per_mm == (512.0, 512.0, 512.0)
    assert drives.quick_stop_deceleration == (3e4, 3e4, 3e4)


def test_lists_from_toml_become_tuples() -> None:
    drives = dg.DriveSettings(node_ids=[4, 5, 6], direction=[1, -1, 1])  # type: ignore[arg-type]
    assert (drives.node_ids, drives.direction) == ((4, 5, 6), (1, -1, 1))
    assert hash(drives) == hash(dg.DriveSettings(node_ids=(4, 5, 6), direction=(1, -1, 1)))


def test_one_direction_serves_all_three_axes() -> None:
    assert dg.DriveSettings(direction=-1).direction == (-1, -1, -1)  # type: ignore[arg-type]
    with pytest.raises(dg.ConfigError, match="direction"):
        dg.DriveSettings(direction=True)  # type: ignore[arg-type]


def test_drives_brake_no_harder_than_their_object_can_say() -> None:
    fine = dg.DriveSettings(increments_per_mm=(1000.0, 1e5, 1e6))
    assert fine.quick_stop_deceleration == (60e3, 42949.67295, 4294.967295)
    coarse = dg.DriveSettings(increments_per_mm=(71_582.0,) * 3)
    assert coarse.quick_stop_deceleration == (60e3,) * 3
