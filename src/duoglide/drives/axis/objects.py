"""The objects of one drive, as the host reads and writes them over SDO.

Blocking: nothing here may be called from a callback of the bus, and nothing belongs in the cycle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import can

from duoglide.drives import pdo
from duoglide.drives.axis.sdo_client import (
    WRONG_LENGTHS,
    ObjectError,
    SdoClient,
    SdoRefusalError,
)
from duoglide.drives.linear_axis import object_dictionary
from duoglide.drives.scale import Scale
from duoglide.errors import BusError, DriveError
from duoglide.machine import DriveSettings

if TYPE_CHECKING:
    import canopen


class DriveObjects:
    """The object dictionary of one drive.

    Args:
        network: The CANopen network that it is on.
        settings: The machine's drives.
        number: Which carriage, 1 to 3.
    """

    def __init__(self, network: canopen.Network, settings: DriveSettings, number: int) -> None:
        self.network = network
        self.settings = settings
        self.number = number
        self.node_id = settings.node_ids[number - 1]
        self.quirks = settings.quirks[number - 1]
        self.scale = Scale.of(settings, number)
        self._dictionary = object_dictionary(self.node_id)
        self._sdo = SdoClient(
            network, self.node_id, number, settings.sdo_timeout, settings.sdo_retries
        )

    def close(self) -> None:
        """Stop listening to the drive; it keeps its state."""
        self._sdo.close()

    def read(self, index: int, sub: int = 0, timeout: float | None = None) -> int:
        """Return a number from the drive's object dictionary."""
        data = self._sdo.upload(index, sub, timeout)
        signed = self._variable(index, sub).data_type in (2, 3, 4)  # INTEGER8, 16, 32
        return int.from_bytes(data, "little", signed=signed)

    def read_bytes(self, index: int, sub: int) -> bytes:
        """Return an object that the EDS need not know."""
        return self._sdo.upload(index, sub)

    def read_text(self, index: int) -> str:
        """Return a text from the drive's object dictionary."""
        return self._sdo.upload(index, 0).decode("ascii", "replace")

    def write(self, index: int, sub: int, value: int) -> None:
        """Write a number to the drive's object dictionary, in as many bytes as it has there.

        Raises:
            SdoRefusalError: The drive refuses, and not for the number of bytes.
        """
        size = len(self._variable(index, sub)) // 8
        try:
            self.write_bytes(index, sub, value.to_bytes(size, "little", signed=value < 0))
        except SdoRefusalError as refusal:
            kept = len(self.read_bytes(index, sub)) if refusal.abort in WRONG_LENGTHS else size
            if kept == size or not _fits(value, kept):
                raise
            self.write_bytes(index, sub, value.to_bytes(kept, "little", signed=value < 0))

    def write_bytes(self, index: int, sub: int, data: bytes) -> None:
        """Write an object that the EDS need not know."""
        self._sdo.download(index, sub, data)

    def write_checked(self, index: int, sub: int, value: int) -> None:
        """Write a number and read it back; one that is there already may be read-only.

        Raises:
            SdoRefusalError: The drive refuses, and holds another value.
            ObjectError: The drive has kept another value.
        """
        try:
            self.write(index, sub, value)
        except SdoRefusalError:
            if not self.holds(index, sub, value):
                raise
            return
        kept = self.read(index, sub)
        if kept != value:
            raise self.mismatch(index, sub, value, kept)

    def mismatch(self, index: int, sub: int, wanted: int, kept: int) -> ObjectError:
        """Make the error for an object that does not keep what is written."""
        return ObjectError(
            f"axis {self.number} (node {self.node_id}), 0x{index:04X}:{sub}: was written as"
            f" {wanted} but reads {kept}",
            axis=self.number,
            index=index,
            sub=sub,
        )

    def holds(self, index: int, sub: int, value: int) -> bool:
        """Whether an object reads as ``value``; False where the drive refuses to be read."""
        try:
            return self.read(index, sub) == value
        except SdoRefusalError:
            return False

    def has(self, index: int) -> bool:
        """Whether the machine file says that the drive has an optional object."""
        return self.quirks.has(index)

    def _variable(self, index: int, sub: int) -> canopen.objectdictionary.ODVariable:
        entry = self._dictionary[index]
        return entry if hasattr(entry, "data_type") else entry[sub]

    def error(self, message: str, code: int = 0) -> DriveError:
        """Make an error that names this axis."""
        return DriveError(
            f"axis {self.number} (node {self.node_id}): {message}", axis=self.number, code=code
        )

    def command(self, command: pdo.Nmt) -> None:
        """Send an NMT command to this drive; BusError if the bus has failed."""
        try:
            self.network.send_message(pdo.NMT, pdo.pack_nmt(command, self.node_id))
        except can.CanError as error:
            raise BusError(f"axis {self.number}, NMT {command.name}: {error}") from error


def _fits(value: int, size: int) -> bool:
    """Whether so many bytes hold a number, with a sign where it is negative."""
    return -(1 << (8 * size - 1)) <= value < 1 << 8 * size
