"""What is known of makers' drives, as data: the quirks that a machine file need not spell out.

Each was made from the maker's dictionary and tried against an imitation of the drive. None has been
tried on hardware.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from duoglide.errors import ConfigError
from duoglide.machine import rules


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """One make of drive.

    Attributes:
        words: Which drives it is for.
        quirks: Keys of ``drives.quirks`` and their values.
        homing_method: By which a place that is known becomes the reference.
        notes: What to know beside the quirks, one sentence each.
    """

    words: str
    quirks: Mapping[str, Any]
    homing_method: int = 37
    notes: tuple[str, ...] = field(default=())


PROFILES: Mapping[str, Profile] = MappingProxyType(
    {
        "maxon-epos4": Profile(
            words="maxon EPOS4 (Module 50/15), CANopen",
            quirks={
                "vendor_id": 0xFB,
                "setpoint_timer": False,
                "interlock": "none",
                "home_object": [0x30B0, 0],
                "absent": [0x1006, 0x1007, 0x1019, 0x2010, 0x605D, 0x607C],
            },
            notes=(
                "Mapping and COB-IDs can only be changed in PRE-OPERATIONAL, which bring-up does.",
                "0x60C2:2 is fixed at -3: the cycle is a whole number of ms.",
                "Velocities are rpm and accelerations rpm/s: the machine file gives their units.",
            ),
        ),
        "elmo-gold": Profile(
            words="Elmo Gold line, CANopen",
            quirks={
                "vendor_id": 0x9A,
                "setpoint_timer": False,
                "interlock": "none",
                "absent": [0x1007, 0x1019, 0x2010],
            },
            homing_method=35,
            notes=("TPDO3 and TPDO4 are on at delivery; bring-up switches them off.",),
        ),
        "trinamic-tmcm": Profile(
            words="Trinamic TMCM-1270, CANopen",
            quirks={
                "vendor_id": 0x286,
                "setpoint_timer": False,
                "interlock": "none",
                "absent": [
                    *(0x1006, 0x1007, 0x1019, 0x2010, 0x6007, 0x603F),
                    *(0x605B, 0x605C, 0x605E, 0x6066, 0x607F, 0x60FE),
                ],
            },
            homing_method=35,
            notes=(
                "It has neither 0x6007 nor a time-out of setpoints: a host that is gone is noticed"
                " by the heartbeat alone, and what the drive does then is the maker's choice.",
                "0x605B, 0x605C and 0x605E cannot be written.",
            ),
        ),
    }
)
"""The profiles that ship with the package, by the name that ``drives.profile`` gives."""


def profile_quirks(name: str) -> Mapping[str, Any]:
    """Return the quirks of a profile; none for an empty name."""
    return PROFILES[name].quirks if name else {}


def three_profiles(value: object) -> tuple[str, str, str]:
    """Return the names of three profiles, from one name or three; ConfigError names the known."""
    names = [value] * 3 if isinstance(value, str) else value
    if not isinstance(names, list | tuple) or len(names) != 3:
        raise ConfigError(f"profile = {value!r:.80}: must be one name, or three, one per axis")
    for name in names:
        if name != "":
            rules.known_word("profile", name, PROFILES)
    first, second, third = names
    return first, second, third
