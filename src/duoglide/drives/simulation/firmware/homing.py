"""Homing that moves: the searches of CiA 402 methods 17, 18, 33 and 34.

The simulated drive has them; the C reference axis stops at method 37.
"""

from __future__ import annotations

from dataclasses import dataclass

from duoglide.drives.cia402 import Mode, State
from duoglide.drives.simulation.firmware.axis import FirmwareAxis
from duoglide.drives.simulation.firmware.demand import FRACTION, Phase

NEGATIVE_LIMIT = 1 << 0  # of 0x60FD
POSITIVE_LIMIT = 1 << 1
INDEX = 0  # not an input: the encoder's zero pulse

INDEX_DISTANCE = 20_000  # 0x608F:1, increments from one zero pulse to the next


@dataclass(frozen=True, slots=True)
class Leg:
    """One straight part of a search.

    Attributes:
        direction: +1 or -1.
        speed: Sub-index of 0x6099.
        switch: Bit of 0x60FD that ends it, or INDEX.
        wanted: Whether the switch must be on, or off, to end it.
    """

    direction: int
    speed: int
    switch: int
    wanted: bool = True


SEARCHES = {
    17: (Leg(-1, 1, NEGATIVE_LIMIT), Leg(1, 2, NEGATIVE_LIMIT, wanted=False)),
    18: (Leg(1, 1, POSITIVE_LIMIT), Leg(-1, 2, POSITIVE_LIMIT, wanted=False)),
    33: (Leg(-1, 2, INDEX),),
    34: (Leg(1, 2, INDEX),),
}


class HomingAxis(FirmwareAxis):
    """A ``FirmwareAxis`` that can also search for its reference."""

    def __init__(self) -> None:
        super().__init__()
        self._legs: tuple[Leg, ...] = ()
        self._found = False
        self._encoder = 0

    def _home(self) -> None:
        self._legs = SEARCHES.get(self.objects[0x6098, 0], ())
        if not self._legs:
            super()._home()
            return
        self.homed = self._found = self._homing_done = self._homing_error = False

    def tick(self, dt: int, encoder: int) -> None:
        """Let time pass, as ``FirmwareAxis`` does."""
        searching = self.state is State.OPERATION_ENABLED and self.mode == Mode.HOMING
        if not searching or self._after_stop is not None or self._halted:
            self._legs = ()
        if self._legs:
            self._search(encoder)
        self._encoder = encoder
        super().tick(dt, encoder)

    def _search(self, encoder: int) -> None:
        leg = self._legs[0]
        if self._found:
            if self.demand.phase is Phase.HOLD:
                self._finish()
            return
        if self._reached(leg, encoder):
            if len(self._legs) > 1:
                self._legs = self._legs[1:]
            else:
                self._take_reference(encoder)
            return
        speed = leg.direction * self.objects[0x6099, leg.speed]
        self.demand.jog(speed, self.objects[0x609A, 0])

    def _reached(self, leg: Leg, encoder: int) -> bool:
        if leg.switch == INDEX:
            return encoder // INDEX_DISTANCE != self._encoder // INDEX_DISTANCE
        return bool(self.inputs & leg.switch) is leg.wanted

    def _take_reference(self, encoder: int) -> None:
        """Here is 0x607C; brake."""
        before = self.origin
        self.origin = encoder - self.objects[0x607C, 0]
        self.actual += before - self.origin
        self.demand.position += (before - self.origin) * FRACTION
        self.demand.brake()
        self._found = True

    def _finish(self) -> None:
        self._legs = ()
        self._stand(self.demand.position // FRACTION)
        self.homed = self._homing_done = True
