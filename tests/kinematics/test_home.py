from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics.headroom.room import room_at
from duoglide.kinematics.home import home_carriages, home_position


def test_the_default_machine_starts_at_its_deepest_point(machine: dg.Machine) -> None:
    assert home_position(machine).tolist() == [-41.0, 0.0, 302.0]
    np.testing.assert_array_equal(
        home_carriages(machine), dg.inverse(machine.geometry, (-41.0, 0.0, 302.0))
    )


def test_the_machines_own_home_comes_first(machine: dg.Machine) -> None:
    own = replace(machine, home_position=(-20.0, 30.0, 300.0))
    assert home_position(own).tolist() == [-20.0, 30.0, 300.0]
    np.testing.assert_allclose(
        dg.forward(own.geometry, home_carriages(own)), (-20.0, 30.0, 300.0), atol=1e-9
    )


@pytest.mark.parametrize(
    "position", [(0.0, 0.0, 900.0), (0.0, 300.0, 300.0), (187.0, 0.0, 250.0), (0.0, 0.0, 244.5)]
)
def test_a_home_where_the_machine_must_not_stand_is_refused(
    machine: dg.Machine, position: tuple[float, float, float]
) -> None:
    with pytest.raises(dg.ConfigError, match=r"home_position = .*: must be within reach"):
        home_position(replace(machine, home_position=position))


def test_any_machine_that_has_room_finds_a_home(
    machine: dg.Machine, geometries: list[dg.Geometry]
) -> None:
    found = 0
    for geometry in geometries:
        other = replace(machine, geometry=geometry)
        try:
            home = home_position(other)
        except dg.ConfigError:
            continue
        found += 1
        carriages = home_carriages(other)
        assert room_at(other, home).least() > 0.0
        assert np.abs(carriages).max() < geometry.rail_half_length
        assert carriages[1] - carriages[0] > other.carriage_width
        assert dg.clearance(geometry, home) > other.clearance
        np.testing.assert_allclose(dg.forward(geometry, carriages), home, rtol=0, atol=1e-9)
    assert found > len(geometries) // 2


def test_the_search_finds_the_deepest_point_again(machine: dg.Machine) -> None:
    barred = dg.Box(low=(-41.05, -400.0, 301.95), high=(-40.95, 400.0, 302.05))
    home = home_position(replace(machine, keep_out=(barred,)))
    assert dg.clearance(machine.geometry, home) == pytest.approx(67.7, abs=0.1)


def test_a_home_stays_out_of_keep_out_boxes(machine: dg.Machine) -> None:
    wall = dg.Box(low=(-300.0, -30.0, 0.0), high=(300.0, 30.0, 500.0))
    home = home_position(replace(machine, keep_out=(wall,)))
    assert abs(home[1]) > 30.0
    assert room_at(replace(machine, keep_out=(wall,)), home).least() > 0.0


def test_a_home_keeps_wide_carriages_apart(machine: dg.Machine) -> None:
    wide = replace(machine, carriage_width=420.0)  # they stand 404 mm apart at the deepest point
    carriages = home_carriages(wide)
    assert carriages[1] - carriages[0] > 420.0
    with pytest.raises(dg.ConfigError, match="lower clearance, carriage_margin or carriage_width"):
        home_position(replace(machine, carriage_width=440.0))  # more than coupler and legs span


def test_a_machine_without_room_says_so(machine: dg.Machine) -> None:
    with pytest.raises(dg.ConfigError, match="lower clearance, carriage_margin or carriage_width"):
        home_position(replace(machine, clearance=80.0))


def test_a_home_cannot_be_written_to(machine: dg.Machine) -> None:
    for value in (home_position(machine), home_carriages(machine)):
        assert not value.flags.writeable
