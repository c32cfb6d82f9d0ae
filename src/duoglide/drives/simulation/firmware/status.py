"""What a drive's application holds, and what it says of itself."""

from __future__ import annotations

from collections.abc import Callable

from duoglide.drives.cia402 import Mode, State, Status
from duoglide.drives.pdo import INTERLOCK
from duoglide.drives.simulation.firmware.demand import FRACTION, Demand, Phase
from duoglide.drives.simulation.firmware.objects import (
    DEFAULTS,
    NO_OBJECT,
    RefusalError,
    error_register,
    interpolation_period,
)

# As plain numbers: combining flags of an enum takes longer than all the rest of a tick.
_REMOTE, _VOLTAGE = int(Status.REMOTE), int(Status.VOLTAGE_ENABLED)
_LIMITED, _REACHED = int(Status.INTERNAL_LIMIT_ACTIVE), int(Status.TARGET_REACHED)
_BIT_12, _BIT_13 = int(Status.FOLLOWS_COMMAND), int(Status.FOLLOWING_ERROR)

_LARGEST = (1 << 31) - 1
_POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)


class AxisStatus:
    """The data of one axis and all that can be read from it."""

    def __init__(self) -> None:
        self.objects = dict(DEFAULTS)
        self.period = interpolation_period(self.objects)  # 0x60C2 [us]
        self.state = State.NOT_READY_TO_SWITCH_ON
        self.demand = Demand()
        self.actual = 0  # 0x6064 [increments]
        self.velocity = 0  # 0x606C [increments/s]
        self.origin = 0  # encoder reading at position 0 [increments]
        self.homed = False
        self.error_code = 0  # 0x603F
        self.inputs = 0  # 0x60FD without the interlock
        self.sto = False
        self._emergencies: list[int] = []
        self._after_stop: State | None = None
        self._halted = False
        self._limited = False
        self._following_error = False
        self._homing_done = self._homing_error = False
        self._operational = False

    @property
    def powered(self) -> bool:
        """Whether the servo holds the carriage."""
        return self.state in _POWERED

    @property
    def brake_released(self) -> bool:
        """Whether the holding brake is open: under power, unless 0x60FE:1 bit 0 sets it."""
        held = self.objects[0x60FE, 1] & self.objects[0x60FE, 2] & 1
        return self.powered and not held

    @property
    def outputs(self) -> int:
        """The digital outputs as they are, 0x60FE:1 under its mask."""
        return self.objects[0x60FE, 1] & self.objects[0x60FE, 2]

    @property
    def servo_demand(self) -> int:
        """What the servo shall reach, as an encoder reading in 1/256 increment."""
        return self.demand.position + self.origin * FRACTION

    @property
    def servo_velocity(self) -> int:
        """How fast the demand moves [1/256 increment/s]."""
        return self.demand.velocity

    @property
    def mode(self) -> int:
        """Mode of operation, 0x6061."""
        return self.objects[0x6060, 0]

    @property
    def statusword(self) -> int:
        """The statusword, 0x6041."""
        word = self.state.pattern | _REMOTE
        if not self.sto:
            word |= _VOLTAGE
        if self._limited:
            word |= _LIMITED
        if self.mode == Mode.HOMING:
            word |= _REACHED if self.demand.phase is Phase.HOLD else 0
            word |= _BIT_12 if self._homing_done else 0
            word |= _BIT_13 if self._homing_error else 0
        else:
            word |= _BIT_12 if self._follows() else 0
            word |= _BIT_13 if self._following_error else 0
        return word

    def _follows(self) -> bool:
        ready = self.state is State.OPERATION_ENABLED and self._after_stop is None
        return ready and not self._halted and self.mode == Mode.CYCLIC_SYNCHRONOUS_POSITION

    @property
    def error_register(self) -> int:
        """The error register, 0x1001 (CiA 301)."""
        return error_register(self.error_code)

    def read(self, index: int, sub: int) -> int:
        """Return the value of an object; RefusalError if the axis has no such object."""
        value = self.objects.get((index, sub))
        if value is not None:
            return value
        if sub or index not in _LIVE:
            raise RefusalError(NO_OBJECT)
        return min(max(_LIVE[index](self), -_LARGEST - 1), _LARGEST)


_LIVE: dict[int, Callable[[AxisStatus], int]] = {
    0x2010: lambda axis: int(axis.homed),
    0x603F: lambda axis: axis.error_code,
    0x6041: lambda axis: axis.statusword,
    0x6061: lambda axis: axis.mode,
    0x6064: lambda axis: axis.actual,
    0x606C: lambda axis: axis.velocity,
    0x60F4: lambda axis: axis.demand.position // FRACTION - axis.actual if axis.powered else 0,
    0x60FD: lambda axis: axis.inputs | (INTERLOCK if axis.sto else 0),
}
