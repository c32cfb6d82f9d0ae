from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import can
import pytest

from duoglide.drives import pdo
from duoglide.drives.bus.buses import open_bus
from duoglide.drives.bus.listen import Overheard, listen
from duoglide.errors import BusError
from duoglide.machine import DriveSettings

BUS = "inprocess:listen"
Frame = tuple[int, bytes]


@contextmanager
def said(*frames: Frame, extended: bool = False) -> Iterator[can.BusABC]:
    """Somebody who repeats some frames every 10 ms; yields a bus that hears everything."""
    over = threading.Event()

    def talk() -> None:
        with open_bus(BUS) as bus:
            while not over.wait(0.01):
                for can_id, data in frames:
                    bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=extended))

    thread = threading.Thread(target=talk)
    with open_bus(BUS) as witness:
        thread.start()
        try:
            yield witness
        finally:
            over.set()
            thread.join()


def heard(*frames: Frame, extended: bool = False) -> Overheard:
    with said(*frames, extended=extended):
        return listen(BUS, DriveSettings())


def test_the_host_and_its_drives_are_heard() -> None:
    found = heard(
        (pdo.SYNC, b""),
        (pdo.RPDO1 + 2, pdo.SETPOINT.pack(15, 7)),
        (pdo.TPDO1 + 1, pdo.FEEDBACK.pack(0x1237, -41_000)),
        (pdo.HEARTBEAT + 1, b"\x05"),
        (pdo.HEARTBEAT + 127, b"\x05"),
        (pdo.HEARTBEAT + 9, b"\x7f"),
        (pdo.EMCY + 3, pdo.pack_emergency(0x8611, 1)),
    )
    assert set(found.host) == {"SYNC", "setpoint for node 2", "heartbeat as node 127"}
    assert found.feedback == {1: pdo.Feedback(0x1237, -41_000)}
    assert found.heartbeats == {
        1: pdo.NmtState.OPERATIONAL,
        9: pdo.NmtState.PRE_OPERATIONAL,
        127: pdo.NmtState.OPERATIONAL,
    }
    assert {node: emergency.code for node, emergency in found.emergencies.items()} == {3: 0x8611}


def test_drives_without_a_host_are_no_host() -> None:
    found = heard((pdo.HEARTBEAT + 1, b"\x7f"), (pdo.TPDO1 + 2, pdo.FEEDBACK.pack(0x0250, 5)))
    assert found.host == ()
    assert found.feedback[2].actual == 5


@pytest.mark.parametrize("extended", [False, True])
def test_frames_that_are_cut_short_or_strange_say_nothing(extended: bool) -> None:
    found = heard(
        (pdo.TPDO1 + 1, b"\x37\x12"),
        (pdo.EMCY + 1, b"\x11"),
        (pdo.HEARTBEAT + 2, b""),
        (pdo.HEARTBEAT + 3, b"\x33"),
        (pdo.TPDO1 + 77, pdo.FEEDBACK.pack(1, 2)),
        extended=extended,
    )
    assert (found.host, found.feedback, found.emergencies) == ((), {}, {})
    assert found.heartbeats == ({} if extended else {3: None})


def test_nothing_is_sent() -> None:
    with open_bus(BUS) as witness:
        listen(BUS, DriveSettings())
        assert witness.recv(0.0) is None


def test_a_bus_that_is_not_there_is_a_bus_error() -> None:
    with pytest.raises(BusError, match="cannot open bus socketcan:nocan0"):
        listen("socketcan:nocan0", DriveSettings())
