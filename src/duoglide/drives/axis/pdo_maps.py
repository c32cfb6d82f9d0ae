"""Which process data a drive sends and takes: the maps that the host wants, and how to set them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

from duoglide.drives import pdo
from duoglide.drives.axis.objects import DriveObjects
from duoglide.drives.axis.sdo_client import SdoRefusalError
from duoglide.errors import DriveError, DriveTimeout

INVALID = 1 << 31  # of a PDO's COB-ID
# Beside the contract's two, the PDOs that a maker may have on at delivery.
OTHER_RPDOS, OTHER_TPDOS = range(0x1402, 0x1408), range(0x1802, 0x1808)
_NOT_THERE = (0x06020000, 0x06090011)  # abort codes: no such object, no such sub-index
_ON_MAKERS_EVENT, _NEXT_SYNC = 254, 0  # transmission types


@dataclass(frozen=True, slots=True)
class PdoMap:
    """How one PDO shall be mapped.

    Attributes:
        parameters: 0x14xx or 0x18xx.
        mapping: 0x16xx or 0x1Axx.
        cob_id: Identifier without the node number.
        kind: Transmission type.
        entries: Index, sub-index and bits of each object in it.
    """

    parameters: int
    mapping: int
    cob_id: int
    kind: int
    entries: tuple[tuple[int, int, int], ...]


PDO_MAPS = (
    PdoMap(0x1400, 0x1600, pdo.RPDO1, pdo.SYNCHRONOUS, pdo.RPDO1_MAPPING),
    PdoMap(0x1401, 0x1601, pdo.RPDO2, pdo.ON_EVENT, pdo.RPDO2_MAPPING),
    PdoMap(0x1800, 0x1A00, pdo.TPDO1, pdo.SYNCHRONOUS, pdo.TPDO1_MAPPING),
    PdoMap(0x1801, 0x1A01, pdo.TPDO2, pdo.ON_EVENT, pdo.TPDO2_MAPPING),
)


def switch_off_pdo(drive: DriveObjects, parameters: int) -> None:
    """Switch off a PDO as its maker delivers it, if there is one; in PRE-OPERATIONAL.

    Left on, it loads the bus in every cycle, or acts on a frame that means something else here.

    Args:
        drive: Whose.
        parameters: 0x14xx or 0x18xx.

    Raises:
        DriveError: It stays on.
    """
    try:
        cob_id = int.from_bytes(drive.read_bytes(parameters, 1), "little")
    except SdoRefusalError as refusal:
        if refusal.abort in _NOT_THERE:
            return
        raise
    if cob_id & INVALID:
        return
    with suppress(SdoRefusalError):
        drive.write_bytes(parameters, 1, (cob_id | INVALID).to_bytes(4, "little"))
        cob_id = int.from_bytes(drive.read_bytes(parameters, 1), "little")
    sends = parameters >= 0x1800  # the host sends none of those that a drive might go on taking
    if sends and not cob_id & INVALID and not _is_emptied(drive, parameters + 0x200):
        raise drive.error(
            f"its PDO 0x{parameters:04X} stays on (0x{cob_id:X}); switch it off with the maker's"
            " tool, and store that"
        )


def _is_emptied(drive: DriveObjects, mapping: int) -> bool:
    """Take all objects out of a PDO; return whether the drive lets it."""
    try:
        drive.write_bytes(mapping, 0, b"\0")
    except SdoRefusalError:
        return False
    return drive.read_bytes(mapping, 0) == b"\0"


def map_pdo(drive: DriveObjects, wanted: PdoMap) -> None:
    """Map one PDO in the order of CiA 301, 7.5.2.36, and read it back; in PRE-OPERATIONAL.

    A drive that refuses is left as it is where it already sends and takes what is wanted. Where
    only its identifier is fixed, and the right one, it is mapped without being switched off.

    Raises:
        SdoRefusalError: The drive refuses.
        DriveError: The drive keeps another identifier than the one written.
    """
    try:
        _write_map(drive, wanted)
    except SdoRefusalError:
        if not _is_mapped(drive, wanted):
            raise


def _is_mapped(drive: DriveObjects, wanted: PdoMap) -> bool:
    """Whether a PDO is on and as it is wanted."""
    entries = [index << 16 | sub << 8 | bits for index, sub, bits in wanted.entries]
    return (
        drive.read(wanted.parameters, 1) & (INVALID | 0x7FF) == wanted.cob_id + drive.node_id
        and any(drive.holds(wanted.parameters, 2, kind) for kind in _kinds(wanted))
        and drive.holds(wanted.mapping, 0, len(entries))
        and all(drive.holds(wanted.mapping, i, entry) for i, entry in enumerate(entries, start=1))
    )


def _write_map(drive: DriveObjects, wanted: PdoMap) -> None:
    cob_id = wanted.cob_id + drive.node_id
    fixed = not _switch_off_to_map(drive, wanted.parameters, cob_id)
    _write_kind(drive, wanted)
    drive.write(wanted.mapping, 0, 0)
    for position, (index, sub, bits) in enumerate(wanted.entries, start=1):
        drive.write_checked(wanted.mapping, position, index << 16 | sub << 8 | bits)
    drive.write_checked(wanted.mapping, 0, len(wanted.entries))
    if fixed:
        return
    drive.write(wanted.parameters, 1, cob_id)
    kept = drive.read(wanted.parameters, 1)
    if kept & (INVALID | 0x7FF) != cob_id:  # some drives set the "no RTR" bit by themselves
        raise drive.error(
            f"0x{wanted.parameters:04X}:1 was written as 0x{cob_id:X} but reads 0x{kept:X}"
        )


def _switch_off_to_map(drive: DriveObjects, parameters: int, cob_id: int) -> bool:
    """Switch a PDO off; return False where it is on for good, with the right identifier."""
    try:
        drive.write(parameters, 1, cob_id | INVALID)
    except SdoRefusalError:
        if drive.read(parameters, 1) & (INVALID | 0x7FF) != cob_id:
            raise
        return False
    return True


def _kinds(wanted: PdoMap) -> tuple[int, ...]:
    """Return the transmission types that do the same (CiA 301, tables 67 and 71), best first."""
    if wanted.kind == pdo.ON_EVENT:
        return (pdo.ON_EVENT, _ON_MAKERS_EVENT)
    takes = wanted.parameters < 0x1800  # every type of SYNC lets the next SYNC act
    return (wanted.kind, _NEXT_SYNC) if takes else (wanted.kind,)


def _write_kind(drive: DriveObjects, wanted: PdoMap) -> None:
    """Write the transmission type, or another one that does the same."""
    best, *others = _kinds(wanted)
    try:
        drive.write_checked(wanted.parameters, 2, best)
    except SdoRefusalError:
        for kind in others:
            with suppress(SdoRefusalError):
                drive.write_checked(wanted.parameters, 2, kind)
                return
        raise


def try_map(drive: DriveObjects, wanted: PdoMap) -> DriveError | None:
    """Map one PDO and put back what was there; return why it cannot be so, None if it can.

    The drive must be in PRE-OPERATIONAL, and nobody may send what it takes.

    Raises:
        DriveTimeout: The drive does not answer.
    """
    cob_id, kind = (drive.read_bytes(wanted.parameters, sub) for sub in (1, 2))
    count = drive.read_bytes(wanted.mapping, 0)
    entries = [drive.read_bytes(wanted.mapping, sub + 1) for sub in range(count[0])]
    try:
        map_pdo(drive, wanted)
    except DriveTimeout:
        raise
    except DriveError as refusal:
        return refusal
    finally:
        off = (int.from_bytes(cob_id, "little") | INVALID).to_bytes(4, "little")
        rows = [(wanted.parameters, 1, off), (wanted.parameters, 2, kind)]
        rows += [(wanted.mapping, 0, b"\0")]
        rows += [(wanted.mapping, sub, entry) for sub, entry in enumerate(entries, start=1)]
        rows += [(wanted.mapping, 0, count), (wanted.parameters, 1, cob_id)]
        for index, sub, data in rows:
            with suppress(SdoRefusalError):  # what cannot be written is as it was
                drive.write_bytes(index, sub, data)
    return None
