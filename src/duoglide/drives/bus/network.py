"""canopen's network on a bus that may go away.

canopen's own has python-can print a traceback from its reading thread when that happens, writes to
the log of whoever has none, and fails once more when it is disconnected.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import can
import canopen

from duoglide.drives.bus.buses import open_bus
from duoglide.drives.pdo import HEARTBEAT, SDO_REPLY
from duoglide.errors import BusError

_TURN = 0.02  # [s] that the reading thread waits for a frame, and disconnecting for that thread
_LISTENS = (SDO_REPLY, HEARTBEAT)  # the host's own connection; the rest is the streamer's


class _Network(canopen.Network):  # type: ignore[misc]  # canopen is not typed
    NOTIFIER_CYCLE = _TURN

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        self.listeners.append(_Ear())

    def check(self) -> None:
        """Raise can.CanOperationError once reading has failed; whoever sends next hears of it."""
        error = None if self.notifier is None else self.notifier.exception
        if error is not None:
            raise can.CanOperationError(str(error)) from error


class _Ear(can.Listener):
    """Hears nothing but that reading has failed."""

    def on_message_received(self, msg: can.Message) -> None:
        """Leave it to the others."""

    def on_error(self, exc: Exception) -> None:
        """Have the reading thread try again, but not as often as it can."""
        time.sleep(_TURN)


@contextmanager
def open_network(name: str, bit_rate: int) -> Iterator[canopen.Network]:
    """Connect to the objects and the states of all nodes of a bus, and disconnect again.

    Args:
        name: Of the bus, as for ``open_bus``.
        bit_rate: As for ``open_bus`` [bit/s].

    Raises:
        BusError: The bus cannot be opened, or has failed since.
    """
    opened = open_bus(name, bit_rate)
    opened.set_filters([{"can_id": i, "can_mask": 0x780, "extended": False} for i in _LISTENS])
    network = _Network(opened)
    try:
        network.connect()
        yield network
    except can.CanError as error:
        raise BusError(f"bus {name}: {error}") from error
    finally:
        with suppress(can.CanError):  # whoever still asked has heard of it
            network.disconnect()
