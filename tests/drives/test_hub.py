from __future__ import annotations

import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from duoglide.drives.bus.buses import open_bus, parse_bus
from duoglide.drives.bus.socketcand import (
    EXTENDED,
    MessageSplitter,
    SocketcandBus,
    decode_send,
    encode_frame,
    encode_send,
)
from duoglide.drives.simulation.hub import Hub


class Listener:
    """A station that notes what it hears and answers SYNC."""

    patience = 0.005
    abandoned = False

    def __init__(self) -> None:
        self.heard: list[tuple[int, bytes]] = []
        self.send: Callable[[int, bytes], None] = lambda can_id, data: None

    def attach(self, send: Callable[[int, bytes], None]) -> None:
        self.send = send

    def receive(self, can_id: int, data: bytes, now: int, behind: int = 0) -> None:
        self.heard.append((can_id, data))
        if can_id == 0x80:
            for node in (1, 2, 3):
                self.send(0x180 + node, bytes(6))

    def abandon(self) -> None:
        self.abandoned = True

    def poll(self, now: int) -> None:
        pass


@contextmanager
def running(station: Listener) -> Iterator[Hub]:
    with Hub(station) as hub:
        stop = threading.Event()

        def turn() -> None:
            while not stop.is_set():
                hub.turn()

        thread = threading.Thread(target=turn)
        thread.start()
        try:
            yield hub
        finally:
            stop.set()
            thread.join()


def connect(hub: Hub) -> SocketcandBus:
    bus = open_bus(hub.address)
    assert isinstance(bus, SocketcandBus)
    return bus


def wait_until(condition: Callable[[], bool], patience: float = 60.0) -> None:
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def receive(bus: can.BusABC, count: int) -> list[tuple[int, bytes]]:
    frames = []
    for _ in range(count):
        message = bus.recv(60.0)
        assert message is not None
        frames.append((message.arbitration_id, bytes(message.data)))
    return frames


identifiers = st.integers(0, 0x7FF) | st.integers(EXTENDED, EXTENDED | (1 << 29) - 1)
frames = st.lists(st.tuples(identifiers, st.binary(max_size=8)), max_size=8)


@settings(max_examples=50, deadline=None)
@given(frames, st.lists(st.integers(1, 40)))
def test_messages_survive_any_cutting(sent: list[tuple[int, bytes]], cuts: list[int]) -> None:
    stream = b"".join(encode_send(can_id, data) for can_id, data in sent)
    splitter, got = MessageSplitter(), []
    for cut in [*cuts, len(stream)]:
        got += [decode_send(words) for words in splitter.feed(stream[:cut])]
        stream = stream[cut:]
    assert got == sent


@pytest.mark.parametrize(
    "text",
    ["send 123 2 11", "send 123 9 1 2 3 4 5 6 7 8 9", "send xyz 0", "send 123 1 1FF", "send 800 0"],
)
def test_a_frame_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        decode_send(text.encode().split())


def family(bus: SocketcandBus) -> socket.AddressFamily:
    with socket.socket(fileno=os.dup(bus.fileno())) as copy:
        return socket.AddressFamily(copy.family)


@pytest.mark.skipif(sys.platform != "linux", reason="abstract Unix sockets are Linux's")
def test_clients_on_this_computer_and_clients_over_tcp_hear_each_other() -> None:
    station = Listener()
    with running(station) as hub:
        local, remote = connect(hub), SocketcandBus("localhost", int(hub.address.split(":")[-1]))
        assert (family(local), family(remote)) == (socket.AF_UNIX, socket.AF_INET)
        wait_until(lambda: hub.clients == 2)
        for sender, receiver, number in ((local, remote, 0x123), (remote, local, 0x321)):
            sender.send_frames([(number, b"\1"), (number + 1, b"\2")])
            assert receive(receiver, 2) == [(number, b"\1"), (number + 1, b"\2")]
        assert [can_id for can_id, _ in station.heard] == [0x123, 0x124, 0x321, 0x322]
        local.shutdown()
        remote.shutdown()


def test_the_station_learns_that_whoever_sent_sync_is_gone() -> None:
    station = Listener()
    with running(station) as hub:
        leader, other = connect(hub), connect(hub)
        leader.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        receive(other, 1)
        other.shutdown()
        wait_until(lambda: hub.clients == 1)
        assert not station.abandoned
        leader.shutdown()
        wait_until(lambda: station.abandoned)


def test_frames_are_taken_as_messages_are_but_for_what_the_cycle_does_not_hear() -> None:
    station = Listener()
    with running(station) as hub:
        plain, quick, sender = connect(hub), connect(hub), connect(hub)
        sent = [(0x181, bytes(6)), (0x7FF, b""), (0x182, b"\1"), (0x82, bytes(range(8)))]
        for can_id, data in sent:
            extended = can_id == 0x182
            sender.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=extended))
        assert receive(plain, len(sent)) == sent
        with pytest.raises(can.CanOperationError, match="cannot send remote frames"):
            sender.send(can.Message(arbitration_id=0x181, is_remote_frame=True))
        taken: list[tuple[int, bytes]] = []

        def all_there() -> bool:
            taken.extend(quick.receive_frames())
            return len(taken) >= 3

        wait_until(all_there)
        assert taken == [frame for frame in sent if frame[0] != 0x182]
        for bus in (plain, quick, sender):
            bus.shutdown()


