"""What can be made to go wrong with a simulated drive. ``axis`` is 1, 2 or 3."""

from __future__ import annotations

from dataclasses import dataclass

from duoglide.drives.simulation.node.node import DriveNode, Misbehaviour


@dataclass(frozen=True, slots=True)
class Injection:
    """Something that happens to one drive."""

    axis: int

    def apply(self, node: DriveNode) -> None:
        """Do it to the drive."""


@dataclass(frozen=True, slots=True)
class DeviceFault(Injection):
    """The power stage reports a fault, over-current by default."""

    code: int = 0x2310

    def apply(self, node: DriveNode) -> None:
        """Raise the fault."""
        node.axis.fault(self.code)
        node.tell_emergencies()


@dataclass(frozen=True, slots=True)
class Jam(Injection):
    """Something stands in the carriage's way: its following error will grow."""

    jammed: bool = True

    def apply(self, node: DriveNode) -> None:
        """Stop the carriage, or let it go."""
        node.plant.jammed = self.jammed


@dataclass(frozen=True, slots=True)
class Silence(Injection):
    """The drive sends no heartbeat, no TPDO, or neither."""

    heartbeat: bool = True
    tpdo: bool = True

    def apply(self, node: DriveNode) -> None:
        """Silence it."""
        node.wrong.heartbeat_silent = self.heartbeat
        node.wrong.tpdo_silent = self.tpdo


@dataclass(frozen=True, slots=True)
class Sto(Injection):
    """Safe torque off."""

    active: bool = True

    def apply(self, node: DriveNode) -> None:
        """Open or close the circuit."""
        node.axis.set_sto(self.active)


@dataclass(frozen=True, slots=True)
class SlowSdo(Injection):
    """Every SDO answer takes ``delay`` seconds."""

    delay: float = 1.0

    def apply(self, node: DriveNode) -> None:
        """Slow it down."""
        node.wrong.sdo_delay = self.delay


@dataclass(frozen=True, slots=True)
class Reboot(Injection):
    """The drive loses its supply; it boots ``delay`` seconds later and knows nothing."""

    delay: float = 0.05

    def apply(self, node: DriveNode) -> None:
        """Switch it off and on."""
        node.wrong.boot_delay = self.delay
        node.reboot()


@dataclass(frozen=True, slots=True)
class DropFrames(Injection):
    """The next ``count`` cyclic frames are lost: those the drive should receive, or sends."""

    count: int = 1
    received: bool = True

    def apply(self, node: DriveNode) -> None:
        """Drop them."""
        if self.received:
            node.wrong.drop_received = self.count
        else:
            node.wrong.drop_sent = self.count


@dataclass(frozen=True, slots=True)
class Inputs(Injection):
    """The digital inputs, 0x60FD, read ``word``; user input 0 is bit 16."""

    word: int = 0

    def apply(self, node: DriveNode) -> None:
        """Set them."""
        node.inputs = self.word & ~3  # the limit switches are the plant's


@dataclass(frozen=True, slots=True)
class Override(Injection):
    """An object reads as something else until the next reboot.

    ``Override(1, 0x1018, 2, 7)`` is a drive with another product code,
    ``Override(1, 0x6502, 0, 0x21)`` one without cyclic synchronous position.
    """

    index: int = 0x1018
    sub: int = 2
    value: int = 0

    def apply(self, node: DriveNode) -> None:
        """Change what the drive says."""
        node.objects.override(self.index, self.sub, self.value)


@dataclass(frozen=True, slots=True)
class Clear(Injection):
    """All is well again: not jammed, not silent, not slow, no STO."""

    def apply(self, node: DriveNode) -> None:
        """Undo what can be undone; a latched fault stays until it is reset."""
        node.wrong = Misbehaviour()
        node.plant.jammed = False
        node.axis.set_sto(False)
