"""Whether another host commands the drives of a bus: two would pull at the same carriages."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from duoglide.drives import pdo
from duoglide.drives.buses import open_bus
from duoglide.errors import BusError

if TYPE_CHECKING:
    import can

    from duoglide.machine import DriveSettings

_PATIENCE = 4.0  # a host that was killed stops the machine first, and then falls silent [s]


def require_alone(name: str, settings: DriveSettings) -> None:
    """Listen until no other host has been heard for two periods of its heartbeat.

    Args:
        name: Of the bus; anything but ``virtual``, whose hub is one's own.
        settings: Whose node numbers, heartbeat and cycle to expect.

    Raises:
        BusError: The bus cannot be opened or read, or another host does not fall silent.
    """
    import can

    signs = signs_of_a_host(settings)
    quiet = max(2.0 * settings.heartbeat_period, 5.0 * settings.cycle)
    with open_bus(name, settings.bit_rate) as bus:
        try:
            begin = last = time.monotonic()
            while (now := time.monotonic()) - last < quiet:
                message = bus.recv(last + quiet - now)
                sign = None if message is None else sign_in(message, signs)
                if sign is not None:
                    last = time.monotonic()
                    if last - begin > _PATIENCE:
                        raise BusError(
                            f"bus {name}: another host is on it, its {sign} is heard. Two would"
                            " pull at the same carriages: end the other one first (a duoglide"
                            " stream, view or script, or another master). `duoglide view --join`"
                            " watches and stops the run of another duoglide on this computer,"
                            " `duoglide status` only listens"
                        )
        except can.CanError as error:
            raise BusError(f"bus {name}: {error}") from error


def signs_of_a_host(settings: DriveSettings) -> dict[int, str]:
    """Return the frames that only a host sends."""
    setpoints = {pdo.RPDO1 + n: f"setpoint for node {n}" for n in settings.node_ids}
    heartbeat = {pdo.HEARTBEAT + settings.host_id: f"heartbeat as node {settings.host_id}"}
    return {pdo.SYNC: "SYNC", **setpoints, **heartbeat}


def sign_in(message: can.Message, signs: dict[int, str]) -> str | None:
    """Return what a frame says of a host; None for what others send too."""
    if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
        return None
    return signs.get(message.arbitration_id)
