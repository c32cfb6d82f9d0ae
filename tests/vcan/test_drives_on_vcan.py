"""Simulated drives and their host on the kernel's SocketCAN: behaviour, not timing.

Run under a kernel that has it: .ci/run does, where it can.
"""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import can
import canopen
import pytest
from drive_power import disable, enable

from duoglide.drives import pdo
from duoglide.drives.axis.axis import Axis
from duoglide.drives.bus.buses import frame_sender, open_bus
from duoglide.drives.cia402 import State
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.machine import DriveSettings

BUS = "socketcan:vcan0"
SETTINGS = DriveSettings(cycle=0.01, setpoint_timeout=1.0, sdo_timeout=0.3, sdo_retries=6)
POSITIONS = (-50.0, 0.0, 80.0)

pytestmark = pytest.mark.skipif(
    not Path("/sys/class/net/vcan0").exists(), reason="this kernel has no vcan0"
)


def ip(*words: str) -> None:
    subprocess.run(["ip", "link", "set", "vcan0", *words], check=True)


@pytest.fixture
def drives() -> Iterator[SimulatedDrives]:
    with SimulatedDrives(SETTINGS, POSITIONS, bus=BUS) as drives:
        yield drives


@contextmanager
def connected() -> Iterator[tuple[canopen.Network, list[Axis]]]:
    network = canopen.Network(open_bus(BUS))
    network.NOTIFIER_CYCLE = 0.05
    network.connect()
    axes = [Axis(network, SETTINGS, number) for number in (1, 2, 3)]
    try:
        yield network, axes
    finally:
        network.notifier.stop()
        network.bus.shutdown()


def bring_up(axes: Sequence[Axis]) -> None:
    for axis, position in zip(axes, POSITIONS, strict=True):
        axis.wait_for_boot()
        axis.identify()
        axis.configure((-360.0, 360.0))
        axis.command(pdo.Nmt.START)
        enable(axis)
        axis.start_homing(position)
        while not axis.homing_done():
            time.sleep(0.01)
        axis.end_homing(position)


def stream(bus: can.BusABC, axes: Sequence[Axis], cycles: int) -> None:
    """Move every carriage by 5 mm/s."""
    send = frame_sender(bus)
    start = time.monotonic()
    for k in range(cycles):
        frames = [(pdo.SYNC, b"")]
        for axis, position in zip(axes, POSITIONS, strict=True):
            target = axis.scale.to_increments(position + 0.05 * k)
            frames.append((pdo.RPDO1 + axis.node_id, pdo.SETPOINT.pack(15, target)))
        send(frames)
        time.sleep(max(0.0, start + SETTINGS.cycle * (k + 1) - time.monotonic()))


def test_drives_are_brought_up_and_follow_at_100_hz(drives: SimulatedDrives) -> None:
    with connected() as (network, axes):
        bring_up(axes)
        stream(network.bus, axes, 200)
        for real, position in zip(drives.snapshot(), POSITIONS, strict=True):
            assert real.state is State.OPERATION_ENABLED
            assert real.position == pytest.approx(position + 0.05 * 199, abs=0.5)


def test_drives_stop_when_the_link_goes_down_and_answer_when_it_is_up(
    drives: SimulatedDrives,
) -> None:
    with connected() as (network, axes):
        bring_up(axes)
        stream(network.bus, axes, 50)
        network.notifier.stop()  # or its thread would die of the link
        ip("down")
    try:
        time.sleep(2.0)
        for real in drives.snapshot():
            assert real.state is State.QUICK_STOP_ACTIVE
            assert real.velocity == pytest.approx(0.0, abs=0.1)
    finally:
        ip("up")
    with connected() as (_, axes):
        for axis in axes:
            assert axis.read(0x603F) in (0x8700, 0x8250)
            disable(axis)
            assert axis.read_state() is State.SWITCH_ON_DISABLED


@pytest.mark.skipif(shutil.which("tc") is None, reason="tc of iproute2 is not installed")
def test_five_percent_loss_stops_neither_bring_up_nor_the_motion(
    drives: SimulatedDrives, lossy: Callable[[int], AbstractContextManager[None]]
) -> None:
    with lossy(5), connected() as (network, axes):
        bring_up(axes)
        stream(network.bus, axes, 200)
        states = [real.state for real in drives.snapshot()]
    assert states == [State.OPERATION_ENABLED] * 3


@pytest.mark.skipif(shutil.which("candump") is None, reason="can-utils is not installed")
def test_candump_sees_what_the_drives_say(drives: SimulatedDrives, tmp_path: Path) -> None:
    log = tmp_path / "dump.log"
    with log.open("w") as out:
        dump = subprocess.Popen(["candump", "-L", "-n", "2", "vcan0"], stdout=out)
        time.sleep(0.3)
        with open_bus(BUS) as bus:
            bus.send(can.Message(arbitration_id=0, data=b"\x81\x02", is_extended_id=False))
            try:
                dump.wait(10.0)
            finally:
                dump.kill()
                dump.wait()
    assert "702#00" in log.read_text()
