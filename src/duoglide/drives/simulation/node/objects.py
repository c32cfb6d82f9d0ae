"""The object dictionary of a simulated drive: what the EDS says, with the EDS's rules enforced."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from duoglide.drives import standstill
from duoglide.drives.simulation.firmware.objects import (
    DEFAULTS,
    NO_OBJECT,
    OUT_OF_RANGE,
    WRONG_STATE,
    RefusalError,
)
from duoglide.drives.simulation.makers.imitation import CONTRACT, Imitation
from duoglide.drives.simulation.node.application import AxisApplication
from duoglide.drives.simulation.node.memory import LOAD, RESTORE, SAVE, STORE, ParameterMemory
from duoglide.drives.standstill import Standstill

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
NOT_STORED = 0x08000020
NO_DATA = 0x08000024

_INVALID = 1 << 31  # of a PDO's COB-ID
_EXTENDED = 1 << 29
_ON_EVENT = (254, 255)  # transmission types
_LIVE = {0x2010, 0x603F, 0x6041, 0x6061, 0x6064, 0x606C, 0x60F4, 0x60FD}
_MOST_ERRORS = 4  # 0x1003


class NodeObjects:
    """All objects of a drive; those of the application are passed on to it.

    Args:
        variables: That the drive has, by index and sub-index.
        axis: Its application.
        memory: What it keeps without its supply.
        standstill: That of the drives on its bus.
        imitation: In what it differs from the contract.
    """

    def __init__(
        self,
        variables: Mapping[tuple[int, int], ODVariable],
        axis: AxisApplication,
        memory: ParameterMemory,
        standstill: Standstill,
        imitation: Imitation = CONTRACT,
    ) -> None:
        self._imitation = imitation
        self._standstill = standstill
        self._axis = axis
        self._memory = memory
        self._errors: list[int] = []
        self.variables = variables
        self._values: dict[tuple[int, int], int | str] = {}
        self._power_on(0xFFFF)

    def _power_on(self, last: int) -> None:
        """Give the objects up to index ``last`` what they hold after power-on."""
        for key, variable in self.variables.items():
            if key[0] <= last:
                value = self._memory.stored.get(key, variable.default)
                self._values[key] = value
                if self._is_applied(key) and (key[0] < 0x2000 or key in self._memory.stored):
                    self._axis.write(*key, value)
        self.map_changed = True  # somebody has to look at the PDO parameters again

    def override(self, index: int, sub: int, value: int | str) -> None:
        """Make the drive say something else, for a test."""
        self._values[index, sub] = value

    def reset_communication(self) -> None:
        """Bring the communication objects, 0x1000 to 0x1FFF, back to what they are at power-on."""
        self._power_on(0x1FFF)

    def remember_error(self, code: int) -> None:
        """Keep an emergency in 0x1003."""
        if code:
            self._errors = [code, *self._errors][:_MOST_ERRORS]

    # -- numbers ------------------------------------------------------------------------------

    def read(self, index: int, sub: int) -> int:
        """Return a number from the dictionary."""
        if (index, sub) in self._imitation.values and (index, sub) not in DEFAULTS:
            return int(self._values[index, sub])
        if index in _LIVE or self._is_applied((index, sub)):
            return self._axis.read(index, sub)
        if index == 0x1001:
            return self._axis.error_register
        if index == 0x1003:
            return self._read_error(sub)
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
        if value not in self._imitation.allowed.get((index, sub), (value,)):
            raise RefusalError(OUT_OF_RANGE)
        if index in _COMMANDS:
            _COMMANDS[index](self, value)
            return
        if 0x1400 <= index <= 0x1BFF:
            self._check_pdo(index, sub, value)
        elif index == 0x1019:
            self._check_counter(value)
        if self._is_applied((index, sub)):
            self._axis.write(index, sub, value)
        self._values[index, sub] = value

    def _is_applied(self, key: tuple[int, int]) -> bool:
        """Whether an object is the application's."""
        return key in DEFAULTS or key == self._imitation.home_object

    def _read_error(self, sub: int) -> int:
        """Return one field of the error history; the latest error is the first."""
        if not sub:
            return len(self._errors)
        if sub > len(self._errors):
            raise RefusalError(NO_DATA)
        return self._errors[sub - 1]

    # -- what a write makes happen ------------------------------------------------------------

    def _forget_errors(self, value: int) -> None:
        if value:
            raise RefusalError(OUT_OF_RANGE)
        self._errors.clear()

    def _store(self, signature: int) -> None:
        if signature != SAVE:
            raise RefusalError(NOT_STORED)
        if self._axis.powered:  # a memory being written holds up the control loop
            raise RefusalError(WRONG_STATE)
        writable = (key for key, variable in self.variables.items() if variable.writable)
        self._memory.store({key: self.read(*key) for key in writable})

    def _restore(self, signature: int) -> None:
        if signature != LOAD:
            raise RefusalError(NOT_STORED)
        self._memory.forget()

    # -- rules --------------------------------------------------------------------------------

    def _check_counter(self, value: int) -> None:
        """Let SYNC's counter change only while no cycle is set (CiA 301 7.5.2.22)."""
        if value == 1:
            raise RefusalError(OUT_OF_RANGE)
        if self._values[0x1006, 0]:
            raise RefusalError(WRONG_STATE)

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
            self._check_parameter(index, sub, value, cob_id)
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

    def _check_parameter(self, index: int, sub: int, value: int, cob_id: int) -> None:
        """Check a communication parameter of a PDO (CiA 301 7.5.2.35 and 7.5.2.37)."""
        sends = index >= 0x1800
        if sub == 1:
            moved = not (cob_id | value) & _INVALID and (cob_id ^ value) & 0x7FF
            if moved or value & _EXTENDED:
                raise RefusalError(OUT_OF_RANGE)
        elif sub == 2:
            if value not in _ON_EVENT and not sends <= value <= 240:
                raise RefusalError(OUT_OF_RANGE)
        elif sub == 3 and not cob_id & _INVALID:
            raise RefusalError(UNSUPPORTED_ACCESS)

    def _check_mappable(self, entry: int) -> None:
        variable = self.variables.get((entry >> 16, entry >> 8 & 0xFF))
        if variable is None or not variable.pdo_mappable or len(variable) != entry & 0xFF:
            raise RefusalError(NOT_MAPPABLE)

    # -- bytes, for the SDO server ------------------------------------------------------------

    def upload(self, index: int, sub: int) -> bytes:
        """Return an object as bytes."""
        if index == standstill.INDEX and sub == standstill.SIGN and self._imitation == CONTRACT:
            return standstill.signature()
        if index == standstill.INDEX and self._standstill.seconds:
            return self._standstill.agree()
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


_COMMANDS: dict[int, Callable[[NodeObjects, int], None]] = {
    0x1003: NodeObjects._forget_errors,
    STORE: NodeObjects._store,
    RESTORE: NodeObjects._restore,
}
