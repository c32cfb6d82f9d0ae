"""Imitations of the makes that have a profile, from the facts of their dictionaries.

What a dictionary does not say (units, allowed values) is general knowledge; none of it was checked
on hardware.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from duoglide.drives.simulation.makers.imitation import Imitation
from duoglide.machine.drive_profiles import PROFILES
from duoglide.machine.drive_quirks import Interlock

_RPM, _RPM_PER_SECOND, _INCREMENT = 0x00B44700, 0x00C00300, 0x00B50000  # of 0x60A8 to 0x60AA
_VENDOR = (0x1018, 1)


def _vendor(name: str) -> int:
    return int(PROFILES[name].quirks["vendor_id"])


MAKES: Mapping[str, Imitation] = MappingProxyType(
    {
        "maxon-epos4": Imitation(
            absent=(0x1006, 0x1007, 0x1019, 0x605D, 0x607C, 0x608F),
            absent_subs=((0x1400, 5),),
            values={
                _VENDOR: _vendor("maxon-epos4"),
                (0x2010, 0): 1,  # the active fieldbus is CANopen
                (0x60A8, 0): _INCREMENT,
                (0x60A9, 0): _RPM,
                (0x60AA, 0): _RPM_PER_SECOND,
            },
            fixed=((0x60C2, 2),),
            allowed={(0x6066, 0): (0,)},
            velocity_unit=1000.0,  # 60 000 increments to a revolution
            acceleration_unit=1000.0,
            home_object=(0x30B0, 0),
            interlock=Interlock.NONE,
            running=(3, 4),
        ),
        "elmo-gold": Imitation(
            absent=(0x1007, 0x1019, 0x2010),
            absent_subs=((0x1400, 5),),
            values={_VENDOR: _vendor("elmo-gold")},
            here=35,
            interlock=Interlock.NONE,
            running=(3, 4),
        ),
        "trinamic-tmcm": Imitation(
            absent=(0x1006, 0x1007, 0x1019, 0x6007, 0x603F, 0x6066, 0x607F, 0x60FE),
            absent_subs=((0x1400, 5),),
            values={
                _VENDOR: _vendor("trinamic-tmcm"),
                (0x2010, 0): 1,
                (0x1601, 0): 2,  # its second RPDO commands, as it is delivered
                (0x1601, 1): 0x60400010,
                (0x1601, 2): 0x60600008,
            },
            fixed=((0x605B, 0), (0x605C, 0), (0x605E, 0)),
            here=35,
            interlock=Interlock.NONE,
        ),
    }
)
"""By the name of the profile in ``drives.profile``."""
