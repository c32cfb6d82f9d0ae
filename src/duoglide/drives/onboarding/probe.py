"""What a drive has of all that the host asks for: read, tried without power, and put back.

Objects are read. The settings that bring-up would write are written once and restored: only that
shows what a drive takes, since a dictionary seldom says which values are allowed. Nothing of it
acts without power, and a drive under power is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from duoglide.drives import pdo
from duoglide.drives.axis.configure import PROFILE_402, list_settings
from duoglide.drives.axis.objects import DriveObjects
from duoglide.drives.axis.sdo_client import SdoRefusalError
from duoglide.drives.axis.units import read_units
from duoglide.drives.cia402 import Mode, State, decode
from duoglide.drives.scale import RateUnits
from duoglide.errors import DriveError, DriveTimeout
from duoglide.machine.drive_contract import CONTRACT, ContractObject, Need, find_object
from duoglide.machine.drive_profiles import PROFILES
from duoglide.machine.drive_quirks import Interlock, Quirks

if TYPE_CHECKING:
    from duoglide.machine import DriveSettings

HOLD, STOP_AND_OFF = 6, 2  # values of 0x605A that a machine file may name
_POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
_INVALID = 1 << 31  # of a PDO's COB-ID
_SECOND_PDOS = {0x60FE: (0x1401, 0x1601), 0x60FD: (0x1801, 0x1A01)}  # what carries each object
_OTHER_PDOS = (*range(0x1402, 0x1408), *range(0x1802, 0x1808))
_HERE = (37, 35)  # homing methods, the newer edition's first


@dataclass(slots=True)
class Probed:
    """What was found of one drive.

    Attributes:
        number: Which carriage, 1 to 3.
        node_id: Its node.
        name: 0x1008; empty where it says none.
        profile: The make that it is, of those that ship; empty for an unknown one.
        quirks: Keys of ``drives.quirks`` to give, and their values.
        homing_method: By which it takes a known place for its reference; 0 where none was found.
        costs: What each gap costs, in sentences.
        unsafe: Those of the costs that are a loss of protection.
        notes: What else to know.
        refusals: Why it is no drive for this machine; empty if it is.
    """

    number: int
    node_id: int
    name: str = ""
    profile: str = ""
    quirks: dict[str, Any] = field(default_factory=dict)
    homing_method: int = 0
    costs: list[str] = field(default_factory=list)
    unsafe: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    refusals: list[str] = field(default_factory=list)

    def lose(self, item: ContractObject, why: str, sub: int | None = None) -> None:
        """Note what it costs that an object is not as the host needs it."""
        where = f"0x{item.index:04X}" + (f":{sub}" if sub else "")
        self.costs.append(f"{where} ({item.name}) {why}: {item.cost}")
        if item.unsafe:
            self.unsafe.append(f"{where} ({item.name})")


def probe(drive: DriveObjects, travel: tuple[float, float], speed: float) -> Probed:
    """Find out what a drive has; it keeps what it had.

    Args:
        drive: Without power.
        travel: Software limits that bring-up would write [mm].
        speed: Greatest speed that it would be asked for [mm/s].

    Raises:
        DriveError: It is under power.
        DriveTimeout: It does not answer.
    """
    found = Probed(drive.number, drive.node_id)
    if (word := _read(drive, 0x6041)) is not None and _is_powered(word):
        raise drive.error(
            "is under power: probing tries its settings, so take the power off first (end whoever"
            " moves it)"
        )
    _identify(drive, found)
    drive.quirks = _base_quirks(found.profile)
    missing = _missing(drive, found)
    refused = _try_settings(drive, found, missing, travel, speed)
    for index in sorted(missing | refused):
        found.quirks.setdefault("absent", []).append(index)
    _find_homing(drive, found)
    _look_at_inputs(drive, found)
    _look_at_other_pdos(drive, found)
    return found


def _is_powered(statusword: int) -> bool:
    try:
        return decode(statusword) in _POWERED
    except DriveError:
        return False  # no state of CiA 402: it is judged by its device type


def _read(drive: DriveObjects, index: int, sub: int = 0) -> int | None:
    """Read a number; None where the drive refuses."""
    try:
        return int.from_bytes(drive.read_bytes(index, sub), "little")
    except SdoRefusalError:
        return None


def _identify(drive: DriveObjects, found: Probed) -> None:
    """Read who it is, and whether it can be a drive of this machine at all."""
    device_type = _read(drive, 0x1000)
    if device_type is None or device_type & 0xFFFF != PROFILE_402:
        said = "nothing" if device_type is None else f"profile {device_type & 0xFFFF}"
        found.refusals.append(f"it is no CiA 402 drive: 0x1000 says {said}")
    try:
        found.name = drive.read_text(0x1008).strip(" \0")
    except SdoRefusalError:
        found.name = ""
    for key, sub in (("vendor_id", 1), ("product_code", 2)):
        if value := _read(drive, 0x1018, sub):
            found.quirks[key] = value
    vendor = found.quirks.get("vendor_id", 0)
    makes = [name for name, make in PROFILES.items() if make.quirks["vendor_id"] == vendor]
    found.profile = makes[0] if makes else ""
    modes = _read(drive, 0x6502)
    if modes is None or not modes & Mode.CYCLIC_SYNCHRONOUS_POSITION.supported_bit:
        said = "is not there" if modes is None else f"is 0x{modes:08X}, bit 7 is not set"
        found.quirks["trust_csp"] = False
        found.refusals.append(
            f"it does not say that it knows cyclic synchronous position: 0x6502 {said}. Where its"
            " manual says that it does, trust_csp = true"
        )


def _base_quirks(profile: str) -> Quirks:
    """Return what is known of a make, but with everything that is to be found out here."""
    if not profile:
        return Quirks()
    known: Mapping[str, Any] = PROFILES[profile].quirks
    kept = {key: value for key, value in known.items() if key not in ("absent", "setpoint_timer")}
    return Quirks(**kept)


def _missing(drive: DriveObjects, found: Probed) -> set[int]:
    """Return the optional objects that are not there; note what that costs."""
    missing: set[int] = set()
    for item in CONTRACT:
        absent = [sub for sub in item.subs if _read(drive, item.index, sub) is None]
        if not absent or item.index == 0x6502:
            continue
        if item.need is Need.REQUIRED:
            found.refusals.append(f"0x{item.index:04X}:{absent[0]}, {item.name}, is not there")
        elif item.index == 0x1400:
            found.quirks["setpoint_timer"] = False
            found.lose(item, "is not there", sub=5)
        elif item.index == 0x607C and drive.quirks.home_object[0] != 0x607C:
            found.quirks["home_object"] = drive.quirks.home_object
            missing.add(item.index)
        elif item.need is Need.OPTIONAL or item.index == 0x607C:
            found.lose(item, "is not there")
            missing.add(item.index)
    for index, parameters in _SECOND_PDOS.items():
        lacks = [p for p in parameters if _read(drive, p, 0) is None]
        known = find_object(index, 0)
        if lacks and index not in missing and known is not None:
            found.lose(known, f"has no PDO, 0x{lacks[0]:04X} is not there")
            missing.add(index)
    return missing


def _try_settings(
    drive: DriveObjects, found: Probed, missing: set[int], travel: tuple[float, float], speed: float
) -> set[int]:
    """Write what bring-up would, put back what was there; return the optional ones refused."""
    drive.quirks = replace(
        drive.quirks,
        absent=tuple(missing),
        setpoint_timer=found.quirks.get("setpoint_timer", True),
    )
    refused: set[int] = set()
    for index, sub, value in list_settings(drive, _ask_units(drive, found), travel, speed):
        if not drive.has(index) or index in refused:
            continue
        abort = _try(drive, index, sub, value)
        if abort is None:
            continue
        item = find_object(index, sub)
        if index == 0x605A and _try(drive, index, sub, STOP_AND_OFF) is None:
            found.quirks["quick_stop_option"] = STOP_AND_OFF
            found.notes.append(
                f"0x605A does not take {HOLD} (stop and hold): after a quick stop the drive powers"
                " off, and a vertical load needs a brake"
            )
        elif item is None or item.need is Need.REQUIRED:
            found.refusals.append(f"{_words(index, sub, value)}: {abort}")
        elif index == 0x1400:
            found.quirks["setpoint_timer"] = False
            found.lose(item, f"does not take {value}", sub)
        else:
            found.lose(item, f"does not take {value} ({_short(abort)})", sub)
            refused.add(index)
    return refused


def _ask_units(drive: DriveObjects, found: Probed) -> RateUnits:
    """Return the drive's units; increments, and a note of the key, where the machine file says."""
    try:
        return read_units(drive)
    except DriveTimeout:
        raise
    except DriveError as error:
        found.unsafe.append(f"until it is given, nothing moves: {error}")
        fineness = abs(drive.scale.increments_per_mm)
        return RateUnits(velocity=1.0 / fineness, acceleration=1.0 / fineness)


