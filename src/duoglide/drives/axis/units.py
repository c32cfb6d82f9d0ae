"""In which units a drive has its speeds and accelerations, asked of the drive itself.

0x60A8, 0x60A9 and 0x60AA hold a unit each, for positions, velocities and accelerations: a power of
ten in the highest byte, then the codes of a numerator and a denominator (CiA 303-2, CiA 402-2).
Many drives lack them; then the machine file says it, or increments and seconds are taken for
granted, which ``duoglide drives units`` checks by a slow move.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from duoglide.drives.axis.sdo_client import SdoRefusalError
from duoglide.drives.scale import RateUnits

if TYPE_CHECKING:
    from duoglide.drives.axis.objects import DriveObjects

_METRE, _RADIAN, _DEGREE, _REVOLUTION, _INCREMENT, _RPM = 0x01, 0x10, 0x41, 0xB4, 0xB5, 0xC0
_SECOND, _MINUTE, _HOUR, _SECOND_SQUARED = 0x03, 0x47, 0x48, 0x57
_TIMES = {_SECOND: 1.0, _MINUTE: 60.0, _HOUR: 3600.0}  # [s]
_TURNS = {_REVOLUTION: 1.0, _RADIAN: 1.0 / (2.0 * math.pi), _DEGREE: 1.0 / 360.0, _RPM: 1.0 / 60.0}
_AGREES = 0.01  # share by which drive and machine file may differ


@dataclass(frozen=True, slots=True)
class _Unit:
    """What one of the objects says.

    Attributes:
        turns: Revolutions of the motor that one unit means, per second or second squared; 0 where
            it means a length.
        length: [mm], the same; 0 where it means an angle.
    """

    turns: float = 0.0
    length: float = 0.0

    def in_mm(self, feed: float | None) -> float | None:
        """Return one unit in mm; None where the feed of a revolution is needed and not known."""
        if self.length:
            return self.length
        return None if feed is None else self.turns * feed


@dataclass(frozen=True, slots=True)
class _Rate:
    """One of the two rates, and what the machine file says of it."""

    index: int
    key: str
    unit: str
    given: float | None


def read_units(drive: DriveObjects) -> RateUnits:
    """Find out what one unit of a drive's velocities and accelerations means.

    Raises:
        DriveError: The drive says something else than the machine file, or a unit that needs the
            machine file and is not there; names the key.
    """
    fineness, quirks = abs(drive.scale.increments_per_mm), drive.quirks
    _require_increments(drive, fineness)
    speed = _Rate(0x60A9, "velocity_unit", "mm/s", quirks.velocity_unit)
    ramp = _Rate(0x60AA, "acceleration_unit", "mm/s^2", quirks.acceleration_unit)
    said_speed, said_ramp = (_ask(drive, rate, fineness) for rate in (speed, ramp))
    feed = _read_feed(drive, fineness)
    if feed is None and said_speed is not None and said_speed.turns and speed.given is not None:
        feed = speed.given / said_speed.turns
    return RateUnits(
        velocity=_settle(drive, speed, said_speed, feed) or 1.0 / fineness,
        acceleration=_settle(drive, ramp, said_ramp, feed) or 1.0 / fineness,
    )


def _ask(drive: DriveObjects, rate: _Rate, fineness: float) -> _Unit | None:
    """Return what the drive says of a rate; None where it says nothing, or nothing known here.

    Raises:
        DriveError: Nothing known here, and the machine file does not say it either.
    """
    value = _read(drive, rate.index, 0)
    unit = _decode(rate.index, value, fineness) if value else None
    if value and unit is None and rate.given is None:
        raise drive.error(
            f"0x{rate.index:04X} is 0x{value:08X}, a unit that is not known here: give"
            f" drives.quirks {rate.key}, what one unit of the drive means [{rate.unit}]"
        )
    return unit


def _settle(drive: DriveObjects, rate: _Rate, said: _Unit | None, feed: float | None) -> float:
    """Return one unit in mm, from the drive or the machine file; 0 where both are silent."""
    if said is None:
        return rate.given or 0.0
    says = said.in_mm(feed)
    if says is None and rate.given is None:
        raise drive.error(
            f"0x{rate.index:04X} counts in revolutions, and 0x608F does not say how far one goes:"
            f" give drives.quirks {rate.key}, what one unit of the drive means [{rate.unit}]"
        )
    if says is None or rate.given is None:
        return says or rate.given or 0.0
    if abs(says - rate.given) > _AGREES * rate.given:
        raise drive.error(
            f"0x{rate.index:04X} says {says:g} {rate.unit}, drives.quirks {rate.key} says"
            f" {rate.given:g}: one of them is wrong; leave the key out to take the drive's word"
        )
    return rate.given


def _require_increments(drive: DriveObjects, fineness: float) -> None:
    """Compare the unit of positions, where it is a length, with the machine file."""
    value = _read(drive, 0x60A8, 0)
    said = _decode(0x60A8, value, fineness) if value else None
    if said is None or not said.length:
        return
    if abs(said.length * fineness - 1.0) > _AGREES:
        raise drive.error(
            f"0x60A8 says that one unit of position is {said.length:g} mm: drives.increments_per_mm"
            f" would be {1.0 / said.length:g}, and is {fineness:g}"
        )


def _read_feed(drive: DriveObjects, fineness: float) -> float | None:
    """Return how far one revolution of the motor goes [mm]; None where 0x608F does not say."""
    increments, turns = _read(drive, 0x608F, 1), _read(drive, 0x608F, 2)
    if not increments or not turns or increments <= turns:  # 1 to 1: nobody has set it
        return None
    return increments / turns / fineness


def _decode(index: int, value: int, fineness: float) -> _Unit | None:
    """Return the unit that 0x60A8, 0x60A9 or 0x60AA names; None where it is not known here."""
    power, numerator, denominator = value >> 24, value >> 16 & 0xFF, value >> 8 & 0xFF
    factor = 10.0 ** (power - 256 if power > 127 else power)
    if index == 0x60A8:
        per = 0.0 if denominator else 1.0
    elif index == 0x60A9:
        per = 0.0 if numerator == _RPM else _TIMES.get(denominator, 0.0)
    else:  # a speed per second, or a length per second squared
        wanted = _SECOND if numerator == _RPM else _SECOND_SQUARED
        per = 1.0 if denominator == wanted else 0.0
    lengths = {_METRE: 1e3, _INCREMENT: 1.0 / fineness}
    if per and numerator in lengths:
        return _Unit(length=factor * lengths[numerator] / per)
    if per and numerator in _TURNS:
        return _Unit(turns=factor * _TURNS[numerator] / per)
    return None


def _read(drive: DriveObjects, index: int, sub: int) -> int | None:
    """Return an unsigned object that the EDS need not know; None where the drive has none."""
    try:
        return int.from_bytes(drive.read_bytes(index, sub), "little")
    except SdoRefusalError:
        return None
