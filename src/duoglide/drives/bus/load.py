"""How much of a CAN bus the cycle of a machine takes, in the worst case of bit stuffing.

The frames are those that bring-up maps, and no others: it switches off what else the drives came
with. Emergencies, inputs, outputs and SDO share what is left.
"""

from __future__ import annotations

import math
import warnings

from duoglide.drives.axis.pdo_maps import PDO_MAPS
from duoglide.drives.pdo import SYNCHRONOUS
from duoglide.errors import ConfigError, DuoglideWarning
from duoglide.machine import DriveSettings

MOST_LOAD = 0.95  # share of the bit rate above which frames are late or lost
HIGH_LOAD = 0.80  # ... above which there is little room for anything but the cycle
_HEARTBEAT_BYTES = 1
_LONGEST = 0.1  # cycle that a machine file may have [s]
_MILLISECOND = 1e-3  # the unit that every drive can be told a cycle in [s]


class BusLoadWarning(DuoglideWarning):
    """The cycle leaves little room on the bus."""


def frame_bits(size: int) -> int:
    """Return the bits of an 11-bit data frame of ``size`` bytes with the most stuff bits.

    From start of frame to the end of the space between two frames, ISO 11898-1.
    """
    return 47 + 8 * size + (34 + 8 * size - 1) // 4


def cycle_bits(settings: DriveSettings) -> int:
    """Return the bits of all that one cycle has: SYNC, setpoints and feedback of each drive."""
    sizes = [
        sum(bits for _, _, bits in wanted.entries) // 8
        for quirks in settings.quirks
        for wanted in PDO_MAPS
        if wanted.kind == SYNCHRONOUS
        and not any(index in quirks.absent for index, _, _ in wanted.entries)
    ]
    return sum(map(frame_bits, (0, *sizes)))


def bus_load(settings: DriveSettings) -> float:
    """Return the share of the bit rate that the cycle and the heartbeats take; 1.0 is all of it."""
    return cycle_bits(settings) / settings.cycle / settings.bit_rate + _beat_load(settings)


def _beat_load(settings: DriveSettings) -> float:
    beats = (len(settings.node_ids) + 1) * frame_bits(_HEARTBEAT_BYTES) / settings.heartbeat_period
    return beats / settings.bit_rate


def shortest_cycle(settings: DriveSettings) -> float:
    """Return the shortest cycle in whole milliseconds that keeps the load below ``HIGH_LOAD`` [s].

    Heartbeats are left as they are; infinite where they alone take as much.
    """
    rest = HIGH_LOAD - _beat_load(settings)
    if rest <= 0.0:
        return math.inf
    least = cycle_bits(settings) / (rest * settings.bit_rate)
    return math.ceil(least / _MILLISECOND - 1e-9) * _MILLISECOND


def require_bus_load(settings: DriveSettings) -> None:
    """Refuse a cycle that the bus cannot carry; warn, as BusLoadWarning, of one that fills it.

    Raises:
        ConfigError: Says the load, and the cycle that would do.
    """
    load = bus_load(settings)
    if load <= HIGH_LOAD:
        return
    words = (
        f"drives.cycle = {settings.cycle:g} s at bit_rate = {settings.bit_rate} bit/s takes"
        f" {100.0 * load:.0f} % of the bus"
    )
    cycle = shortest_cycle(settings)
    answer = f"cycle = {cycle:g}" if cycle < _LONGEST else "a longer heartbeat_period"
    answer += " would do, or a faster bus"
    if load > MOST_LOAD:
        raise ConfigError(
            f"{words}, more than the {100.0 * MOST_LOAD:.0f} % it can carry; {answer}"
        )
    warnings.warn(f"{words}, which leaves little for SDO and faults; {answer}", BusLoadWarning, 2)
