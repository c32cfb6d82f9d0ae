"""What a machine is refused for when it is connected; tests/drives/test_axis.py has the rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

import duoglide as dg
from duoglide.control.host import drivetrain
from duoglide.drives.bus import listen
from duoglide.drives.simulation import faults
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages
from duoglide.machine import DriveSettings

MACHINE = dg.Machine(drives=DriveSettings(boot_timeout=0.3))


@pytest.fixture(scope="module")
def process() -> Iterator[SimulatedDrives]:
    with SimulatedDrives(MACHINE.drives, home_carriages(MACHINE).tolist()) as drives:
        yield drives


@pytest.fixture
def drives(process: SimulatedDrives) -> SimulatedDrives:
    for axis in (1, 2, 3):
        process.inject(faults.Clear(axis))
        process.inject(faults.Reboot(axis, delay=0.0))
    return process


@pytest.mark.parametrize(
    ("injection", "changes", "words"),
    [
        (None, {"node_ids": (1, 2, 9)}, r"axis 3: node 9 .* nodes 1, 2, 3 do, of which .* name 3"),
        (faults.Silence(2), {}, r"axis 2 \(node 2\): operational, but SYNC is not answered"),
    ],
)
def test_a_machine_that_cannot_be_brought_up_is_refused_by_name(
    drives: SimulatedDrives,
    monkeypatch: pytest.MonkeyPatch,
    injection: faults.Injection | None,
    changes: dict[str, object],
    words: str,
) -> None:
    monkeypatch.setattr(drivetrain, "_PATIENCE", 0.5)
    if injection is not None:
        drives.inject(injection)
    machine = replace(MACHINE, drives=replace(MACHINE.drives, **changes))
    with pytest.raises(dg.DriveError, match=words):
        dg.Robot.connect(machine, bus=drives.address)


def test_a_machine_with_a_drive_in_fault_is_connected_by_one_host_and_not_enabled(
    drives: SimulatedDrives, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listen, "_ALONE_PATIENCE", 0.1)
    drives.inject(faults.DeviceFault(1))
    with dg.Robot.connect(MACHINE, bus=drives.address) as robot:
        with pytest.raises(dg.DriveFault, match=r"axis 1 .* continuous over-current") as fault:
            robot.enable()
        assert (fault.value.axis, fault.value.code) == (1, 0x2310)
        with pytest.raises(dg.BusError, match="another host is on it"):
            dg.Robot.connect(MACHINE, bus=drives.address)
        robot.reset_fault()
        robot.enable()
