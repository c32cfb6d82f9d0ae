"""What a drive has of all that the host asks for: read, tried without power, and put back.

Objects are read. The settings that bring-up would write are written once and restored: only that
shows what a drive takes, since a dictionary seldom says which values are allowed. Nothing of it
acts without power, and a drive under power is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from duoglide.drives import pdo
from duoglide.drives.axis.configure import PROFILE_402, list_settings
from duoglide.drives.axis.objects import DriveObjects
from duoglide.drives.axis.pdo_maps import INVALID, PDO_MAPS, try_map
from duoglide.drives.axis.sdo_client import ObjectError, SdoRefusalError
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
FAULT_WHEN_LOST = 1  # of 0x6007
_POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
_SECOND_PDOS = {0x60FE: (0x1401, 0x1601), 0x60FD: (0x1801, 0x1A01)}  # what carries each object
_OTHER_PDOS = (*range(0x1402, 0x1408), *range(0x1802, 0x1808))
_TOLD = (  # keys that no drive answers; what the machine file says of them is printed again
    *("velocity_unit", "acceleration_unit", "interlock", "home_object"),
    *("home_offset_sign", "homed_object"),
)
_MOST_METHODS = 127  # of 0x60E3
HOME_OFFSET = 0x607C
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
        to_fill_in: Keys of ``drives.quirks`` that only a person knows.
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
    to_fill_in: list[str] = field(default_factory=list)

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
    drive.quirks = _base_quirks(drive, found.profile)
    for key in ("velocity_unit", "acceleration_unit", "home_offset_sign", "homed_object"):
        if (told := getattr(drive.quirks, key)) != getattr(Quirks(), key):
            found.quirks[key] = told
    missing = _missing(drive, found)
    refused = _try_settings(drive, found, missing, travel, speed)
    refused |= _try_maps(drive, found, missing | refused)
    for index in sorted(missing | refused):
        found.quirks.setdefault("absent", []).append(index)
    _find_homing(drive, found)
    _look_at_home(drive, found)
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
        _look_for_csp(drive, found, said)


def _look_for_csp(drive: DriveObjects, found: Probed, said: str) -> None:
    """Find out whether a drive takes cyclic synchronous position that does not say so."""
    csp = Mode.CYCLIC_SYNCHRONOUS_POSITION
    takes = _read(drive, 0x6060) is not None and _try(drive, 0x6060, 0, csp) is None
    found.quirks["trust_csp"] = takes
    if takes:
        found.unsafe.append(
            f"0x6502 {said}, and yet 0x6060 takes cyclic synchronous position: trust_csp = true is"
            " right only where the manual says that the drive knows it"
        )
        return
    found.refusals.append(
        f"it does not say that it knows cyclic synchronous position: 0x6502 {said}, and 0x6060 does"
        f" not take {csp.value}. Where its manual says that it does, trust_csp = true"
    )


def _base_quirks(drive: DriveObjects, profile: str) -> Quirks:
    """Return what is known, of a make and from the machine file, that is not to be found out."""
    known: Mapping[str, Any] = PROFILES[profile].quirks if profile else {}
    kept = {key: value for key, value in known.items() if key in ("interlock", "home_object")}
    told = {key: getattr(drive.quirks, key) for key in _TOLD}
    return Quirks(**(kept | {key: v for key, v in told.items() if v != getattr(Quirks(), key)}))


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
        elif item.index == HOME_OFFSET and drive.quirks.home_object[0] != HOME_OFFSET:
            missing.add(item.index)
        elif item.need is Need.OPTIONAL or item.index == HOME_OFFSET:
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
            found.refusals.append(f"0x{index:04X}:{sub} does not take {value} ({abort})")
        elif index == 0x1400:
            found.quirks["setpoint_timer"] = False
            found.lose(item, f"does not take {value} ({abort})", sub)
        else:
            found.lose(item, f"does not take {value} ({abort})", sub)
            refused.add(index)
            if index == 0x6007 and _try(drive, index, sub, FAULT_WHEN_LOST) is None:
                found.quirks["writes"] = [[index, sub, FAULT_WHEN_LOST, 2]]
                found.notes.append(
                    f"0x6007 takes {FAULT_WHEN_LOST}, which writes sets: the drive falls into fault"
                    " where the host is lost, and brakes as 0x605E says"
                )
    return refused


def _try_maps(drive: DriveObjects, found: Probed, absent: set[int]) -> set[int]:
    """Map the PDOs as bring-up would, put back what was there; return what cannot be in one."""
    drive.command(pdo.Nmt.ENTER_PRE_OPERATIONAL)  # maps are refused in any other state
    refused: set[int] = set()
    for wanted in PDO_MAPS:
        carried = {index for index, _, _ in wanted.entries}
        if carried & absent or any(
            _read(drive, index, 0) is None for index in (wanted.parameters, wanted.mapping)
        ):
            continue
        if (why := try_map(drive, wanted)) is None:
            continue
        second = next((i for i in _SECOND_PDOS if i in carried), 0)
        item = find_object(second, 0)
        if item is None:
            found.refusals.append(f"PDO 0x{wanted.parameters:04X} cannot be mapped: {why}")
            continue
        found.lose(item, f"cannot be in PDO 0x{wanted.parameters:04X}")
        refused.add(second)
    return refused


def _ask_units(drive: DriveObjects, found: Probed) -> RateUnits | None:
    """Return the drive's units; None, and what to fill in, where the machine file must say them."""
    try:
        return read_units(drive)
    except DriveTimeout:
        raise
    except DriveError as error:
        words = str(error).removeprefix(f"axis {drive.number} (node {drive.node_id}): ")
        found.unsafe.append(
            f"until it is filled in, nothing moves: {words}; with it in a machine file, probe again"
            " with --machine: 0x6085 and 0x607F were not tried"
        )
        if drive.quirks.velocity_unit is None:
            found.to_fill_in.append("velocity_unit")
        return None


