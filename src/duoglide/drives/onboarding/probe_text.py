"""What was found of drives, as the tables of a machine file: valid TOML, the costs in comments."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from duoglide.drives.bus.load import bus_load
from duoglide.machine.drive_profiles import PROFILES
from duoglide.machine.drive_quirks import Quirks
from duoglide.machine.meaning import unit_of

if TYPE_CHECKING:
    from duoglide.drives.onboarding.probe import Probed
    from duoglide.machine import DriveSettings

_WIDTH = 100
_HEX_KEYS = ("vendor_id", "product_code")
_FILL_IN = {"velocity_unit": "for rpm, what one revolution of the motor moves [mm] / 60"}
_KNOWN_PLACE = 37  # the homing method without being told


def tables(found: Sequence[Probed], settings: DriveSettings, source: str) -> str:
    """Return the tables ``[drives]`` and ``[[drives.quirks]]`` to paste into a machine file.

    Args:
        found: One drive, which then stands for all three, or three.
        settings: With which they were probed.
        source: Where they were found, in words.
    """
    lines = _comment(
        f"Probed: {source}. Nothing had power; every setting that was tried was put back."
        " Paste this into the machine file; increments_per_mm and direction are yours to fill in."
    )
    lines += ["", "[drives]"]
    if len(found) > 1:
        lines.append(f"node_ids = {[one.node_id for one in found]}")
    lines += [f"bit_rate = {settings.bit_rate}", f"cycle = {settings.cycle!r}"]
    lines += _comment(f"The cycle takes {100.0 * bus_load(settings):.0f} % of the bus.")
    if any(one.profile for one in found):
        names = ", ".join(f'"{one.profile}"' for one in found)
        lines.append(f"profile = [{names}]" if len(found) > 1 else f"profile = {names}")
    methods = [one.homing_method or _KNOWN_PLACE for one in found] * (3 if len(found) == 1 else 1)
    lines += ["", "[drives.homing]", f"method = {methods}"]
    for one in found:
        lines += ["", *_quirks(one, alone=len(found) == 1)]
    return "\n".join(lines) + "\n"


def _quirks(one: Probed, alone: bool) -> list[str]:
    name = f', "{_plain(one.name)}"' if one.name else ""
    who = f"Node {one.node_id}" if alone else f"Axis {one.number}, node {one.node_id}"
    make = f"; as the profile {one.profile}, {PROFILES[one.profile].words}" if one.profile else ""
    lines = ["[[drives.quirks]]", *_comment(f"{who}{name}{make}.")]
    for refusal in one.refusals:
        lines += _comment(f"NOT USABLE: {refusal}.")
    for key, value in one.quirks.items():
        lines.append(f"{key} = {_value(key, value)}")
    for key in one.to_fill_in:
        lines.append(f"# {key} =    # TO FILL IN [{unit_of(Quirks, key)}]: {_FILL_IN[key]}")
    lines += _listed("What is missing costs:", one.costs)
    lines += _listed("What stays unsafe:", one.unsafe or ["nothing of what was asked"])
    notes = [*one.notes, *(PROFILES[one.profile].notes if one.profile else ())]
    return lines + _listed("To know:", notes)


def _listed(heading: str, sentences: Sequence[str]) -> list[str]:
    if not sentences:
        return []
    lines = _comment(heading)
    for sentence in sentences:
        words = _plain(sentence).rstrip(".")
        lines += textwrap.wrap(f"{words}.", _WIDTH, initial_indent="# - ", subsequent_indent="#   ")
    return lines


def _comment(text: str) -> list[str]:
    return textwrap.wrap(_plain(text), _WIDTH, initial_indent="# ", subsequent_indent="# ")


def _plain(text: str) -> str:
    """Keep what a TOML comment may hold: a drive's name is data."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _value(key: str, value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if key in _HEX_KEYS:
        return f"0x{value:08X}"
    if key == "absent" and isinstance(value, list):
        return f"[{', '.join(f'0x{index:04X}' for index in value)}]"
    if key == "homed_object":
        return f"0x{value:04X}"
    if key == "home_object" and isinstance(value, tuple):
        return f"[0x{value[0]:04X}, {value[1]}]"
    return f'"{value}"' if isinstance(value, str) else str(value)
