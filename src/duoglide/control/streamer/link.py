"""The streamer's end of the bus: send frames that are ready, take what has come, never wait."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from duoglide.drives.pdo import ERROR_FRAME
from duoglide.errors import BusError

if TYPE_CHECKING:
    import can

_BUS_OFF = 0x40  # of the identifier of a SocketCAN error frame (linux/can/error.h)
_CONTROLLER = 0x04
_PASSIVE = 0x30  # of its byte 1: receive or transmit error counter above 127

Frame = tuple[int, bytes]  # COB-ID and data


class Link(Protocol):
    """What the cycle needs of a bus; tests bring one made of two lists."""

    @property
    def echoes(self) -> bool:
        """Whether frames that are sent come back."""
        ...

    def send(self, frames: Sequence[Frame]) -> None:
        """Hand frames to the bus in order.

        Raises:
            BusError: One of them was not taken.
        """
        ...

    def receive(self) -> list[Frame]:
        """Return the frames that have come, oldest first, without waiting.

        Raises:
            BusError: The bus is dead.
        """
        ...

    def close(self) -> None:
        """Leave the bus."""
        ...


class BusLink:
    """A link over any bus of python-can; closing it closes the bus."""

    def __init__(self, bus: can.BusABC) -> None:
        from duoglide.drives.bus.buses import frame_sender
        from duoglide.drives.bus.socketcand import SocketcandBus

        self._bus = bus
        self._send = frame_sender(bus)
        self._receive = bus.receive_frames if isinstance(bus, SocketcandBus) else self._take

    @property
    def echoes(self) -> bool:
        """Whether frames that are sent come back, as those of a multicast group do."""
        from can.interfaces.udp_multicast import UdpMulticastBus

        return isinstance(self._bus, UdpMulticastBus)

    def send(self, frames: Sequence[Frame]) -> None:
        """Hand frames to the bus in order; BusError if one is not taken (ENOBUFS, link down)."""
        try:
            self._send(frames)
        except Exception as error:  # whatever a driver raises: the cycle goes on
            raise BusError(f"the bus did not take a frame: {error}") from error

    def receive(self) -> list[Frame]:
        """Return the frames that have come; BusError if the bus is dead."""
        try:
            return self._receive()
        except Exception as error:  # whatever a driver makes of what it was sent
            raise BusError(f"the bus is dead: {error}") from error

    def _take(self) -> list[Frame]:
        frames: list[Frame] = []
        while (message := self._bus.recv(0)) is not None:
            kind = message.arbitration_id
            if type(kind) is not int:  # on a multicast group anybody may write anything
                continue
            if message.is_error_frame:
                frames.append((ERROR_FRAME, bytes((kind & 0xFF,)) + bytes(message.data)))
            elif not (message.is_extended_id or message.is_remote_frame or message.is_fd):
                frames.append((kind, bytes(message.data)))
        return frames

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()


def is_fatal(error_frame: bytes) -> bool:
    """Whether an error frame says bus-off or error-passive.

    Args:
        error_frame: Low byte of its identifier, then its data, as ``receive`` gives it.
    """
    if not error_frame:
        return False
    kind = error_frame[0]
    passive = len(error_frame) > 2 and bool(error_frame[2] & _PASSIVE)
    return bool(kind & _BUS_OFF) or (bool(kind & _CONTROLLER) and passive)