def test_python_can_reads_what_the_hub_writes() -> None:
    from can.interfaces.socketcand.socketcand import convert_ascii_message_to_can_message

    data = b"\x37\x12\x00\x00\x01\xff"
    for can_id in (0x80, 0x181, EXTENDED | 0x12345, EXTENDED | 0x181):
        message = convert_ascii_message_to_can_message(encode_frame(can_id, data, 1.5).decode())
        assert message is not None
        assert (message.arbitration_id, bytes(message.data)) == (can_id & ~EXTENDED, data)
        assert message.is_extended_id == bool(can_id & EXTENDED)
        assert message.timestamp == 1.5


def test_every_client_hears_the_others_and_the_station_but_not_itself() -> None:
    station = Listener()
    with running(station) as hub, connect(hub) as first, connect(hub) as second:
        wait_until(lambda: hub.clients == 2)
        first.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        answers = [(0x181, bytes(6)), (0x182, bytes(6)), (0x183, bytes(6))]
        assert receive(second, 4) == [(0x80, b""), *answers]
        assert receive(first, 3) == answers
        assert first.recv(0.05) is None


def test_frames_keep_their_order() -> None:
    station = Listener()
    with running(station) as hub, connect(hub) as sender, connect(hub) as listener:
        wait_until(lambda: hub.clients == 2)
        sent = [(0x200 + i % 3, i.to_bytes(4, "little")) for i in range(5000)]
        for start in range(0, len(sent), 10):
            sender.send_frames(sent[start : start + 10])
        assert receive(listener, len(sent)) == sent
        assert station.heard == sent


def test_python_cans_own_client_can_join(caplog: pytest.LogCaptureFixture) -> None:
    from can.interfaces.socketcand import SocketCanDaemonBus

    with running(Listener()) as hub, connect(hub) as ours:
        address = parse_bus(hub.address)
        busy = threading.Event()

        def chatter() -> None:  # frames that must not come in between the handshake
            while not busy.is_set():
                ours.send_frames([(0x123, b"\x01\x02")])
                time.sleep(0.001)

        thread = threading.Thread(target=chatter)
        thread.start()
        try:
            theirs = SocketCanDaemonBus("can0", address.place, address.port)
            with theirs:
                message = theirs.recv(60.0)
                assert message is not None
                assert message.arbitration_id == 0x123
                theirs.send(can.Message(arbitration_id=0x7FF, data=b"\x0a", is_extended_id=False))
                assert receive(ours, 1) == [(0x7FF, b"\x0a")]
        finally:
            busy.set()
            thread.join()


def test_raw_socketcand_clients_are_answered_word_for_word() -> None:
    station = Listener()
    with running(station) as hub:
        address = parse_bus(hub.address)
        with socket.create_connection((address.place, address.port), 2.0) as client:
            assert client.recv(64) == b"< hi >"
            client.sendall(b"< open can0 >< ra")
            assert client.recv(64) == b"< ok >"
            client.sendall(b"wmode >")
            assert client.recv(64) == b"< ok >"
            client.sendall(b"< send 80 0 >")
            text = client.recv(4096)
            assert text.startswith(b"< frame 181 ")
            assert text.endswith(b" 000000000000 >")
            client.sendall(b"< send nonsense >")
            assert b"< error could not parse frame >" in client.recv(4096)
            client.sendall(b"< echo >")
            assert client.recv(64) == b"< echo >"
        wait_until(lambda: hub.clients == 0)


def test_a_closed_hub_is_an_error_not_a_silence() -> None:
    with running(Listener()) as hub:
        bus = connect(hub)
    try:
        with pytest.raises(can.CanOperationError, match="closed"):
            bus.recv(1.0)
        with pytest.raises(can.CanOperationError, match="socketcand"):
            for _ in range(100):
                bus.send(can.Message(arbitration_id=1, is_extended_id=False))
                time.sleep(0.001)
    finally:
        bus.shutdown()


def test_a_client_that_never_reads_does_not_hold_up_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("duoglide.drives.simulation.hub._MOST_WAITING", 100_000)
    station = Listener()
    with running(station) as hub, connect(hub) as sender, socket.socket() as lazy:
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        address = parse_bus(hub.address)
        lazy.connect((address.place, address.port))
        lazy.sendall(b"< open can0 >< rawmode >< send 7FF 0 >")
        wait_until(lambda: len(station.heard) == 1)
        block = [(0x201, bytes(8))] * 1000

        def dropped() -> bool:
            sender.send_frames(block)
            return hub.clients == 1

        wait_until(dropped)


def test_the_hub_carries_a_thousand_cycles_of_three_axes() -> None:
    """Seven frames a cycle, 1000 cycles: as fast as it goes, none lost."""
    station = Listener()
    with running(station) as hub, connect(hub) as host:
        cycle = [(0x80, b""), *((0x200 + node, bytes(6)) for node in (1, 2, 3))]
        for _ in range(1000):
            host.send_frames(cycle)
            assert len(receive(host, 3)) == 3
        assert len(station.heard) == 4000
