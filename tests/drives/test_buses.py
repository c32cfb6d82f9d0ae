from __future__ import annotations

import socket
import threading

import pytest

from duoglide.drives.bus.buses import BusKind, BusName, frame_sender, open_bus, parse_bus
from duoglide.errors import BusError


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("virtual", BusName(BusKind.VIRTUAL)),
        ("socketcand:localhost:29536", BusName(BusKind.SOCKETCAND, "localhost", 29536)),
        (
            "socketcand:10.0.0.7:28600/vcan0",
            BusName(BusKind.SOCKETCAND, "10.0.0.7", 28600, "vcan0"),
        ),
        ("udp:239.0.0.1:43113", BusName(BusKind.UDP, "239.0.0.1", 43113)),
        ("udp:ff15::1:43113", BusName(BusKind.UDP, "ff15::1", 43113)),
        ("socketcan:can0", BusName(BusKind.SOCKETCAN, "can0")),
    ],
)
def test_a_name_is_taken_apart_and_put_together(text: str, name: BusName) -> None:
    assert parse_bus(text) == name
    assert str(name) == text


@pytest.mark.parametrize(
    "text", ["", "can0", "vcan:0", "VIRTUAL", "usb:1", "virtual:7", "socketcan:", "udp:239.0.0.1"]
)
def test_a_wrong_name_is_refused(text: str) -> None:
    with pytest.raises(BusError):
        parse_bus(text)


def test_an_unknown_bus_gets_the_list_of_forms() -> None:
    with pytest.raises(BusError, match=r"socketcand:HOST:PORT, udp:GROUP:PORT, socketcan:"):
        open_bus("can0")


@pytest.mark.parametrize("port", ["0", "65536", "x", "-1", ""])
def test_a_port_is_a_number_up_to_65535(port: str) -> None:
    with pytest.raises(BusError, match="HOST:PORT"):
        parse_bus(f"socketcand:localhost:{port}")


def test_udp_wants_a_multicast_group() -> None:
    with pytest.raises(BusError, match=r"192\.168\.0\.1 is no multicast group.*239"):
        parse_bus("udp:192.168.0.1:43113")


def test_a_refused_connection_says_what_to_start() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(BusError, match="duoglide drives"):
        open_bus(f"socketcand:127.0.0.1:{port}")


def test_a_server_that_speaks_something_else_is_refused() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

        thread = threading.Thread(target=answer)
        thread.start()
        with pytest.raises(BusError, match="does not speak socketcand"):
            open_bus(f"socketcand:127.0.0.1:{server.getsockname()[1]}")
        thread.join()


def test_a_missing_interface_is_a_bus_error() -> None:
    with pytest.raises(BusError, match="socketcan:nocan0"):
        open_bus("socketcan:nocan0")


def test_the_virtual_bus_has_no_address_by_itself() -> None:
    with pytest.raises(BusError, match="simulated drives"):
        open_bus("virtual")


def test_udp_frames_stay_on_this_computer_and_arrive_in_order() -> None:
    name = "udp:239.74.163.77:43177"
    with open_bus(name) as sender, open_bus(name) as receiver:
        assert sender._multicast.hop_limit == 0  # type: ignore[attr-defined]
        frame_sender(sender)([(0x80, b""), (0x201, b"\x0f\x00\x01\x02\x03\x04")])
        frames = [receiver.recv(60.0) for _ in range(2)]
        assert [(f.arbitration_id, bytes(f.data)) for f in frames if f] == [
            (0x80, b""),
            (0x201, b"\x0f\x00\x01\x02\x03\x04"),
        ]


def test_frames_in_one_process_arrive_in_order() -> None:
    with open_bus("inprocess:order") as sender, open_bus("inprocess:order") as receiver:
        frame_sender(sender)([(i, bytes((i,))) for i in range(20)])
        got = [receiver.recv(0.1) for _ in range(20)]
        assert [message.arbitration_id for message in got if message] == list(range(20))
