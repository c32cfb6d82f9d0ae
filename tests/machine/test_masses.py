from __future__ import annotations

import json
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

import pytest

import duoglide as dg


def test_one_number_counts_for_all_three_carriages() -> None:
    masses = dg.Masses(carriage=0.5, drive=(0.1, 0.2, 0.3), coulomb_friction=2)  # type: ignore[arg-type]
    assert masses.carriage == (0.5, 0.5, 0.5)
    assert masses.drive == (0.1, 0.2, 0.3)
    assert masses.coulomb_friction == (2.0, 2.0, 2.0)


def test_masses_left_out_are_bars_over_the_lengths_of_the_geometry() -> None:
    geometry = dg.Geometry(riser_height=-20.0, arm_drop=5.0, strut_drop=-7.0)
    masses = dg.Masses(bar_diameter=8.0, bar_density=7850.0, arm=0.25)
    whole = masses.complete(geometry)
    per_length = 7850e-9 * pi * 16.0
    assert whole.leg == pytest.approx(160.0 * per_length)
    assert whole.coupler == pytest.approx(120.0 * per_length)
    assert whole.riser == pytest.approx(20.0 * per_length)
    assert whole.strut == pytest.approx(2 * 300.0 * per_length)
    assert whole.platform == pytest.approx((90.0 + 5.0 + 7.0) * per_length + 0.1)
    assert whole.arm == 0.25
    assert masses.assumed == ("leg", "coupler", "riser", "strut", "platform")
    assert whole.assumed == ()
    assert replace(whole, payload=1.0).complete(dg.Geometry()).leg == whole.leg


@pytest.mark.parametrize(
    ("key", "value", "rule"),
    [
        ("carriage", -0.1, "must be 0 or above"),
        ("drive", [0.1, 0.2], "must be three numbers"),
        ("leg", float("nan"), "must be one finite number"),
        ("platform", "heavy", "must be one finite number"),
        ("payload", -1.0, "must be 0 or above"),
        ("payload", None, "must be one finite number"),
        ("coulomb_friction", [1.0, 1.0, -1.0], "must be 0 or above"),
        ("gravity", 9.81, "must be three numbers"),
        ("bar_density", 0.0, "must be above 0"),
    ],
)
def test_what_weighs_less_than_nothing_is_refused(key: str, value: Any, rule: str) -> None:
    with pytest.raises(dg.ConfigError, match=rf"^masses\.{key} = .*{rule}"):
        dg.Machine.from_dict({"masses": {key: value}})


def test_what_is_left_out_stays_so_in_the_file_and_is_told_there(tmp_path: Path) -> None:
    masses = dg.Masses(strut=0.2, gravity=(0.0, 0.0, 9806.65), payload=0.3)
    machine = dg.Machine(masses=masses)
    machine.save(tmp_path / "cell.toml")
    assert dg.Machine.load(tmp_path / "cell.toml") == machine
    assert dg.Machine.from_dict(json.loads(json.dumps(machine.to_dict()))) == machine
    text = (tmp_path / "cell.toml").read_text()
    assert "\nstrut = 0.2  # mass of the strut" in text
    assert "\n# Not given here, leg: mass of one leg; left out, of its bar" in text
    assert "Not given here, strut" not in text
    longer = replace(machine, geometry=dg.Geometry(leg_length=200.0))
    assert longer.masses.complete(longer.geometry).leg == pytest.approx(
        1.25 * (machine.masses.complete(machine.geometry).leg or 0.0)
    )
