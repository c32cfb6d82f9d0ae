"""CAN buses by name.

==================================== ==============================================================
name                                 what it is
==================================== ==============================================================
``virtual``                          three simulated drives of one's own and a hub on the loopback
``socketcand:HOST:PORT[/CHANNEL]``   a bus behind a socketcand server, or another's hub
``udp:GROUP:PORT``                   python-can's multicast bus, kept on this computer
``socketcan:IFACE``                  a CAN interface of the Linux kernel
==================================== ==============================================================
"""

from __future__ import annotations

import ipaddress
import os
import socket
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from duoglide.errors import BusError

if TYPE_CHECKING:
    import can

_UDP_ROOM = 1 << 22  # bytes for what comes while a process is kept waiting
_BEYOND_THE_LIMIT = 33  # SO_RCVBUFFORCE, which Python's socket does not name
_FORMS = "virtual, socketcand:HOST:PORT, udp:GROUP:PORT, socketcan:IFACE"


class BusKind(Enum):
    """The kinds of bus, by the word that a name begins with."""

    VIRTUAL = "virtual"
    SOCKETCAND = "socketcand"
    UDP = "udp"
    SOCKETCAN = "socketcan"
    IN_PROCESS = "inprocess"  # python-can's virtual bus, within one process: for unit tests


@dataclass(frozen=True, slots=True)
class BusName:
    """A bus name, taken apart.

    Attributes:
        kind: What sort of bus.
        place: Host, multicast group, interface or channel; empty for ``virtual``.
        port: TCP or UDP port; 0 where there is none.
        channel: What a socketcand server shall open.
    """

    kind: BusKind
    place: str = ""
    port: int = 0
    channel: str = "can0"

    def __str__(self) -> str:
        text = self.kind.value
        text += f":{self.place}" if self.place else ""
        text += f":{self.port}" if self.port else ""
        return text + (f"/{self.channel}" if self.channel != "can0" else "")


def parse_bus(name: str) -> BusName:
    """Take a bus name apart.

    Raises:
        BusError: Not a bus name; lists the forms.
    """
    word, _, rest = str(name).partition(":")
    try:
        kind = BusKind(word)
    except ValueError:
        raise BusError(f"unknown bus {name!r}: the forms are {_FORMS}") from None
    if kind is BusKind.VIRTUAL:
        if rest:
            raise BusError(f"bus {name!r}: 'virtual' takes no address")
        return BusName(kind)
    if kind in (BusKind.SOCKETCAN, BusKind.IN_PROCESS):
        if not rest:
            raise BusError(f"bus {name!r}: which interface? For example socketcan:can0")
        return BusName(kind, rest)
    place, _, port = rest.rpartition(":")
    port, _, channel = port.partition("/")
    if not place or not port.isdecimal() or not 0 < int(port) < 65536:
        raise BusError(f"bus {name!r}: must be {word}:{'GROUP' if word == 'udp' else 'HOST'}:PORT")
    if kind is BusKind.UDP:
        _require_multicast(name, place)
    return BusName(kind, place, int(port), channel or "can0")


def _require_multicast(name: str, group: str) -> None:
    try:
        good = ipaddress.ip_address(group).is_multicast
    except ValueError:
        good = False
    if not good:
        raise BusError(
            f"bus {name!r}: {group} is no multicast group; udp:239.0.0.1:43113 would be one"
        )


def open_bus(name: str, bit_rate: int = 1_000_000) -> can.BusABC:
    """Open a bus by name; the caller shuts it down.

    Args:
        name: Any form but ``virtual``, which has an address only once its hub runs: see
            ``duoglide.drives.simulation.simulated.SimulatedDrives``.
        bit_rate: What the interface should run at [bit/s]; a kernel interface has its own.

    Raises:
        BusError: No such bus, or nobody answers there; says what to start.
    """
    import can

    bus = parse_bus(name)
    opener = {
        BusKind.VIRTUAL: _refuse_virtual,
        BusKind.SOCKETCAND: _open_socketcand,
        BusKind.UDP: _open_udp,
        BusKind.SOCKETCAN: _open_socketcan,
        BusKind.IN_PROCESS: _open_in_process,
    }[bus.kind]
    try:
        return opener(bus, bit_rate)
    except (OSError, can.CanError, ImportError) as error:
        raise BusError(f"cannot open bus {name}: {error}{_remedy(bus)}") from error


def _refuse_virtual(bus: BusName, bit_rate: int) -> can.BusABC:
    raise BusError("the bus 'virtual' has no address until its simulated drives run")


def _open_socketcand(bus: BusName, bit_rate: int) -> can.BusABC:
    from duoglide.drives.bus.socketcand import SocketcandBus

    return SocketcandBus(bus.place, bus.port, bus.channel)


def _open_udp(bus: BusName, bit_rate: int) -> can.BusABC:
    from can.interfaces.udp_multicast import UdpMulticastBus

    opened = UdpMulticastBus(bus.place, bus.port, hop_limit=0, fd=False)  # stay on this computer
    with socket.socket(fileno=os.dup(opened.fileno())) as same:
        try:
            same.setsockopt(socket.SOL_SOCKET, _BEYOND_THE_LIMIT, _UDP_ROOM)
        except OSError:  # only for root on Linux; others get what net.core.rmem_max allows
            same.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _UDP_ROOM)
    return opened


def _open_socketcan(bus: BusName, bit_rate: int) -> can.BusABC:
    from can.interfaces.socketcan import SocketcanBus

    return SocketcanBus(bus.place)


def _open_in_process(bus: BusName, bit_rate: int) -> can.BusABC:
    from can.interfaces.virtual import VirtualBus

    return VirtualBus(bus.place)


def _remedy(bus: BusName) -> str:
    """Say what would make the bus open."""
    if bus.kind is BusKind.SOCKETCAND:
        return "; is a socketcand server, or `duoglide drives --bus virtual`, running there?"
    if bus.kind is BusKind.SOCKETCAN:
        return f"; `ip link set {bus.place} up type can bitrate 1000000` brings an interface up"
    return ""


def frame_sender(bus: can.BusABC) -> Callable[[Sequence[tuple[int, bytes]]], None]:
    """Return the quickest way to send several standard frames on ``bus``, in their order.

    On socketcand that is one system call for all of them. The function raises can.CanError.
    """
    import can

    from duoglide.drives.bus.socketcand import SocketcandBus

    if isinstance(bus, SocketcandBus):
        return bus.send_frames

    def send(frames: Sequence[tuple[int, bytes]]) -> None:
        for can_id, data in frames:
            bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    return send
