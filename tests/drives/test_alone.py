from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import can
import pytest

from duoglide.drives import pdo
from duoglide.drives.bus import listen
from duoglide.drives.bus.buses import open_bus
from duoglide.drives.bus.listen import require_alone
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.errors import BusError
from duoglide.machine import DriveSettings

SETTINGS = DriveSettings(heartbeat_period=0.15, heartbeat_timeout=0.5)  # 0.3 s without a sign


@contextmanager
def talking(address: str, can_id: int, extended: bool = False) -> Iterator[threading.Event]:
    """Somebody who sends a frame every 10 ms, until told to be silent."""
    silent, begun = threading.Event(), threading.Event()

    def talk() -> None:
        with open_bus(address) as bus:
            while not silent.wait(0.01):
                bus.send(can.Message(arbitration_id=can_id, is_extended_id=extended))
                begun.set()

    thread = threading.Thread(target=talk)
    thread.start()
    begun.wait(60.0)
    try:
        yield silent
    finally:
        silent.set()
        thread.join()


@pytest.mark.parametrize(
    ("can_id", "words"),
    [
        (pdo.SYNC, "its SYNC is heard"),
        (pdo.RPDO1 + 2, "its setpoint for node 2 is heard"),
        (pdo.HEARTBEAT + 127, "its heartbeat as node 127 is heard"),
    ],
)
def test_another_host_is_named(
    process: SimulatedDrives, monkeypatch: pytest.MonkeyPatch, can_id: int, words: str
) -> None:
    monkeypatch.setattr(listen, "_ALONE_PATIENCE", 0.1)
    with talking(process.address, can_id), pytest.raises(BusError, match=words) as caught:
        require_alone(process.address, SETTINGS)
    assert "`duoglide view --join` watches and stops" in str(caught.value)


def test_a_host_that_falls_silent_is_waited_for(process: SimulatedDrives) -> None:
    with talking(process.address, pdo.SYNC) as silent:
        begin = time.monotonic()
        threading.Timer(0.3, silent.set).start()
        require_alone(process.address, SETTINGS)
        assert time.monotonic() - begin > 0.3


@pytest.mark.parametrize(
    ("can_id", "extended"), [(pdo.HEARTBEAT + 40, False), (pdo.TPDO1 + 1, False), (pdo.SYNC, True)]
)
def test_nodes_and_extended_frames_are_no_hosts(
    process: SimulatedDrives, monkeypatch: pytest.MonkeyPatch, can_id: int, extended: bool
) -> None:
    monkeypatch.setattr(listen, "_ALONE_PATIENCE", 0.1)
    with talking(process.address, can_id, extended):
        require_alone(process.address, SETTINGS)


def test_a_bus_that_is_not_there_is_a_bus_error() -> None:
    with pytest.raises(BusError, match="cannot open bus socketcan:nocan0"):
        require_alone("socketcan:nocan0", SETTINGS)
