"""The application of an imitated drive: that of firmware_interface/, with its maker's ways."""

from __future__ import annotations

from duoglide.drives.cia402 import Command, Mode, State, Status
from duoglide.drives.pdo import INTERLOCK
from duoglide.drives.simulation.firmware.homing import SEARCHES, HomingAxis
from duoglide.drives.simulation.makers.imitation import Imitation
from duoglide.machine.drive_quirks import Interlock

_HOME = (0x607C, 0)
_METHOD = (0x6098, 0)
_HERE, _NONE = 37, 0  # homing methods of the contract
_VELOCITIES = {(0x606C, 0), (0x607F, 0), (0x6099, 1), (0x6099, 2)}
_ACCELERATIONS = {(0x6085, 0), (0x609A, 0)}
_START = 0x10  # of the controlword in homing mode
_LARGEST = (1 << 31) - 1
_FOLLOWS = int(Status.FOLLOWS_COMMAND)


class ForeignAxis(HomingAxis):
    """A ``HomingAxis`` that differs from the contract as an ``Imitation`` says.

    Args:
        imitation: In what it differs.
    """

    def __init__(self, imitation: Imitation) -> None:
        super().__init__()
        self._imitation = imitation
        for key in imitation.values.keys() & self.objects.keys():
            self.objects[key] = imitation.values[key]
        self._method = imitation.here  # until it is told another one

    def read(self, index: int, sub: int) -> int:
        """Return an object as the drive has it: its own place, sign and unit."""
        key = (index, sub)
        if key == _METHOD:
            return self._method
        if key == self._imitation.home_object:
            return self._imitation.home_sign * super().read(*_HOME)
        if key == (0x60FD, 0):
            return self._polarised(super().read(*key))
        return round(super().read(*key) / self._unit(index, sub))

    def write(self, index: int, sub: int, value: int) -> None:
        """Take an object as the drive has it."""
        key = (index, sub)
        if key == _METHOD:
            self._method = value
            known = _HERE if value == self._imitation.here else _NONE
            super().write(index, sub, value if value in SEARCHES else known)
        elif key == self._imitation.home_object:
            super().write(*_HOME, self._imitation.home_sign * value)
        else:
            super().write(index, sub, min(round(value * self._unit(index, sub)), _LARGEST))

    @property
    def statusword(self) -> int:
        """The statusword, 0x6041, perhaps without the bit that says that it follows."""
        word = super().statusword
        if self._imitation.follows_bit or self.mode == Mode.HOMING:
            return word
        return word & ~_FOLLOWS

    def _unit(self, index: int, sub: int) -> float:
        """Return increments/s, or increments/s^2, of one unit of an object; 1 for all others."""
        if (index, sub) in _VELOCITIES:
            return self._imitation.velocity_unit
        return self._imitation.acceleration_unit if (index, sub) in _ACCELERATIONS else 1.0

    def _polarised(self, inputs: int) -> int:
        if self._imitation.interlock is Interlock.CLEAR:
            return inputs ^ INTERLOCK
        return inputs & ~INTERLOCK if self._imitation.interlock is Interlock.NONE else inputs

    def _command_enabled(self, command: Command, word: int, rising: int) -> None:
        idle = not (self._homing_done or self._homing_error or self._legs)
        if self._imitation.homes_on_level and self.state is State.OPERATION_ENABLED and idle:
            rising |= word & _START
        super()._command_enabled(command, word, rising)
