from __future__ import annotations

import pickle
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg

positive = st.floats(0.01, 1e7)
coordinate = st.floats(-1e4, 1e4)


@st.composite
def machines(draw: Any) -> dg.Machine:
    limits = dg.CarriageLimits(
        velocity=draw(st.floats(0.01, 1e5)),
        acceleration=draw(st.lists(positive, min_size=3, max_size=3)),
        jerk=draw(positive),
    )
    triple = st.tuples(coordinate, coordinate, coordinate)
    low = draw(triple)
    own = {"stop_limits": limits.scaled(draw(st.floats(1.0, 3.0)))} if draw(st.booleans()) else {}
    return dg.Machine(
        geometry=dg.Geometry(
            riser_height=draw(st.floats(-50.0, 50.0)), strut_length=draw(st.floats(250.0, 400.0))
        ),
        limits=limits,
        **own,
        drives=dg.DriveSettings(node_ids=(7, 8, 9), cycle=draw(st.floats(0.0005, 0.1))),
        clearance=draw(st.floats(0.0, 50.0)),
        home_position=draw(st.none() | triple),
        tool_offset=draw(triple),
        keep_out=(dg.Box(low=low, high=tuple(value + 1.0 for value in low), name='a "post"'),),
    )


@given(machine=machines())
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_machine_survives_its_file_to_the_last_bit(
    machine: dg.Machine, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "round_trip.toml"
    machine.save(path)
    assert dg.Machine.load(path) == machine
    assert dg.Machine.from_dict(machine.to_dict()) == machine
    assert pickle.loads(pickle.dumps(machine)) == machine


def test_an_empty_file_is_the_default_machine(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text("")
    assert dg.Machine.load(path) == dg.Machine.default() == dg.Machine()


def test_stop_limits_that_nobody_set_follow_the_limits(machine: dg.Machine) -> None:
    slow = dg.CarriageLimits(velocity=100.0, acceleration=1e3, jerk=1e4)
    quick = dg.CarriageLimits(velocity=9000.0, acceleration=1e6, jerk=1e8)
    for limits in (slow, quick):
        changed = replace(machine, limits=limits)
        assert changed.stop_limits.velocity.tolist() == limits.velocity.tolist()
        assert changed.stop_limits.acceleration.tolist() == (limits.acceleration * 1.5).tolist()
        assert changed.stop_limits.jerk.tolist() == (limits.jerk * 1.5).tolist()
        assert replace(changed, clearance=3.0).stop_limits == changed.stop_limits


def test_stop_limits_follow_through_the_file_and_a_copy(
    machine: dg.Machine, tmp_path: Path
) -> None:
    path = tmp_path / "cell.toml"
    machine.save(path)
    assert "stop_limits" not in tomllib.loads(path.read_text())
    slow = dg.CarriageLimits(velocity=100.0)
    for other in (dg.Machine.load(path), pickle.loads(pickle.dumps(machine))):
        assert replace(other, limits=slow).stop_limits.velocity.tolist() == [100.0] * 3


def test_stop_limits_that_were_set_stay(machine: dg.Machine) -> None:
    own = dg.CarriageLimits(velocity=5000.0, acceleration=1e5, jerk=1e7)
    changed = replace(replace(machine, stop_limits=own), limits=dg.CarriageLimits(velocity=10.0))
    assert changed.stop_limits == own


@pytest.mark.parametrize("key", ["velocity", "acceleration", "jerk"])
def test_stop_limits_below_the_limits_are_refused(machine: dg.Machine, key: str) -> None:
    low = dg.CarriageLimits(**{key: 1.0})
    with pytest.raises(dg.ConfigError, match=rf"stop_limits\.{key} = .*at least limits\.{key}"):
        replace(machine, stop_limits=low)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("clearence = 2.0", "clearence: no such key; did you mean clearance?"),
        ("clearance = -1", "clearance = -1: must be 0 or above [mm]"),
        ("carriage_width = nan", "carriage_width = nan: must be one finite number [mm]"),
        ("[geometry]\narm_length = 0", "geometry.arm_length = 0: must be above 0 [mm]"),
        ("[geometry]\narm_lenght = 1.0", "did you mean geometry.arm_length?"),
        ('[geometry]\narm_length = "long"', "geometry.arm_length = 'long': must be one finite"),
        ("[limits]\nvelocity = [1, 2]", "limits.velocity = [1, 2]: must be three numbers"),
        ("[drives]\nnode_ids = [1, 1, 2]", "drives.node_ids = [1, 1, 2]: must all be different"),
        ("[[keep_out]]\nlow = [0, 0, 0]", "keep_out[0].high: missing; it has no default"),
        ("keep_out = 3", "keep_out = 3: must be a list of tables"),
        ("geometry = 3", "geometry = 3: must be a table"),
        ("home_position = [0, 0]", "home_position = [0, 0]: must be three numbers [mm]"),
        ("clearance = ", "is not TOML"),
    ],
)
def test_a_broken_file_is_refused_with_file_key_value_and_rule(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(text)
    with pytest.raises(dg.ConfigError) as caught:
        dg.Machine.load(path)
    assert str(path) in str(caught.value)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("path", [None, 5, b"cell.toml", ["cell.toml"]])
def test_what_is_no_path_is_refused_as_a_machine_file(path: object) -> None:
    with pytest.raises(dg.ConfigError, match="must be the path of a TOML file"):
        dg.Machine.load(path)  # type: ignore[arg-type]


def test_a_file_that_fails_on_the_way_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "cell.toml"
    dg.Machine(clearance=3.0).save(file)

    def full(self: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(dg.ConfigError, match="No space left"):
        dg.Machine.default().save(file)
    assert dg.Machine.load(file).clearance == 3.0
    assert [entry.name for entry in tmp_path.iterdir()] == ["cell.toml"]


def test_a_file_that_cannot_be_read_or_written_is_refused(
    machine: dg.Machine, tmp_path: Path
) -> None:
    with pytest.raises(dg.ConfigError, match="cannot read machine file"):
        dg.Machine.load(tmp_path / "missing.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(dg.ConfigError, match="cannot read machine file"):
        dg.Machine.load(tmp_path / "binary.toml")
    with pytest.raises(dg.ConfigError, match="cannot write machine file"):
        machine.save(tmp_path / "no" / "such" / "directory.toml")


@pytest.mark.parametrize("key", ["geometry", "limits", "stop_limits", "drives"])
def test_a_part_of_the_wrong_kind_is_refused(key: str) -> None:
    with pytest.raises(dg.ConfigError, match=f"{key} = 5: must be a "):
        dg.Machine(**{key: 5})  # type: ignore[arg-type]


def test_increments_that_do_not_reach_the_ends_of_the_rails_are_refused() -> None:
    finest = (2**31 - 1) / dg.Geometry().rail_half_length
    dg.Machine(drives=dg.DriveSettings(increments_per_mm=(1e3, 0.999 * finest, 1e3)))
    with pytest.raises(
        dg.ConfigError, match=r"drives\.increments_per_mm = .* counts up to 2147483647"
    ):
        dg.Machine(drives=dg.DriveSettings(increments_per_mm=(1e3, 1.001 * finest, 1e3)))


def test_brakes_that_take_for_ever_are_refused() -> None:
    with pytest.raises(dg.ConfigError, match=r"quick_stop_deceleration = .*would take 40 s"):
        dg.Machine(drives=dg.DriveSettings(quick_stop_deceleration=100.0))
