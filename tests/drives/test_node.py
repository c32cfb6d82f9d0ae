from __future__ import annotations

import struct

import pytest

from duoglide.drives import pdo
from duoglide.drives.pdo import Nmt, NmtState
from duoglide.drives.simulation.firmware.axis import FirmwareAxis
from duoglide.drives.simulation.node.node import DriveNode
from duoglide.drives.simulation.plant import Plant

NODE = 5
_HEAD = struct.Struct("<BHB")


class Bench:
    """A node without a bus: what it sends is collected."""

    def __init__(self) -> None:
        self.node = DriveNode(NODE, FirmwareAxis, Plant(), 1000.0)
        self.sent: list[tuple[int, bytes]] = []
        self.node.send = lambda can_id, data: self.sent.append((can_id, data))
        self.node.advance(1000)

    def nmt(self, command: Nmt, node: int = NODE) -> None:
        self.node.receive(pdo.NMT, pdo.pack_nmt(command, node))

    def take(self) -> list[tuple[int, bytes]]:
        sent, self.sent = self.sent, []
        return sent

    def request(self, data: bytes) -> bytes | None:
        self.take()
        self.node.receive(pdo.SDO_REQUEST + NODE, data)
        answers = [data for can_id, data in self.take() if can_id == pdo.SDO_REPLY + NODE]
        return answers[-1] if answers else None

    def write(self, index: int, sub: int, value: int, size: int) -> int:
        """Write by SDO; returns the abort code, 0 for success."""
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little").ljust(4, b"\0")
        answer = self.request(_HEAD.pack(0x23 | (4 - size) << 2, index, sub) + data)
        assert answer is not None
        return 0 if answer[0] == 0x60 else int.from_bytes(answer[4:], "little")

    def read(self, index: int, sub: int = 0) -> bytes:
        answer = self.request(_HEAD.pack(0x40, index, sub) + bytes(4))
        assert answer is not None
        if answer[0] == 0x80:
            return answer[4:]
        if answer[0] & 2:
            return answer[4 : 8 - (answer[0] >> 2 & 3)]
        value, toggle, size = b"", 0, int.from_bytes(answer[4:], "little")
        while len(value) < size:
            segment = self.request(bytes((0x60 | toggle,)) + bytes(7))
            assert segment is not None
            value += segment[1 : 8 - (segment[0] >> 1 & 7)]
            toggle ^= 0x10
        return value

    def sync(self) -> list[tuple[int, bytes]]:
        self.take()
        self.node.receive(pdo.SYNC, b"")
        return self.take()


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def operational(bench: Bench) -> Bench:
    bench.nmt(Nmt.START)
    return bench


def test_it_announces_itself_when_it_has_booted(bench: Bench) -> None:
    assert bench.take() == [(pdo.HEARTBEAT + NODE, b"\0")]
    assert bench.node.state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize("command", [Nmt.RESET_NODE, Nmt.RESET_COMMUNICATION])
def test_it_announces_itself_after_every_reset(operational: Bench, command: Nmt) -> None:
    operational.take()
    operational.nmt(command)
    operational.node.advance(1000)
    assert (pdo.HEARTBEAT + NODE, b"\0") in operational.take()
    assert operational.node.state is NmtState.PRE_OPERATIONAL


def test_commands_for_another_node_are_not_for_it(bench: Bench) -> None:
    bench.nmt(Nmt.START, NODE + 1)
    assert bench.node.state is NmtState.PRE_OPERATIONAL
    bench.nmt(Nmt.START, 0)
    assert bench.node.state is NmtState.OPERATIONAL


def test_it_sends_process_data_only_when_operational(bench: Bench) -> None:
    assert bench.sync() == []
    bench.nmt(Nmt.START)
    assert [can_id for can_id, _ in bench.sync()] == [pdo.TPDO1 + NODE]
    bench.nmt(Nmt.STOP)
    assert bench.sync() == []


