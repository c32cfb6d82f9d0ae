"""Simulated drives in a process, once for all tests of the host's side."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import canopen
import pytest
from drive_power import enable

from duoglide.drives.axis.axis import Axis
from duoglide.drives.bus.buses import open_bus
from duoglide.drives.pdo import Nmt
from duoglide.drives.simulation import faults
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.machine import DriveSettings

POSITIONS = (-100.0, 0.0, 150.5)
SETTINGS = DriveSettings(boot_timeout=1.0, sdo_timeout=0.1, sdo_retries=5, direction=(1, -1, 1))


@contextmanager
def joined(address: str) -> Iterator[canopen.Network]:
    network = canopen.Network(open_bus(address))
    network.NOTIFIER_CYCLE = 0.02
    network.connect()
    try:
        yield network
    finally:
        network.disconnect()


@pytest.fixture(scope="session")
def process() -> Iterator[SimulatedDrives]:
    with SimulatedDrives(SETTINGS, POSITIONS) as drives:
        yield drives


@pytest.fixture
def drives(process: SimulatedDrives) -> SimulatedDrives:
    """The three drives, just switched on."""
    for axis in (1, 2, 3):
        process.inject(faults.Clear(axis))
        process.inject(faults.Reboot(axis, delay=0.0))
    return process


@pytest.fixture
def network(drives: SimulatedDrives) -> Iterator[canopen.Network]:
    with joined(drives.address) as network:
        yield network


@pytest.fixture
def axes(network: canopen.Network) -> Iterator[list[Axis]]:
    axes = [Axis(network, SETTINGS, number) for number in (1, 2, 3)]
    for axis in axes:
        axis.wait_for_boot()
    yield axes
    for axis in axes:
        axis.close()


@pytest.fixture
def axis(axes: list[Axis]) -> Axis:
    return axes[0]


@pytest.fixture
def enabled(axes: list[Axis]) -> list[Axis]:
    for axis in axes:
        axis.configure((-360.0, 360.0))
        axis.command(Nmt.START)
    for axis, position in zip(axes, POSITIONS, strict=True):
        enable(axis)
        axis.start_homing(position)
    for axis, position in zip(axes, POSITIONS, strict=True):
        while not axis.homing_done():
            time.sleep(0.001)
        axis.end_homing(position)
    return axes
