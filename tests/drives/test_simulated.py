from __future__ import annotations

import errno
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import can
import can.interfaces.virtual
import pytest

from duoglide.drives import pdo
from duoglide.drives.bus.buses import open_bus
from duoglide.drives.cia402 import State
from duoglide.drives.simulation import faults, process
from duoglide.drives.simulation.plant import PlantParameters
from duoglide.drives.simulation.process import serve_drives
from duoglide.drives.simulation.rack import build_rack
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.errors import BusError
from duoglide.machine import DriveSettings, Homing

PARENT = """
import sys, time
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.machine import DriveSettings, Homing
with SimulatedDrives(DriveSettings(), (0.0, 0.0, 0.0)) as drives:
    print(drives.pid, drives.address, flush=True)
    time.sleep(60)
"""


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"


def wait_for_end(pid: int, patience: float) -> None:
    deadline = time.monotonic() + patience
    while alive(pid):
        assert time.monotonic() < deadline, "the drives outlive their parent"
        time.sleep(0.02)


def test_the_handle_ends_the_process() -> None:
    with SimulatedDrives(DriveSettings(), (0.0, 0.0, 0.0)) as drives:
        assert drives.address.startswith("socketcand:127.0.0.1:")
        pid = drives.pid
        assert alive(pid)
    assert not alive(pid)


def test_the_drives_end_with_a_killed_parent_once_nobody_is_connected() -> None:
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    try:
        pid, address = parent.stdout.readline().split()
        with open_bus(address) as bus:
            parent.kill()
            parent.wait()
            time.sleep(0.3)
            bus.send(can.Message(arbitration_id=0, data=b"\x81\x01", is_extended_id=False))
            heard = bus.recv(1.0)  # the drives are there as long as someone is
            assert heard is not None
            assert heard.arbitration_id == 0x701
        wait_for_end(int(pid), 60.0)
    finally:
        parent.kill()
        parent.wait()
        parent.stdout.close()


def test_signals_that_end_a_session_are_the_parents_business() -> None:
    with SimulatedDrives(DriveSettings(), (1.0, 2.0, 3.0)) as drives:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(drives.pid, number)
        assert [s.position for s in drives.snapshot()] == [1.0, 2.0, 3.0]


def test_drives_whose_parent_is_gone_at_once_end_without_a_word() -> None:
    ours, theirs = multiprocessing.Pipe()
    ours.close()
    process.main(os.dup(theirs.fileno()))
    theirs.close()


def test_a_bus_that_cannot_be_served_is_a_bus_error() -> None:
    with (
        pytest.raises(BusError, match="socketcan:nocan0"),
        SimulatedDrives(DriveSettings(), (0.0, 0.0, 0.0), bus="socketcan:nocan0"),
    ):
        pass
    with pytest.raises(BusError, match="unknown bus"):
        SimulatedDrives(DriveSettings(), (0.0, 0.0, 0.0), bus="nonsense")


def test_drives_can_be_served_on_udp_from_another_process() -> None:
    name = "udp:239.74.163.78:43178"
    with SimulatedDrives(DriveSettings(), (0.0, 0.0, 0.0), bus=name), open_bus(name) as bus:
        bus.send(can.Message(arbitration_id=0, data=b"\x81\x00", is_extended_id=False))
        heard = {m.arbitration_id for _ in range(4) if (m := bus.recv(60.0)) is not None}
        assert heard == {0, 0x701, 0x702, 0x703}  # on multicast one hears oneself


def test_what_is_injected_has_happened_when_the_call_returns() -> None:
    with SimulatedDrives(DriveSettings(), (0.0, 0.0, 0.0)) as drives:
        drives.inject(faults.DeviceFault(2))
        states = [snapshot.state for snapshot in drives.snapshot()]
    assert states == [State.SWITCH_ON_DISABLED, State.FAULT, State.SWITCH_ON_DISABLED]


def test_drives_in_this_process_answer_on_an_open_bus() -> None:
    plants = [PlantParameters(bandwidth=50.0)] * 3
    rack = build_rack(DriveSettings(node_ids=(4, 5, 6)), (0.0, 0.0, 0.0), plants)
    done = threading.Event()
    with open_bus("inprocess:served") as theirs, open_bus("inprocess:served") as ours:
        thread = threading.Thread(target=serve_drives, args=(theirs, rack, done.is_set))
        thread.start()
        try:
            heard = {m.arbitration_id for _ in range(3) if (m := ours.recv(60.0)) is not None}
            assert heard == {pdo.HEARTBEAT + node for node in (4, 5, 6)}
        finally:
            done.set()
            thread.join()


class Flaky(can.interfaces.virtual.VirtualBus):
    """A bus whose link can go down, or fail for good."""

    failure = 0

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self.failure:
            raise can.CanOperationError("no link", self.failure)
        return super()._recv_internal(timeout)  # type: ignore[no-any-return]


def test_drives_outlive_a_link_that_goes_down_and_up() -> None:
    rack = build_rack(DriveSettings(), (0.0, 0.0, 0.0))
    done = threading.Event()
    with Flaky("flaky") as theirs, open_bus("inprocess:flaky") as ours:
        thread = threading.Thread(target=serve_drives, args=(theirs, rack, done.is_set))
        thread.start()
        try:
            theirs.failure = errno.ENETDOWN
            time.sleep(0.05)
            assert thread.is_alive()
            theirs.failure = 0
            while ours.recv(0.05) is not None:
                pass
            ours.send(can.Message(arbitration_id=0, data=b"\x81\x02", is_extended_id=False))
            heard = ours.recv(60.0)
            assert heard is not None
            assert heard.arbitration_id == pdo.HEARTBEAT + 2
        finally:
            done.set()
            thread.join()


def test_a_bus_that_fails_for_good_is_an_error() -> None:
    rack = build_rack(DriveSettings(), (0.0, 0.0, 0.0))
    with Flaky("broken") as bus:
        bus.failure = errno.EBADF
        with pytest.raises(can.CanOperationError, match="no link"):
            serve_drives(bus, rack, lambda: False)


def test_limit_switches_are_where_the_machine_file_says() -> None:
    homing = Homing(method=(17, 18, 17), switch_position=(-300.0, 310.0, 320.0))
    settings = DriveSettings(homing=homing, direction=(1, 1, -1))
    switches = [n.plant.parameters.limit_switches for n in build_rack(settings, (0, 0, 0)).nodes]
    assert switches[0][0] == -300.0
    assert switches[1][1] == 310.0
    assert switches[2][1] == 320.0  # the negative switch of a drive that counts against +y


def test_files_in_the_working_directory_are_not_taken_for_modules(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "queue.py").write_text("raise RuntimeError('this is my queue')\n")
    monkeypatch.chdir(tmp_path)
    with SimulatedDrives(DriveSettings(), (0.0, 0.0, 0.0)) as drives:
        assert len(drives.snapshot()) == 3