def test_it_serves_sdo_in_every_state_but_stopped(bench: Bench) -> None:
    request = _HEAD.pack(0x40, 0x1000, 0) + bytes(4)
    assert bench.request(request) is not None
    bench.nmt(Nmt.START)
    assert bench.request(request) is not None
    bench.nmt(Nmt.STOP)
    assert bench.request(request) is None
    bench.nmt(Nmt.ENTER_PRE_OPERATIONAL)
    assert bench.request(request) is not None


def test_long_objects_come_in_segments(bench: Bench) -> None:
    assert bench.read(0x1008) == b"Duoglide linear axis"


@pytest.mark.parametrize(
    ("write", "abort"),
    [
        ((0x3000, 0, 1, 4), 0x06020000),  # no such object
        ((0x607D, 7, 1, 4), 0x06090011),  # no such sub-index
        ((0x6041, 0, 1, 2), 0x06010002),  # read only
        ((0x6085, 0, 1, 2), 0x06070010),  # wrong length
        ((0x6085, 0, 0, 4), 0x06090032),  # too low
        ((0x6007, 0, 9, 2), 0x06090031),  # too high
        ((0x605A, 0, 5, 2), 0x06090030),  # an option that it does not know
        ((0x1600, 1, 0x60400010, 4), 0x06010000),  # mapping while the PDO is valid
    ],
)
def test_a_write_that_breaks_a_rule_is_refused(
    bench: Bench, write: tuple[int, int, int, int], abort: int
) -> None:
    assert bench.write(*write) == abort


def test_a_pdo_is_mapped_in_the_order_of_the_standard_only(bench: Bench) -> None:
    cob_id = pdo.TPDO1 + NODE
    assert bench.write(0x1A00, 0, 0, 1) == 0x06010000
    assert bench.write(0x1800, 1, cob_id | 1 << 31, 4) == 0
    assert bench.write(0x1A00, 1, 0x60640020, 4) == 0x06010000  # the count is not 0 yet
    assert bench.write(0x1A00, 0, 0, 1) == 0
    assert bench.write(0x1A00, 1, 0x60410020, 4) == 0x06040041  # the statusword has 16 bits
    assert bench.write(0x1A00, 1, 0x60850020, 4) == 0x06040041  # not mappable
    assert bench.write(0x1A00, 1, 0x60640020, 4) == 0
    assert bench.write(0x1A00, 2, 0x606C0020, 4) == 0
    assert bench.write(0x1A00, 3, 0x60410010, 4) == 0
    assert bench.write(0x1A00, 0, 3, 1) == 0x06040042  # ten bytes
    assert bench.write(0x1A00, 0, 2, 1) == 0
    assert bench.write(0x1800, 1, cob_id, 4) == 0
    bench.nmt(Nmt.START)
    assert bench.sync() == [(cob_id, bytes(8))]


def test_a_pdo_can_be_sent_at_every_third_sync(bench: Bench) -> None:
    bench.write(0x1800, 2, 3, 1)
    bench.nmt(Nmt.START)
    assert [len(bench.sync()) for _ in range(6)] == [0, 0, 1, 0, 0, 1]


def enable(bench: Bench) -> None:
    bench.write(0x6060, 0, 8, 1)
    for word in (6, 7, 15):
        bench.write(0x6040, 0, word, 2)


def test_a_setpoint_acts_at_the_next_sync_and_is_reached_at_the_one_after(
    operational: Bench,
) -> None:
    enable(operational)
    node, axis = operational.node, operational.node.axis
    operational.sync()
    node.receive(pdo.RPDO1 + NODE, pdo.SETPOINT.pack(15, 2000))
    node.advance(2000)
    assert axis.servo_demand == 0
    operational.sync()
    node.advance(2000)
    assert axis.servo_demand == 2000 * 256


def test_feedback_is_what_was_true_at_the_sync(operational: Bench) -> None:
    enable(operational)
    for target in (2000, 2000, 2000):
        operational.node.receive(pdo.RPDO1 + NODE, pdo.SETPOINT.pack(15, target))
        frames = operational.sync()
        actual = operational.node.axis.actual
        assert frames == [(pdo.TPDO1 + NODE, pdo.FEEDBACK.pack(0x1237, actual))]
        operational.node.advance(2000)


