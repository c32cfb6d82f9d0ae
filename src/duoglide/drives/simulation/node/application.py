"""What a CANopen node needs of a drive's application, whoever wrote it."""

from __future__ import annotations

from typing import Protocol


class AxisApplication(Protocol):
    """A drive's application. ``firmware.FirmwareAxis`` is one, the C reference axis another.

    Positions are increments, times microseconds; methods that refuse raise ``RefusalError``.
    """

    @property
    def statusword(self) -> int:
        """The statusword, 0x6041."""

    @property
    def actual(self) -> int:
        """The actual position, 0x6064."""

    @property
    def powered(self) -> bool:
        """Whether the servo holds the carriage."""

    @property
    def brake_released(self) -> bool:
        """Whether the holding brake is open."""

    @property
    def servo_demand(self) -> int:
        """What the encoder shall read [1/256 increment]."""

    @property
    def servo_velocity(self) -> int:
        """How fast that changes [1/256 increment/s]."""

    @property
    def error_register(self) -> int:
        """The error register, 0x1001."""

    @property
    def period(self) -> int:
        """Interpolation time, 0x60C2."""

    def read(self, index: int, sub: int) -> int:
        """Return an object of the application."""

    def write(self, index: int, sub: int, value: int) -> None:
        """Write an object of the application."""

    def sync(self) -> None:
        """Note that a SYNC has come."""

    def setpoint(self, controlword: int, target: int) -> None:
        """Take the setpoint that was sent before this SYNC."""

    def heartbeat(self) -> None:
        """Note that the host is alive."""

    def communication(self, operational: bool) -> None:
        """Note that the node has entered or left NMT OPERATIONAL."""

    def fault(self, code: int) -> None:
        """Take a fault of the hardware."""

    def set_sto(self, active: bool) -> None:
        """Set or clear safe torque off."""

    def set_inputs(self, word: int) -> None:
        """Set the digital inputs, 0x60FD."""

    def tick(self, dt: int, encoder: int) -> None:
        """Let time pass, at whose end the encoder reads ``encoder``."""

    def take_emergencies(self) -> list[int]:
        """Return the emergency codes since the last call; 0: errors were reset."""
