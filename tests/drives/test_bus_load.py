"""How much of the bus a cycle takes, and what is said of it."""

from __future__ import annotations

import warnings

import pytest

import duoglide as dg
from duoglide.drives.bus.load import (
    BusLoadWarning,
    bus_load,
    cycle_bits,
    frame_bits,
    require_bus_load,
    shortest_cycle,
)


@pytest.mark.parametrize(("size", "bits"), [(0, 55), (1, 65), (6, 115), (8, 135)])
def test_a_frame_has_the_bits_of_the_contracts_page(size: int, bits: int) -> None:
    assert frame_bits(size) == bits


@pytest.mark.parametrize(
    ("bit_rate", "cycle", "load"),
    [(1_000_000, 0.002, 0.37), (1_000_000, 0.001, 0.745), (500_000, 0.002, 0.745)],
)
def test_the_load_is_that_of_the_contracts_page(bit_rate: int, cycle: float, load: float) -> None:
    settings = dg.DriveSettings(bit_rate=bit_rate, cycle=cycle)
    assert cycle_bits(settings) == 745
    beats = 4 * 65 / 0.05 / bit_rate
    assert bus_load(settings) - beats == pytest.approx(load, abs=0.003)


def test_a_cycle_that_does_not_fit_is_refused_with_one_that_does() -> None:
    settings = dg.DriveSettings(bit_rate=500_000, cycle=0.001)
    with pytest.raises(dg.ConfigError, match=r"150 % of the bus.*cycle = 0.002 would do"):
        require_bus_load(settings)
    machine = dg.Machine(drives=settings)
    with pytest.raises(dg.ConfigError, match="150 % of the bus"):
        dg.Robot.connect(machine, bus="virtual")


def test_a_cycle_that_fills_the_bus_is_warned_of() -> None:
    with pytest.warns(BusLoadWarning, match=r"94 % of the bus.*cycle = 0.002 would do"):
        require_bus_load(dg.DriveSettings(bit_rate=800_000, cycle=0.001))


@pytest.mark.parametrize("bit_rate", [125_000, 250_000, 500_000, 800_000, 1_000_000])
@pytest.mark.parametrize("beat", [0.005, 0.05])
def test_the_cycle_that_would_do_does(bit_rate: int, beat: float) -> None:
    settings = dg.DriveSettings(bit_rate=bit_rate, heartbeat_period=beat, cycle=0.0005)
    cycle = shortest_cycle(settings)
    with warnings.catch_warnings(action="error"):
        require_bus_load(dg.DriveSettings(bit_rate=bit_rate, heartbeat_period=beat, cycle=cycle))


def test_heartbeats_that_fill_the_bus_by_themselves_are_named() -> None:
    settings = dg.DriveSettings(bit_rate=125_000, heartbeat_period=0.002)
    with pytest.raises(dg.ConfigError, match="a longer heartbeat_period would do"):
        require_bus_load(settings)