def _try(drive: DriveObjects, index: int, sub: int, value: int) -> SdoRefusalError | None:
    """Write a value and put back the former one; return the refusal, None if it was taken."""
    before = drive.read_bytes(index, sub)
    try:
        drive.write(index, sub, value)
    except SdoRefusalError as refusal:
        return None if drive.holds(index, sub, value) else refusal
    drive.write_bytes(index, sub, before)
    return None


def _words(index: int, sub: int, value: int) -> str:
    return f"0x{index:04X}:{sub} does not take {value}"


def _short(refusal: SdoRefusalError) -> str:
    """Return the reason alone, which the error's text has last."""
    return str(refusal).rpartition("refused, ")[2].partition(" (0x")[0]


def _find_homing(drive: DriveObjects, found: Probed) -> None:
    """Find the homing method by which a known place becomes the reference."""
    if found.profile:
        found.homing_method = PROFILES[found.profile].homing_method
        return
    if _read(drive, 0x6098) is None:
        return  # said already: it is required
    taken = [method for method in _HERE if _try(drive, 0x6098, 0, method) is None]
    if not taken:
        found.notes.append(
            "0x6098 takes neither 37 nor 35: drives.homing must name a method that it has, which"
            " searches a switch or an index pulse"
        )
        return
    found.homing_method = taken[0]
    found.notes.append(
        f"0x6098 takes {' and '.join(map(str, taken))}; whether homing by it succeeds shows under"
        " power: drives of the older CiA 402 have 35 where newer ones have 37"
    )