def test_setpoints_are_ignored_until_it_is_operational(bench: Bench) -> None:
    bench.node.receive(pdo.RPDO1 + NODE, pdo.SETPOINT.pack(6, 0))
    bench.node.receive(pdo.SYNC, b"")
    assert bench.node.axis.statusword & 0x6F == 0x40


def test_a_setpoint_cut_short_is_an_emergency(operational: Bench) -> None:
    operational.take()
    operational.node.receive(pdo.RPDO1 + NODE, b"\x06\x00")
    (frame,) = operational.take()
    assert frame[0] == pdo.EMCY + NODE
    assert pdo.unpack_emergency(frame[1]).code == 0x8210


def test_digital_outputs_act_at_once(operational: Bench) -> None:
    operational.node.receive(pdo.RPDO2 + NODE, pdo.OUTPUTS.pack(1 << 16))
    assert operational.node.axis.read(0x60FE, 1) == 1 << 16


def test_digital_inputs_are_sent_when_they_change(operational: Bench) -> None:
    assert (pdo.TPDO2 + NODE, pdo.INPUTS.pack(0, 0)) in operational.take()  # at the start
    operational.node.advance(1000)
    assert operational.take() == []
    operational.node.inputs = 1 << 17
    operational.node.advance(1000)
    assert operational.take() == [(pdo.TPDO2 + NODE, pdo.INPUTS.pack(1 << 17, 0))]


def test_it_beats_in_every_state(bench: Bench) -> None:
    bench.write(0x1017, 0, 10, 2)
    for command, state in [(Nmt.START, 5), (Nmt.STOP, 4), (Nmt.ENTER_PRE_OPERATIONAL, 127)]:
        bench.nmt(command)
        bench.take()
        for _ in range(10):
            bench.node.advance(1000)
        assert (pdo.HEARTBEAT + NODE, bytes((state,))) in bench.take()


def test_a_lost_heartbeat_leads_to_an_emergency_and_pre_operational(operational: Bench) -> None:
    operational.write(0x1016, 1, 127 << 16 | 50, 4)
    operational.node.receive(pdo.HEARTBEAT + 127, b"\x05")
    operational.take()
    for _ in range(52):
        operational.node.advance(1000)
    codes = [pdo.unpack_emergency(d).code for i, d in operational.take() if i == pdo.EMCY + NODE]
    assert codes == [0x8130]
    assert operational.node.state is NmtState.PRE_OPERATIONAL
    assert operational.read(0x1003, 0) == b"\x01"
    assert operational.read(0x1003, 1) == (0x8130).to_bytes(4, "little")


def test_another_masters_heartbeat_is_not_the_hosts(operational: Bench) -> None:
    operational.write(0x1016, 1, 127 << 16 | 50, 4)
    operational.node.receive(pdo.HEARTBEAT + 126, b"\x05")
    for _ in range(200):
        operational.node.advance(1000)
    assert operational.node.state is NmtState.OPERATIONAL


def test_a_reboot_forgets_configuration_reference_and_power(operational: Bench) -> None:
    enable(operational)
    operational.write(0x6065, 0, 77, 4)
    operational.node.plant.position = 12.0
    operational.node.reboot()
    operational.node.advance(1000)
    assert operational.node.state is NmtState.PRE_OPERATIONAL
    assert operational.read(0x6065) == (5000).to_bytes(4, "little")
    assert operational.read(0x6064) == bytes(4)  # the encoder counts from here
    assert operational.read(0x6041) == (0x0250).to_bytes(2, "little")


def test_it_is_silent_while_it_boots() -> None:
    bench = Bench()
    bench.node.wrong.boot_delay = 0.5
    bench.node.reboot()
    bench.take()
    bench.node.advance(400_000)
    assert bench.request(_HEAD.pack(0x40, 0x1000, 0) + bytes(4)) is None
    bench.node.advance(200_000)
    assert bench.request(_HEAD.pack(0x40, 0x1000, 0) + bytes(4)) is not None
