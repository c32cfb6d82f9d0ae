from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from duoglide.drives.simulation import faults
from duoglide.drives.simulation.plant import Plant, PlantParameters
from duoglide.drives.simulation.scenario import FaultSchedule, Scenario, Since
from duoglide.errors import ConfigError

FILE = """
carriages = [-200.0, 200.0, 10]

[plant]
bandwidth = 40
encoder_step = 0.005

[[fault]]
kind = "slow_sdo"
axis = 1
delay = 0.3

[[fault]]
kind = "jam"
axis = 2
after = 1.5
since = "enabled"
"""


def test_a_file_says_what_the_drives_are_like_and_what_happens_to_them(tmp_path: Path) -> None:
    (tmp_path / "play.toml").write_text(FILE)
    play = Scenario.load(tmp_path / "play.toml")
    assert play.plants == (PlantParameters(bandwidth=40.0, encoder_step=0.005),) * 3
    assert play.carriages == (-200.0, 200.0, 10.0)
    assert [f.injection for f in play.faults] == [faults.SlowSdo(1, 0.3), faults.Jam(2)]
    assert [f.since for f in play.faults] == [Since.START, Since.ENABLED]
    assert play.faults[0].words == "axis 1: slow sdo"


def test_the_scenario_in_the_docs_is_one() -> None:
    docs = (Path(__file__).parents[2] / "docs" / "howto" / "drives.md").read_text()
    play = Scenario.from_dict(tomllib.loads(docs.split("```toml")[1].split("```")[0]))
    assert {fault.words for fault in play.faults} == {"axis 1: slow sdo", "axis 2: jam"}


def test_each_carriage_may_have_a_plant_of_its_own() -> None:
    play = Scenario.from_dict({"plant": [{"damping": d} for d in (0.5, 0.6, 0.7)]})
    assert [plant.damping for plant in play.plants] == [0.5, 0.6, 0.7]
    assert Scenario.from_dict({}).plants == (PlantParameters(),) * 3


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"plnt": {}}, "plnt: no such key; did you mean plant?"),
        ({"plant": {"bandwith": 3}}, "plant.0..bandwith: no such key; did you mean"),
        ({"plant": {"bandwidth": -3}}, "plant.0..bandwidth = -3: must be above 0 .Hz."),
        ({"plant": {"bandwidth": 900.0}}, "must be at most 400 .Hz."),
        ({"plant": {"damping": "high"}}, "damping = 'high': must be one finite number"),
        ({"plant": {"limit_switches": [3, -3]}}, "the first must be below the second"),
        ({"plant": {"limit_switches": 3}}, "limit_switches = 3: must be two places"),
        ({"plant": [{}, {}]}, "plant: 2 tables, must be one for all axes or one for each"),
        ({"carriages": [1, 2]}, "carriages = .1, 2.: must be three numbers"),
        ({"fault": {"kind": "jam"}}, "must be .*fault.* tables"),
        ({"fault": ["jam"]}, "fault.0. = 'jam': must be a table"),
        (
            {"fault": [{"kind": "jamm"}]},
            "fault.0..kind = 'jamm': must be one of clear",
        ),
        ({"fault": [{"kind": "jam"}]}, "fault.0..axis: missing"),
        ({"fault": [{"kind": "jam", "axis": 4}]}, "fault.0..axis = 4: must be from 1 to 3"),
        ({"fault": [{"kind": "jam", "axis": 1, "jammed": 1}]}, "jammed = 1: must be true or false"),
        ({"fault": [{"kind": "jam", "axis": 1, "after": -1}]}, "after = -1: must be 0 or above"),
        ({"fault": [{"kind": "jam", "axis": 1, "since": "then"}]}, "must be start or enabled"),
        ({"fault": [{"kind": "reboot", "axis": 1, "delay": "1"}]}, "must be one finite number"),
    ],
)
def test_what_cannot_be_meant_is_named(tables: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Scenario.from_dict(tables)


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read scenario"):
        Scenario.load(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("[plant")
    with pytest.raises(ConfigError, match=r"bad.toml is not TOML"):
        Scenario.load(tmp_path / "bad.toml")


def test_every_injection_can_be_asked_for() -> None:
    kinds = [
        k for k in vars(faults).values() if isinstance(k, type) and faults.Injection in k.__bases__
    ]
    with pytest.raises(ConfigError) as refusal:
        Scenario.from_dict({"fault": [{"kind": ""}]})
    asked = str(refusal.value).split("one of ")[1].replace("_", "").split(", ")
    assert sorted(asked) == sorted(kind.__name__.lower() for kind in kinds)


def test_faults_come_at_their_time_and_once() -> None:
    def jam(axis: int, **when: Any) -> dict[str, Any]:
        return {"kind": "jam", "axis": axis, **when}

    play = Scenario.from_dict(
        {"fault": [jam(1, after=2), jam(2, after=1, since="enabled"), jam(3, since="enabled")]}
    )
    schedule = FaultSchedule(play.faults, 100.0)
    off, on = (False,) * 3, (False, True, False)

    def due(now: float, enabled: tuple[bool, ...]) -> list[int]:
        return [fault.injection.axis for fault in schedule.due(now, enabled)]

    assert due(101.9, off) == []
    assert due(102.0, off) == [1]
    assert due(110.0, on) == []
    assert due(110.9, off) == []
    assert due(111.0, off) == [2]
    assert schedule.waiting
    assert due(112.0, (True,) * 3) == [3]
    assert not schedule.waiting


def test_a_coarse_encoder_shows_steps() -> None:
    plant = Plant(PlantParameters(encoder_step=0.5))
    seen = []
    for position in (0.0, 0.2, 0.3, 0.7, 0.8, -0.3):
        plant.position = position
        seen.append(plant.measured)
    assert seen == [0.0, 0.0, 0.5, 0.5, 1.0, -0.5]
