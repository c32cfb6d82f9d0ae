"""A drive that exists as its maker's dictionary alone (EDS or DCF, CiA 306): to be probed.

It answers as the dictionary says that a drive would: objects that are missing, read-only, or that
take only values between two limits refuse as a real drive does.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from duoglide.drives.axis.objects import DriveObjects
from duoglide.drives.axis.sdo_client import ABORT_WORDS, SdoRefusalError
from duoglide.drives.linear_axis import object_dictionary
from duoglide.drives.pdo import Nmt
from duoglide.drives.scale import Scale
from duoglide.errors import ConfigError

if TYPE_CHECKING:
    import canopen

    from duoglide.machine import DriveSettings

NO_OBJECT, NO_SUBINDEX = 0x06020000, 0x06090011
READ_ONLY, WRITE_ONLY = 0x06010002, 0x06010001
WRONG_LENGTH, TOO_HIGH, TOO_LOW = 0x06070010, 0x06090031, 0x06090032


class DictionaryDrive(DriveObjects):
    """What a dictionary says of a drive.

    Args:
        path: Of the EDS or DCF file.
        settings: The machine's drives.
        number: Which carriage it would be, 1 to 3.

    Raises:
        ConfigError: No such file, or no dictionary.
    """

    def __init__(self, path: Path, settings: DriveSettings, number: int) -> None:
        self.settings = settings
        self.number = number
        self.node_id = settings.node_ids[number - 1]
        self.quirks = settings.quirks[number - 1]
        self.scale = Scale.of(settings, number)
        self._dictionary = object_dictionary(self.node_id)  # what the host takes objects for
        self._maker = _read_dictionary(path, self.node_id)
        self._values: dict[tuple[int, int], bytes] = {}

    def close(self) -> None:
        """Do nothing: there is no bus."""

    def command(self, command: Nmt) -> None:
        """Do nothing: a dictionary has no NMT state."""

    def read(self, index: int, sub: int = 0, timeout: float | None = None) -> int:
        """Return the number that the drive would hold."""
        data = self.read_bytes(index, sub)
        signed = self._variable(index, sub).data_type in (2, 3, 4)  # INTEGER8, 16, 32
        return int.from_bytes(data, "little", signed=signed)

    def read_bytes(self, index: int, sub: int) -> bytes:
        """Return what the drive would hold: the value of a DCF, the default of an EDS, or 0."""
        variable = self._find(index, sub, "reading")
        if not variable.readable:
            raise self._refusal("reading", index, sub, WRITE_ONLY)
        if (index, sub) in self._values:
            return self._values[index, sub]
        value = variable.default if variable.value is None else variable.value
        if isinstance(value, str):
            return value.encode("ascii", "replace")
        number = int(value or 0)
        size = max(1, len(variable) // 8)
        return (number & ((1 << 8 * size) - 1)).to_bytes(size, "little")

    def read_text(self, index: int) -> str:
        """Return a text of the dictionary."""
        return self.read_bytes(index, 0).decode("ascii", "replace")

    def write_bytes(self, index: int, sub: int, data: bytes) -> None:
        """Take a value, or refuse it, as the dictionary says."""
        variable = self._find(index, sub, "writing")
        if not variable.writable:
            raise self._refusal("writing", index, sub, READ_ONLY)
        if len(variable) != 8 * len(data):
            raise self._refusal("writing", index, sub, WRONG_LENGTH)
        value = int.from_bytes(data, "little", signed=variable.data_type in (2, 3, 4))
        if variable.max is not None and value > variable.max:
            raise self._refusal("writing", index, sub, TOO_HIGH)
        if variable.min is not None and value < variable.min:
            raise self._refusal("writing", index, sub, TOO_LOW)
        self._values[index, sub] = data

    def _find(self, index: int, sub: int, doing: str) -> Any:
        entry = self._maker.get(index)
        if entry is None:
            raise self._refusal(doing, index, sub, NO_OBJECT)
        if hasattr(entry, "data_type"):
            if sub:
                raise self._refusal(doing, index, sub, NO_SUBINDEX)
            return entry
        if sub not in entry.subindices:
            raise self._refusal(doing, index, sub, NO_SUBINDEX)
        return entry[sub]

    def _refusal(self, doing: str, index: int, sub: int, abort: int) -> SdoRefusalError:
        return SdoRefusalError(
            f"{doing} 0x{index:04X}:{sub}: refused, {ABORT_WORDS[abort]} (0x{abort:08X})",
            axis=self.number,
            abort=abort,
            index=index,
            sub=sub,
        )


def _read_dictionary(path: Path, node_id: int) -> canopen.ObjectDictionary:
    import canopen

    try:
        return canopen.import_od(str(path), node_id)
    except OSError as error:
        raise ConfigError(f"cannot read dictionary {path}: {error.strerror}") from error
    except Exception as error:  # configparser's, canopen's and others: it is data from elsewhere
        raise ConfigError(f"{path}: is no dictionary (EDS or DCF): {error}") from error
