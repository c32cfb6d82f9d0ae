"""The host's SDO client against answers as real drives and busy buses give them."""

from __future__ import annotations

import queue
from collections.abc import Callable
from typing import Any

import can
import pytest

from duoglide.drives.axis.sdo_client import SdoClient, SdoRefusalError
from duoglide.errors import BusError, DriveTimeout

NODE = 5


def answer(command: int, index: int, sub: int, value: int) -> bytes:
    return bytes((command, index & 0xFF, index >> 8, sub)) + value.to_bytes(4, "little")


WANTED = answer(0x43, 0x6064, 0, 1234)
STATUSWORD = answer(0x4B, 0x6041, 0, 0x27)


class Network:
    """A drive whose answers to the first, the second and every later request are given."""

    def __init__(self, *replies: list[bytes]) -> None:
        self.replies = list(replies)
        self.asked: list[bytes] = []
        self.broken = False
        self.late: list[bytes] = []

    def subscribe(self, can_id: int, callback: Callable[..., None]) -> None:
        assert can_id == 0x580 + NODE
        self.callback = callback

    def unsubscribe(self, can_id: int, callback: Callable[..., None]) -> None:
        del self.callback

    def send_message(self, can_id: int, data: bytes) -> None:
        if self.broken:
            raise can.CanOperationError("no buffer space")
        assert can_id == 0x600 + NODE
        self.deliver_late()
        self.asked.append(bytes(data))
        for reply in self.replies.pop(0) if self.replies else []:
            self.callback(0x580 + NODE, bytearray(reply), 0.0)

    def deliver_late(self) -> None:
        """Deliver what comes after the answers to the second request, before anything else."""
        while self.late and len(self.asked) > 1:
            self.callback(0x580 + NODE, bytearray(self.late.pop()), 0.0)


class Answers(queue.Queue[bytes]):
    """Answers that wait; whoever finds none lets time pass until the late one comes."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network

    def get(self, block: bool = True, timeout: float | None = None) -> bytes:
        if self.empty():
            self.network.deliver_late()
        return super().get(block, timeout)


def client(network: Any, retries: int = 2) -> SdoClient:
    return SdoClient(network, NODE, 1, 0.02, retries)


@pytest.mark.parametrize(
    "replies",
    [
        [STATUSWORD, WANTED],  # late, to what was asked before
        [answer(0x43, 0x6064, 1, 99), WANTED],  # of another sub-index
        [answer(0x80, 0x6041, 0, 0x06020000), WANTED],  # a refusal of something else
        [answer(0x60, 0x6064, 0, 0), WANTED],  # to a write of the same object
        [WANTED[:6], WANTED],  # cut short
        [WANTED, STATUSWORD],
    ],
)
def test_an_answer_to_something_else_is_not_taken_for_this_one(replies: list[bytes]) -> None:
    network = Network(replies)
    assert client(network).upload(0x6064, 0) == (1234).to_bytes(4, "little")
    assert len(network.asked) == 1


def test_answers_that_come_in_another_order_belong_to_their_objects() -> None:
    network = Network([STATUSWORD, answer(0x43, 0x607A, 0, 7), WANTED], [STATUSWORD])
    drive = client(network)
    assert drive.upload(0x6064, 0) == (1234).to_bytes(4, "little")
    assert drive.upload(0x6041, 0) == b"\x27\x00"


def test_a_repeated_request_is_answered_twice_and_the_second_is_not_kept() -> None:
    stale, fresh = answer(0x43, 0x6064, 0, 1), answer(0x43, 0x6064, 0, 2)
    network = Network([], [stale], [fresh])
    drive = client(network)
    network.late, drive.responses = [stale], Answers(network)
    assert drive.upload(0x6064, 0) == b"\1\0\0\0"
    assert drive.upload(0x6064, 0) == b"\2\0\0\0"


def test_a_refusal_is_in_words_and_not_asked_again() -> None:
    network = Network([answer(0x80, 0x6064, 0, 0x08000022)], [answer(0x80, 0x1234, 0, 0x0BADF00D)])
    with pytest.raises(SdoRefusalError, match="not in this state of the device") as refusal:
        client(network).upload(0x6064, 0)
    assert (refusal.value.abort, refusal.value.axis, len(network.asked)) == (0x08000022, 1, 1)
    with pytest.raises(SdoRefusalError, match=r"unknown abort code .0x0BADF00D"):
        client(network).download(0x1234, 0, b"\1")


def test_silence_is_asked_as_often_as_agreed() -> None:
    network = Network()
    with pytest.raises(DriveTimeout, match=r"writing 0x6040:0: no answer .* asked 3 times"):
        client(network).download(0x6040, 0, b"\x06\x00")
    assert network.asked == [bytes((0x2B, 0x40, 0x60, 0, 6, 0, 0, 0))] * 3


def test_without_retries_silence_is_asked_once() -> None:
    network = Network()
    with pytest.raises(DriveTimeout, match="asked 1 times"):
        client(network, retries=0).upload(0x6064, 0)
    assert len(network.asked) == 1


def test_a_confirmation_of_another_write_confirms_nothing() -> None:
    network = Network([answer(0x60, 0x6041, 0, 0)])
    with pytest.raises(DriveTimeout, match="writing 0x6040:0"):
        client(network).download(0x6040, 0, b"\x06\x00")


def test_segments_are_joined_in_the_order_of_their_toggle_bits() -> None:
    network = Network(
        [answer(0x41, 0x1008, 0, 10)],
        [b"\x10" + b"wrongly", b"\x00" + b"Linear "],
        [b"\x00" + b"wrongly", b"\x19" + b"axis   "[:7]],
    )
    assert client(network).upload(0x1008, 0) == b"Linear axi"
    assert [request[0] for request in network.asked] == [0x40, 0x60, 0x70]


def test_a_bus_that_takes_nothing_is_a_bus_error() -> None:
    network = Network()
    network.broken = True
    with pytest.raises(BusError, match="axis 1, reading 0x6064:0: no buffer space"):
        client(network).upload(0x6064, 0)


def test_after_closing_it_hears_nothing() -> None:
    network = Network()
    client(network).close()
    assert not hasattr(network, "callback")


def test_a_transfer_whose_segment_is_lost_begins_again() -> None:
    begin, first, last = answer(0x41, 0x1008, 0, 10), b"\x00Linear ", b"\x19axis   "[:8]
    network = Network([begin], [first], [], [begin], [first], [last])
    assert client(network).upload(0x1008, 0) == b"Linear axi"
    assert [request[0] for request in network.asked] == [0x40, 0x60, 0x70, 0x40, 0x60, 0x70]


def test_a_transfer_that_never_comes_to_its_end_is_given_up() -> None:
    begin: list[list[bytes]] = [[answer(0x41, 0x1008, 0, 10)], []]
    with pytest.raises(DriveTimeout, match=r"reading 0x1008:0"):
        client(Network(*begin * 4), retries=1).upload(0x1008, 0)
