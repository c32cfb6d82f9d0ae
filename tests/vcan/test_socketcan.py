"""The kernel's own SocketCAN: behaviour, not timing. 100 Hz, on vcan0.

Run under ``../shared/tools/run-in-vcan-vm.sh -i 1 -t 300 -w "$PWD" -- .venv/bin/python -m pytest
tests/vcan`` where the machine's kernel has no AF_CAN.
"""

from __future__ import annotations

import ctypes
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.channel.events import Condition
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages

T = TypeVar("T")

INTERFACE = "vcan0"
BUS = f"socketcan:{INTERFACE}"
HOME = (-41.0, 0.0, 302.0)
DEFAULT = dg.Machine.default()
MACHINE = replace(
    DEFAULT,
    limits=DEFAULT.limits.scaled(0.02),
    drives=replace(
        DEFAULT.drives,
        cycle=0.01,
        setpoint_timeout=4.0,  # one slow processor for four processes: what is tried here is
        heartbeat_period=0.2,  # behaviour, and nothing may time out that is not meant to
        heartbeat_timeout=5.0,
        following_error_window=100.0,
        missing_frames=400,
        late_cycles=400,
        sdo_timeout=4.0,
    ),
)

pytestmark = pytest.mark.skipif(
    not Path(f"/sys/class/net/{INTERFACE}").exists(), reason=f"no {INTERFACE} on this machine"
)


@pytest.fixture(scope="module", autouse=True)
def fair_shares() -> None:
    """Forbid real-time scheduling to the processes started here: they share one processor."""
    drop_from_bounding_set, cap_sys_nice = 24, 23
    ctypes.CDLL(None).prctl(drop_from_bounding_set, cap_sys_nice, 0, 0, 0)


@pytest.fixture(scope="module")
def there() -> dg.Trajectory:
    return dg.transfer(MACHINE, HOME, (-41.0, 60.0, 302.0))


@pytest.fixture(scope="module")
def connected() -> Iterator[dg.Robot]:
    start = home_carriages(MACHINE).tolist()
    with (
        SimulatedDrives(MACHINE.drives, start, bus=BUS),
        dg.Robot.connect(MACHINE, bus=BUS) as robot,
    ):
        yield robot


@pytest.fixture
def robot(connected: dg.Robot) -> dg.Robot:
    """Return the robot under power, homed, and at home."""
    return _patiently(lambda: _make_ready(connected))


def _make_ready(robot: dg.Robot) -> dg.Robot:
    if robot.latched:
        robot.reset_fault()
    if not robot.enabled:
        robot.enable()
    robot.home()
    if np.abs(robot.position - HOME).max() > 0.05:
        robot.move_to(HOME, override=1.0)
    return robot


def _patiently(task: Callable[[], T]) -> T:
    """Try three times: where the whole machine stands still for seconds, so do cycles."""
    for _ in range(2):
        try:
            return task()
        except dg.DuoglideError as error:
            print(f"tried again: {error}")
    return task()


def run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)


def send_error_frame(kind: int) -> None:
    """Let everybody on the interface see an error frame, as a controller's driver would."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw:
        raw.bind((INTERFACE,))
        raw.send(struct.pack("=IB3x8s", kind | socket.CAN_ERR_FLAG, 8, bytes(8)))


def test_a_plan_is_streamed_over_the_kernels_bus(robot: dg.Robot, there: dg.Trajectory) -> None:
    report = _patiently(lambda: _make_ready(robot).run(there))
    assert report.completed
    end = (-41.0, 60.0, 302.0)
    deadline = time.monotonic() + 10.0  # a drive that was kept waiting comes back to its setpoint
    while np.abs(robot.position - end).max() > 0.1:
        assert time.monotonic() < deadline, robot.position
        time.sleep(0.1)


def test_candump_reads_the_stream(robot: dg.Robot, there: dg.Trajectory) -> None:
    with subprocess.Popen(
        ["candump", "-L", "-n", "200", INTERFACE], stdout=subprocess.PIPE, text=True
    ) as dump:
        _patiently(lambda: _make_ready(robot).run(there))
        dump.wait(20.0)
        assert dump.stdout is not None
        frames = [line.split()[2].split("#") for line in dump.stdout]
    identifiers = {int(identifier, 16) for identifier, _ in frames}
    assert {0x080, 0x181, 0x182, 0x183, 0x201, 0x202, 0x203} <= identifiers
    assert all(len(data) == 12 for identifier, data in frames if identifier in ("201", "181"))


def test_a_link_that_goes_down_stops_the_run_and_is_opened_again_on_purpose(
    robot: dg.Robot, there: dg.Trajectory
) -> None:
    handle = robot.start(there, override=0.3)
    time.sleep(0.3)
    run("ip", "link", "set", INTERFACE, "down")
    try:
        report = handle.wait(20.0)
    finally:
        time.sleep(0.5)
        run("ip", "link", "set", INTERFACE, "up")
    assert not report.completed
    assert {Condition.BUS, Condition.UNSENT} & {trip.condition for trip in report.faults}
    time.sleep(1.0)
    with pytest.raises(dg.DriveError):  # it does not resume by itself
        robot.run(there, approach=True)
    assert _patiently(lambda: _make_ready(robot).run(there)).completed


def test_bus_off_stops_the_run(robot: dg.Robot, there: dg.Trajectory) -> None:
    handle = robot.start(there, override=0.3)
    time.sleep(0.3)
    send_error_frame(0x40)
    report = handle.wait(20.0)
    assert (Condition.BUS, 0) in [(trip.condition, trip.axis) for trip in report.faults]
    assert not robot.enabled


def test_one_frame_in_twenty_lost_is_bridged_or_named(
    robot: dg.Robot,
    there: dg.Trajectory,
    lossy: Callable[[int], AbstractContextManager[None]],
) -> None:
    with lossy(5):
        report = robot.start(there, override=0.3).wait(60.0)
    assert report.lost
    assert report.completed or report.faults
