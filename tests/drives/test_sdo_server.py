from __future__ import annotations

import pytest

from duoglide.drives.linear_axis import read_variables
from duoglide.drives.simulation.firmware.axis import FirmwareAxis
from duoglide.drives.simulation.node.memory import ParameterMemory
from duoglide.drives.simulation.node.objects import NodeObjects
from duoglide.drives.simulation.node.sdo_server import SdoServer
from duoglide.drives.standstill import Standstill

READ_NAME = bytes((0x40, 0x08, 0x10, 0x00)) + bytes(4)


class Client:
    def __init__(self) -> None:
        self.answers: list[bytes] = []
        self.objects = NodeObjects(
            read_variables(1), FirmwareAxis(), ParameterMemory(), Standstill()
        )
        self.server = SdoServer(self.objects, self.answers.append)

    def ask(self, *data: int) -> bytes:
        self.server.request(bytes(data).ljust(8, b"\0"))
        return self.answers.pop()


@pytest.fixture
def client() -> Client:
    return Client()


def test_a_number_may_be_written_in_segments(client: Client) -> None:
    assert client.ask(0x21, 0x85, 0x60, 0x00, 4)[0] == 0x60
    assert client.ask(0x07, 0x10, 0x27, 0x00, 0x00) == bytes((0x20,)) + bytes(7)
    assert client.objects.read(0x6085, 0) == 10_000


def test_a_segment_out_of_turn_ends_the_transfer(client: Client) -> None:
    client.server.request(READ_NAME)
    assert client.ask(0x70)[:1] + client.answers[-1][:1] == b"\x80\x41"
    assert client.ask(0x70)[4:] == (0x05030000).to_bytes(4, "little")


@pytest.mark.parametrize("command", [0xC0, 0xE0])
def test_what_it_does_not_know_it_refuses(client: Client, command: int) -> None:
    answer = client.ask(command, 0x08, 0x10, 0x00)
    assert answer[0] == 0x80
    assert answer[4:] == (0x05040001).to_bytes(4, "little")


def test_a_block_upload_is_answered_by_a_plain_one(client: Client) -> None:
    assert client.ask(0xA0, 0x00, 0x10, 0x00)[:4] == bytes((0x43, 0x00, 0x10, 0x00))


def test_an_abort_is_not_answered(client: Client) -> None:
    client.server.request(bytes((0x80,)) + bytes(7))
    assert client.answers == []
