"""What a bus says to somebody who only listens: of its drives, and whether a host commands them.

Nothing is sent. A second host that asks would disturb the one that moves the machine: both would
wait for the same SDO answers. Whatever its drives say in every cycle is there for everybody.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from duoglide.drives import pdo
from duoglide.drives.bus.buses import open_bus
from duoglide.errors import BusError

if TYPE_CHECKING:
    import can

    from duoglide.machine import DriveSettings

_NODE = 0x7F  # of an identifier, the bits of the node number
_PATIENCE = 1.0  # with a host whose drives have not all been heard [s]
_ALONE_PATIENCE = 4.0  # a host that was killed stops the machine first, and then falls silent [s]


@dataclass(frozen=True, slots=True)
class Overheard:
    """What was heard.

    Attributes:
        host: What only a host sends, in the order in which it was first heard; empty for no host.
        feedback: The newest of each drive, by node number; missing where there was none.
        heartbeats: The NMT state of each node that sent a heartbeat; None where it sent no state.
        emergencies: The newest of each drive that sent one.
    """

    host: tuple[str, ...]
    feedback: Mapping[int, pdo.Feedback]
    heartbeats: Mapping[int, pdo.NmtState | None]
    emergencies: Mapping[int, pdo.Emergency]


class _Ear:
    """Takes frame after frame.

    Args:
        settings: Whose drives.
    """

    def __init__(self, settings: DriveSettings) -> None:
        self._nodes = settings.node_ids
        self._signs = _list_signs_of_a_host(settings)
        self._host: dict[str, None] = {}  # a set that keeps its order
        self._feedback: dict[int, pdo.Feedback] = {}
        self._heartbeats: dict[int, pdo.NmtState | None] = {}
        self._emergencies: dict[int, pdo.Emergency] = {}

    @property
    def misses_some(self) -> bool:
        """Whether there is a host, and a drive of which something has not been heard yet."""
        known = self._feedback.keys() & self._heartbeats.keys()
        return bool(self._host) and not known.issuperset(self._nodes)

    def take(self, message: can.Message) -> None:
        """Remember what a frame says; what is no data frame, or too short, says nothing."""
        if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            return
        if (sign := _find_sign(message, self._signs)) is not None:
            self._host[sign] = None
        kind, node = message.arbitration_id & ~_NODE, message.arbitration_id & _NODE
        data = message.data
        if kind == pdo.HEARTBEAT and data:
            state = data[0] & 0x7F  # the highest bit is another protocol's
            self._heartbeats[node] = pdo.NmtState(state) if state in set(pdo.NmtState) else None
        elif node not in self._nodes:
            return
        elif kind == pdo.TPDO1 and len(data) >= pdo.FEEDBACK.size:
            self._feedback[node] = pdo.unpack_feedback(data)
        elif kind == pdo.EMCY and len(data) >= 2:
            self._emergencies[node] = pdo.unpack_emergency(data)

    def heard(self) -> Overheard:
        """Return all of it."""
        return Overheard(tuple(self._host), self._feedback, self._heartbeats, self._emergencies)


def listen(name: str, settings: DriveSettings) -> Overheard:
    """Listen for three heartbeats and ten cycles, and send nothing.

    Where a host is heard, but not yet all of its drives, up to a second.

    Args:
        name: Of the bus; anything but ``virtual``, whose hub is one's own.
        settings: Whose node numbers, heartbeat and cycle to expect.

    Raises:
        BusError: The bus cannot be opened or read.
    """
    import can

    ear = _Ear(settings)
    enough = max(3.0 * settings.heartbeat_period, 10.0 * settings.cycle)
    with open_bus(name, settings.bit_rate) as bus:
        begin = time.monotonic()
        try:
            for patience in (enough, max(enough, _PATIENCE)):
                while (left := begin + patience - time.monotonic()) > 0.0:
                    if patience > enough and not ear.misses_some:
                        break
                    if (message := bus.recv(left)) is not None:
                        ear.take(message)
        except can.CanError as error:
            raise BusError(f"bus {name}: {error}") from error
    return ear.heard()


def quiet_time(settings: DriveSettings) -> float:
    """Return for how long no host may be heard on a bus that has none [s]."""
    return max(2.0 * settings.heartbeat_period, 5.0 * settings.cycle)


def require_alone(name: str, settings: DriveSettings) -> None:
    """Listen until no other host has been heard for two periods of its heartbeat.

    Args:
        name: Of the bus; anything but ``virtual``, whose hub is one's own.
        settings: Whose node numbers, heartbeat and cycle to expect.

    Raises:
        BusError: The bus cannot be opened or read, or another host does not fall silent.
    """
    import can

    signs = _list_signs_of_a_host(settings)
    quiet = quiet_time(settings)
    with open_bus(name, settings.bit_rate) as bus:
        try:
            begin = last = time.monotonic()
            while (now := time.monotonic()) - last < quiet:
                message = bus.recv(last + quiet - now)
                sign = None if message is None else _find_sign(message, signs)
                if sign is not None:
                    last = time.monotonic()
                    if last - begin > _ALONE_PATIENCE:
                        raise BusError(
                            f"bus {name}: another host is on it, its {sign} is heard. Two would"
                            " pull at the same carriages: end the other one first (a duoglide"
                            " stream, view or script, or another master). `duoglide view --join`"
                            " watches and stops the run of another duoglide on this computer,"
                            " `duoglide status` only listens"
                        )
        except can.CanError as error:
            raise BusError(f"bus {name}: {error}") from error


def _list_signs_of_a_host(settings: DriveSettings) -> dict[int, str]:
    """Return the frames that only a host sends."""
    setpoints = {pdo.RPDO1 + n: f"setpoint for node {n}" for n in settings.node_ids}
    heartbeat = {pdo.HEARTBEAT + settings.host_id: f"heartbeat as node {settings.host_id}"}
    return {pdo.SYNC: "SYNC", **setpoints, **heartbeat}


def _find_sign(message: can.Message, signs: dict[int, str]) -> str | None:
    """Return what a frame says of a host; None for what others send too."""
    if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
        return None
    return signs.get(message.arbitration_id)
