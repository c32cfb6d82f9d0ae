"""What the firmware of a linear axis keeps, and the codes it answers with."""

from __future__ import annotations

from collections.abc import Mapping

from duoglide.drives.cia402 import Mode

OUT_OF_RANGE = 0x06090030  # SDO abort codes, CiA 301 table 22
WRONG_STATE = 0x08000022
NO_OBJECT = 0x06020000

ALLOWED = {
    (0x605A, 0): (0, 2, 6),
    (0x605E, 0): (0, 2),
    (0x6060, 0): (0, Mode.HOMING, Mode.CYCLIC_SYNCHRONOUS_POSITION),
}
# What the axis keeps, and what it holds after power-up: the defaults of linear_axis.eds.
DEFAULTS: dict[tuple[int, int], int] = {
    (0x1016, 1): 0,
    (0x1400, 5): 0,
    (0x6007, 0): 1,
    (0x6040, 0): 0,
    (0x605A, 0): 2,
    (0x605B, 0): 0,
    (0x605C, 0): 1,
    (0x605D, 0): 2,
    (0x605E, 0): 2,
    (0x6060, 0): 0,
    (0x6065, 0): 5000,
    (0x6066, 0): 10,
    (0x607A, 0): 0,
    (0x607C, 0): 0,
    (0x607D, 1): -(1 << 31),
    (0x607D, 2): (1 << 31) - 1,
    (0x607F, 0): (1 << 31) - 1,
    (0x6085, 0): 60_000_000,
    (0x6098, 0): 37,
    (0x6099, 1): 20_000,
    (0x6099, 2): 5_000,
    (0x609A, 0): 500_000,
    (0x60C2, 1): 2,
    (0x60C2, 2): -3,
    (0x60FE, 1): 0,
    (0x60FE, 2): 0xFFFF0001,
}


class RefusalError(Exception):
    """The axis refuses a write; carries the SDO abort code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


def error_register(code: int) -> int:
    """Return the error register, 0x1001, that belongs to an error code (CiA 301 table 48)."""
    if not code:
        return 0
    register = {0x2: 0x02, 0x3: 0x04, 0x4: 0x08}.get(code >> 12, 0)
    if code >> 8 in (0x81, 0x82, 0x87):
        register |= 0x10
    if code >> 8 == 0x86:
        register |= 0x20
    return register | 1


def interpolation_period(objects: Mapping[tuple[int, int], int]) -> int:
    """Return the interpolation time that 0x60C2 says: a value and a power of ten [us]."""
    return int(objects[0x60C2, 1] * 10 ** (objects[0x60C2, 2] + 6))