def _try(drive: DriveObjects, index: int, sub: int, value: int) -> str | None:
    """Write a value and put back the former one; return why it was not kept, None if it was."""
    before = drive.read_bytes(index, sub)
    try:
        drive.write_checked(index, sub, value)
    except SdoRefusalError as refusal:
        return str(refusal).rpartition("refused, ")[2].partition(" (0x")[0]
    except ObjectError as mismatch:
        return str(mismatch).rpartition(", ")[2].partition(": ")[2]
    finally:
        with suppress(SdoRefusalError):  # what cannot be written is as it was
            drive.write_bytes(index, sub, before)
    return None


def _find_homing(drive: DriveObjects, found: Probed) -> None:
    """Find the homing method by which a known place becomes the reference."""
    if _read(drive, 0x6098) is None:
        return  # said already: it is required
    listed = _listed_methods(drive)
    taken = [
        method
        for method in _HERE
        if (not listed or method in listed) and _try(drive, 0x6098, 0, method) is None
    ]
    known = PROFILES[found.profile].homing_method if found.profile else 0
    if known in taken:
        found.homing_method = known
        return
    if not taken:
        found.notes.append(
            f"it has neither of the methods {_HERE[0]} and {_HERE[1]}: drives.homing must name one"
            " that it has, which searches a switch or an index pulse"
            + (f"; 0x60E3 lists {', '.join(map(str, sorted(listed)))}" if listed else "")
        )
        return
    found.homing_method = taken[0]
    if not listed:
        found.notes.append(
            f"0x6098 takes {' and '.join(map(str, taken))}; whether homing by it succeeds shows"
            " under power: drives of the older CiA 402 have 35 where newer ones have 37"
        )


def _listed_methods(drive: DriveObjects) -> set[int]:
    """Return the homing methods of 0x60E3; empty where the drive does not list them."""
    count = _read(drive, 0x60E3) or 0
    read = (_read(drive, 0x60E3, sub) for sub in range(1, min(count, _MOST_METHODS) + 1))
    as_signed = (value - 256 if value and 127 < value < 256 else value for value in read)
    return {value for value in as_signed if value}


def _look_at_home(drive: DriveObjects, found: Probed) -> None:
    """See whether the drive keeps a position at the place of reference."""
    index, sub = drive.quirks.home_object
    if index != HOME_OFFSET:
        found.quirks["home_object"] = drive.quirks.home_object
    if index in found.quirks.get("absent", ()):
        return
    value = (1000).to_bytes(4, "little")
    try:
        before = drive.read_bytes(index, sub)
        drive.write_bytes(index, sub, value)
        kept = drive.read_bytes(index, sub)
        drive.write_bytes(index, sub, before)
    except SdoRefusalError as refusal:
        found.refusals.append(
            f"0x{index:04X}:{sub} does not take a position ({refusal}); home_object must name what"
            " does"
        )
        return
    if kept != value:
        found.refusals.append(f"0x{index:04X}:{sub} does not keep a position that is written")


def _look_at_inputs(drive: DriveObjects, found: Probed) -> None:
    """Say what bit 3 of the inputs is now; only a person knows what it means."""
    if drive.quirks.interlock is not Interlock.SET:
        found.quirks["interlock"] = str(drive.quirks.interlock)
        return
    inputs = _read(drive, 0x60FD)
    if inputs is None:
        return
    is_set = bool(inputs & pdo.INTERLOCK)
    found.quirks["interlock"] = str(Interlock.NONE if is_set else Interlock.SET)
    said = f"bit 3 of 0x60FD (interlock) is {'set' if is_set else 'clear'} now"
    if is_set:
        found.unsafe.append(
            f"{said}. If safe torque off is not active now, interlock must be"
            ' "clear"; as "none" it is not seen before power is asked for'
        )
    else:
        found.notes.append(
            f"{said}. interlock must say what it is while safe torque off is active:"
            ' "set", "clear", or "none" if the bit means something else'
        )


def _look_at_other_pdos(drive: DriveObjects, found: Probed) -> None:
    """Say which further PDOs the maker has switched on."""
    on = [
        f"0x{parameters:04X}"
        for parameters in _OTHER_PDOS
        if (cob_id := _read(drive, parameters, 1)) is not None and not cob_id & INVALID
    ]
    if on:
        found.notes.append(
            f"PDOs that are on at delivery, and that bring-up switches off: {', '.join(on)}"
        )


def settings_for_node(settings: DriveSettings, node_id: int) -> DriveSettings:
    """Return settings whose first axis is a node, whatever the machine file's are."""
    others = [node for node in settings.node_ids if node != node_id]
    return replace(settings, node_ids=(node_id, others[0], others[1]))
