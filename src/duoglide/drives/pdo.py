"""The frames of the cycle: their identifiers and their bytes (CiA 301).

========= ============ =================================================================
frame     COB-ID       bytes, little-endian
========= ============ =================================================================
SYNC      0x080        none
EMCY      0x080 + node error code u16, error register u8, 5 manufacturer bytes
TPDO1     0x180 + node statusword u16 (0x6041), actual position i32 (0x6064)
RPDO1     0x200 + node controlword u16 (0x6040), target position i32 (0x607A)
TPDO2     0x280 + node digital inputs u32 (0x60FD), modes of operation display i8 (0x6061)
RPDO2     0x300 + node digital outputs u32 (0x60FE:1)
heartbeat 0x700 + node NMT state u8
========= ============ =================================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from struct import Struct

from duoglide.errors import DriveError

NMT = 0x000
SYNC = 0x080
EMCY = 0x080
TPDO1 = 0x180
RPDO1 = 0x200
TPDO2 = 0x280
RPDO2 = 0x300
SDO_REPLY = 0x580
SDO_REQUEST = 0x600
HEARTBEAT = 0x700
ERROR_FRAME = -1  # stands for the identifier of an error frame

SETPOINT = Struct("<Hi")  # RPDO1: controlword, target position [increments]
FEEDBACK = Struct("<Hi")  # TPDO1: statusword, actual position [increments]
OUTPUTS = Struct("<I")  # RPDO2
INPUTS = Struct("<Ib")  # TPDO2: digital inputs, mode of operation
EMERGENCY = Struct("<HB5s")

RPDO1_MAPPING = ((0x6040, 0, 16), (0x607A, 0, 32))
TPDO1_MAPPING = ((0x6041, 0, 16), (0x6064, 0, 32))
RPDO2_MAPPING = ((0x60FE, 1, 32),)
TPDO2_MAPPING = ((0x60FD, 0, 32), (0x6061, 0, 8))

INTERLOCK = 1 << 3  # of 0x60FD: safe torque off is active

SYNCHRONOUS = 1  # transmission type: act on, or send at, every SYNC
ON_EVENT = 255  # transmission type: act at once, or send when a value changes


class Nmt(IntEnum):
    """NMT commands; the frame 0x000 carries the command and the node (0: all)."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """NMT states as a heartbeat carries them."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


@dataclass(frozen=True, slots=True)
class Feedback:
    """What TPDO1 carries."""

    statusword: int
    actual: int  # [increments]


@dataclass(frozen=True, slots=True)
class Emergency:
    """What an EMCY frame carries."""

    code: int
    register: int
    detail: bytes


def unpack_feedback(data: bytes | bytearray) -> Feedback:
    """Read TPDO1.

    Raises:
        DriveError: The frame is too short to be one.
    """
    if len(data) < FEEDBACK.size:
        raise DriveError(f"TPDO1 has {len(data)} bytes, must have {FEEDBACK.size}")
    return Feedback(*FEEDBACK.unpack_from(data))


def unpack_emergency(data: bytes | bytearray) -> Emergency:
    """Read an EMCY frame; drives that send fewer than 8 bytes are read as if padded with 0."""
    code, register, detail = EMERGENCY.unpack_from(bytes(data).ljust(EMERGENCY.size, b"\0"))
    return Emergency(code, register, detail)


def pack_emergency(code: int, register: int, detail: bytes = b"") -> bytes:
    """Return the eight bytes of an EMCY frame."""
    return EMERGENCY.pack(code, register, detail)


def pack_nmt(command: Nmt, node: int) -> bytes:
    """Return the two bytes of an NMT command; node 0 addresses all."""
    return bytes((command, node))
