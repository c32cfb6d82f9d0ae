"""A recorded run is readable by others: candump's format, decoded by cantools with the DBC."""

from __future__ import annotations

from pathlib import Path

import can
import cantools
import pytest

from duoglide.drives import pdo
from duoglide.drives.cia402 import Control, State, decode
from duoglide.drives.simulation.faults import DeviceFault
from duoglide.drives.simulation.rack import build_rack
from duoglide.machine import DriveSettings

DBC = Path(__file__).parents[2] / "firmware_interface" / "linear_axis.dbc"
PERIOD = 2000  # [us]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three drives switched on, moved 10 mm, and one of them in fault at the end."""
    path = tmp_path_factory.mktemp("run") / "run.log"
    rack = build_rack(DriveSettings(), (0.0, 0.0, 0.0))
    with can.CanutilsLogWriter(path, channel="can0") as log:

        def note(can_id: int, data: bytes) -> None:
            log.on_message_received(
                can.Message(
                    timestamp=clock * 1e-6,
                    arbitration_id=can_id,
                    data=data,
                    is_extended_id=False,
                    channel="can0",
                )
            )

        def host(can_id: int, data: bytes) -> None:
            note(can_id, data)
            rack.receive(can_id, data, clock)

        clock = 0
        rack.attach(note)
        rack.poll(0)
        clock += PERIOD
        rack.poll(clock)
        for node in rack.nodes:
            node.objects.write(0x6060, 0, 8)
            node.objects.write(0x1017, 0, 50)
        host(pdo.NMT, pdo.pack_nmt(pdo.Nmt.START, 0))
        words = [Control.SHUTDOWN, Control.SWITCH_ON] + [Control.ENABLE_OPERATION] * 200
        for k, word in enumerate(words):
            clock += PERIOD
            host(pdo.SYNC, b"")
            for node in rack.nodes:
                host(pdo.RPDO1 + node.node_id, pdo.SETPOINT.pack(word, 50 * max(k - 2, 0)))
        DeviceFault(2).apply(rack.nodes[1])
        for _ in range(5):
            clock += PERIOD
            host(pdo.SYNC, b"")
    return path


def test_every_frame_of_a_recorded_run_is_in_the_dbc(recording: Path) -> None:
    database = cantools.database.load_file(DBC)
    names = {
        database.get_message_by_frame_id(m.arbitration_id).name for m in can.LogReader(recording)
    }
    for axis in ("AXIS1", "AXIS2", "AXIS3"):
        assert {f"{axis}_RPDO1", f"{axis}_TPDO1", f"{axis}_TPDO2", f"{axis}_Heartbeat"} <= names
    assert {"SYNC", "NMT", "AXIS2_EMCY"} <= names


def test_the_decoded_run_tells_what_happened(recording: Path) -> None:
    database = cantools.database.load_file(DBC)
    decoded: dict[str, list[dict[str, int]]] = {}
    for message in can.LogReader(recording):
        name = database.get_message_by_frame_id(message.arbitration_id).name
        values = database.decode_message(message.arbitration_id, message.data)
        decoded.setdefault(name, []).append(values)
    feedback = decoded["AXIS1_TPDO1"]
    assert decode(feedback[0]["Statusword"]) is State.SWITCH_ON_DISABLED
    assert decode(feedback[100]["Statusword"]) is State.OPERATION_ENABLED
    assert feedback[-1]["PositionActualValue"] == pytest.approx(9950, abs=100)
    assert decoded["AXIS1_RPDO1"][-1] == {"Controlword": 15, "TargetPosition": 9950}
    assert decoded["AXIS2_EMCY"][0] == {"ErrorCode": 0x2310, "ErrorRegister": 3}
    assert decode(decoded["AXIS2_TPDO1"][-1]["Statusword"]) is State.FAULT