def _look_at_inputs(drive: DriveObjects, found: Probed) -> None:
    """Say what bit 3 of the inputs is now; only a person knows what it means."""
    if found.profile and drive.quirks.interlock is not Interlock.SET:
        found.quirks["interlock"] = str(drive.quirks.interlock)
    elif (inputs := _read(drive, 0x60FD)) is not None:
        now = "set" if inputs & pdo.INTERLOCK else "clear"
        found.notes.append(
            f"bit 3 of 0x60FD (interlock) is {now} now. interlock must say what it is while safe"
            ' torque off is active: "set", "clear", or "none" if the bit means something else'
        )


def _look_at_other_pdos(drive: DriveObjects, found: Probed) -> None:
    """Say which further PDOs the maker has switched on."""
    on = [
        f"0x{parameters:04X}"
        for parameters in _OTHER_PDOS
        if (cob_id := _read(drive, parameters, 1)) is not None and not cob_id & _INVALID
    ]
    if on:
        found.notes.append(
            f"PDOs that are on at delivery, and that bring-up switches off: {', '.join(on)}"
        )


def settings_for_node(settings: DriveSettings, node_id: int) -> DriveSettings:
    """Return settings whose first axis is a node, whatever the machine file's are."""
    others = [node for node in settings.node_ids if node != node_id]
    return replace(settings, node_ids=(node_id, others[0], others[1]))
