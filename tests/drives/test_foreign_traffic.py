"""What is on a real bus beside the host and its drives: other nodes, extended and odd frames."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import can
import pytest

from duoglide.drives import pdo
from duoglide.drives.axis.axis import Axis
from duoglide.drives.bus.buses import open_bus
from duoglide.drives.cia402 import State
from duoglide.drives.simulation.process import serve_drives
from duoglide.drives.simulation.rack import build_rack
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.machine import DriveSettings

RESET_ALL = bytes((pdo.Nmt.RESET_NODE, 0))
QUICK_STOP = pdo.SETPOINT.pack(0x0002, 0)


def standard(can_id: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False)


def extended(can_id: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=True)


STRANGERS = [
    standard(pdo.HEARTBEAT + 40, b"\x05"),
    standard(pdo.HEARTBEAT + 40, b"\x00"),  # it boots
    standard(pdo.TPDO1 + 40, bytes(8)),
    standard(pdo.EMCY + 40, pdo.pack_emergency(0x2310, 3)),
    standard(pdo.SDO_REQUEST + 40, b"\x40\x00\x10\x00" + bytes(4)),
    standard(pdo.SDO_REPLY + 40, b"\x43\x00\x10\x00" + bytes(4)),
    standard(pdo.NMT, bytes((pdo.Nmt.STOP, 40))),
    standard(0x100, bytes(6)),  # a time stamp
    standard(0x7E5, bytes(8)),  # LSS
    standard(pdo.SDO_REPLY + 1, b"\x80\x00"),  # cut short
    standard(pdo.NMT, b"\x81"),  # cut short
    extended(pdo.NMT, RESET_ALL),
    extended(pdo.SYNC),
    *(extended(pdo.RPDO1 + node, QUICK_STOP) for node in (1, 2, 3)),
    *(extended(pdo.SDO_REPLY + node, b"\x80" + bytes(7)) for node in (1, 2, 3)),
    extended(0x18EEFF05, bytes(8)),  # J1939
]


@pytest.fixture
def crowded(drives: SimulatedDrives) -> Iterator[SimulatedDrives]:
    """The drives, on a bus where others talk all the time."""
    done = threading.Event()

    def talk() -> None:
        with open_bus(drives.address) as bus:
            while not done.wait(0.002):
                for message in STRANGERS:
                    bus.send(message)

    thread = threading.Thread(target=talk)
    thread.start()
    yield drives
    done.set()
    thread.join()


def test_bring_up_minds_nobody_elses_frames(crowded: SimulatedDrives, enabled: list[Axis]) -> None:
    for axis in enabled:
        assert axis.read_state() is State.OPERATION_ENABLED
        assert axis.read_homed()
        assert axis.read(0x1003) == 0


def test_drives_mind_no_remote_extended_and_error_frames() -> None:
    rack = build_rack(DriveSettings(), (0.0, 0.0, 0.0))
    done = threading.Event()
    odd = [
        extended(pdo.NMT, RESET_ALL),
        can.Message(arbitration_id=pdo.NMT, is_extended_id=False, is_remote_frame=True, dlc=2),
        can.Message(arbitration_id=0x20000000, is_error_frame=True, data=bytes(8)),
        standard(pdo.NMT, bytes((pdo.Nmt.RESET_COMMUNICATION, 2))),
    ]
    with open_bus("inprocess:odd") as theirs, open_bus("inprocess:odd") as ours:
        thread = threading.Thread(target=serve_drives, args=(theirs, rack, done.is_set))
        thread.start()
        try:
            while ours.recv(0.1) is not None:  # they announce themselves
                pass
            for message in odd:
                ours.send(message)
            heard = []
            while (message := ours.recv(0.2 if heard else 60.0)) is not None:
                heard.append(message.arbitration_id)
        finally:
            done.set()
            thread.join()
    assert heard == [pdo.HEARTBEAT + 2]  # only what the last frame has asked for
