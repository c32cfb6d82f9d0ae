"""The object dictionary of a simulated drive: what the EDS says, with the EDS's rules enforced."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from duoglide.drives.application import AxisApplication
from duoglide.drives.firmware_objects import DEFAULTS, NO_OBJECT, OUT_OF_RANGE, RefusalError
from duoglide.drives.linear_axis import object_dictionary

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

READ_ONLY = 0x06010002
NO_SUBINDEX = 0x06090011
WRONG_LENGTH = 0x06070010
TOO_HIGH = 0x06090031
TOO_LOW = 0x06090032
NOT_MAPPABLE = 0x06040041
PDO_TOO_LONG = 0x06040042
UNSUPPORTED_ACCESS = 0x06010000

_INVALID = 1 << 31  # of a PDO's COB-ID
_LIVE = {0x2010, 0x603F, 0x6041, 0x6061, 0x6064, 0x606C, 0x60F4, 0x60FD}
_MOST_ERRORS = 4  # 0x1003


def read_variables(node_id: int) -> dict[tuple[int, int], ODVariable]:
    """Return every variable of the EDS by index and sub-index."""
    entries = object_dictionary(node_id).values()
    variables = (v for e in entries for v in (e.values() if hasattr(e, "values") else (e,)))
    return {(v.index, v.subindex): v for v in variables}


class NodeObjects:
    """All objects of a drive; those of the application are passed on to it."""

    def __init__(
        self, variables: Mapping[tuple[int, int], ODVariable], axis: AxisApplication
    ) -> None:
        self._axis = axis
        self._errors: list[int] = []
        self.variables = variables
        self._defaults = {key: v.default for key, v in variables.items()}
        self._values: dict[tuple[int, int], int | str] = dict(self._defaults)
        self.map_changed = True  # somebody has to look at the PDO parameters again

    def override(self, index: int, sub: int, value: int | str) -> None:
        """Make the drive say something else, for a test."""
        self._values[index, sub] = value

    def reset_communication(self) -> None:
        """Bring the communication objects, 0x1000 to 0x1FFF, back to their defaults."""
        for key, value in self._defaults.items():
            if key[0] < 0x2000:
                self._values[key] = value
                if key in DEFAULTS:
                    self._axis.write(*key, DEFAULTS[key])
        self.map_changed = True

    def remember_error(self, code: int) -> None:
        """Keep an emergency in 0x1003."""
        if code:
            self._errors = [code, *self._errors][:_MOST_ERRORS]

    # -- numbers ------------------------------------------------------------------------------

    def read(self, index: int, sub: int) -> int:
        """Return a number from the dictionary."""
        if index in _LIVE or (index, sub) in DEFAULTS:
            return self._axis.read(index, sub)
        if index == 0x1001:
            return self._axis.error_register
        if index == 0x1003:
            errors = [len(self._errors), *self._errors]
            return errors[sub] if sub < len(errors) else 0
        return int(self._values[index, sub])

    def write(self, index: int, sub: int, value: int) -> None:
        """Write a number under the rules of the EDS; RefusalError says which one it breaks."""
        variable = self._variable(index, sub)
        if not variable.writable:
            raise RefusalError(READ_ONLY)
        if variable.max is not None and value > variable.max:
            raise RefusalError(TOO_HIGH)
        if variable.min is not None and value < variable.min:
            raise RefusalError(TOO_LOW)
        if 0x1400 <= index <= 0x1BFF:
            self._check_pdo(index, sub, value)
        if (index, sub) in DEFAULTS:
            self._axis.write(index, sub, value)
        elif index == 0x1003:
            self._errors.clear()
        self._values[index, sub] = value

    def _variable(self, index: int, sub: int) -> ODVariable:
        if (index, sub) in self.variables:
            return self.variables[index, sub]
        known = any(key[0] == index for key in self.variables)
        raise RefusalError(NO_SUBINDEX if known else NO_OBJECT)

    def _check_pdo(self, index: int, sub: int, value: int) -> None:
        """Hold to the order in which a PDO may be mapped (CiA 301 7.5.2.36)."""
        self.map_changed = True
        mapping = index & 0x200  # 0x16xx and 0x1Axx; 0x14xx and 0x18xx are the parameters
        cob_id = int(self._values[index & ~0x200, 1])
        if not mapping:
            if sub == 1 and not (cob_id | value) & _INVALID and (cob_id ^ value) & 0x7FF:
                raise RefusalError(OUT_OF_RANGE)
            return
        if not cob_id & _INVALID:
            raise RefusalError(UNSUPPORTED_ACCESS)
        if sub and self._values[index, 0]:
            raise RefusalError(UNSUPPORTED_ACCESS)
        if sub and value:
            self._check_mappable(value)
        elif not sub:
            bits = [int(self._values[index, i + 1]) & 0xFF for i in range(value)]
            if sum(bits) > 64:
                raise RefusalError(PDO_TOO_LONG)

    def _check_mappable(self, entry: int) -> None:
        variable = self.variables.get((entry >> 16, entry >> 8 & 0xFF))
        if variable is None or not variable.pdo_mappable or len(variable) != entry & 0xFF:
            raise RefusalError(NOT_MAPPABLE)

    # -- bytes, for the SDO server ------------------------------------------------------------

    def upload(self, index: int, sub: int) -> bytes:
        """Return an object as bytes."""
        variable = self._variable(index, sub)
        value = self._values[index, sub]
        raw = value if isinstance(value, str) else self.read(index, sub)
        return bytes(variable.encode_raw(raw))

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Write an object from bytes."""
        variable = self._variable(index, sub)
        if not variable.writable:
            raise RefusalError(READ_ONLY)
        if len(data) * 8 != len(variable):
            raise RefusalError(WRONG_LENGTH)
        self.write(index, sub, int(variable.decode_raw(data)))
