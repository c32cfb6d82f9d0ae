"""What the host asks of a drive, object by object, and what it costs where one is missing.

One table. The machine file's ``absent`` is held against it, a refusal of a drive takes from it the
key that answers, and ``duoglide drives probe`` the comments; docs/howto/foreign.md shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Need(Enum):
    """How much the host needs an object."""

    REQUIRED = "required"
    OPTIONAL = "optional"  # the machine file may call it absent; ``cost`` says what is lost
    REPLACEABLE = "replaceable"  # a key of the machine file says what stands in its place


@dataclass(frozen=True, slots=True)
class ContractObject:
    """One object of a drive that the host uses.

    Attributes:
        index: Of the object.
        subs: The sub-indices that the host uses.
        name: As CiA 301 and CiA 402 call it.
        need: How much the host needs it.
        cost: What is lost without it, in words; empty where it is required.
        unsafe: Whether the loss is one of protection.
        answer: The key of the machine file that answers a refusal, and how; empty for ``absent``
            of an optional object, and where nothing answers.
    """

    index: int
    subs: tuple[int, ...]
    name: str
    need: Need = Need.REQUIRED
    cost: str = ""
    unsafe: bool = False
    answer: str = ""


def _optional(
    index: int, name: str, cost: str, *, subs: tuple[int, ...] = (0,), unsafe: bool = False
) -> ContractObject:
    return ContractObject(index, subs, name, Need.OPTIONAL, cost, unsafe)


_OWN = "drives.quirks absent = [0x{:04X}] leaves the drive its own"
_MAPPING = "the drive's own tool must store the mapping that docs/can.md shows"

CONTRACT = (
    ContractObject(0x1000, (0,), "device type"),
    ContractObject(0x1018, (1,), "vendor id"),
    ContractObject(
        0x1018,
        (2, 3, 4),
        "product code, revision, serial number",
        Need.REPLACEABLE,
        "one product of the maker cannot be told from another",
        answer="drives.quirks product_code = 0 accepts any",
    ),
    ContractObject(0x1017, (0,), "producer heartbeat time"),
    ContractObject(0x1400, (1, 2), "RPDO1 communication", answer=_MAPPING),
    ContractObject(
        0x1400,
        (5,),
        "RPDO1 event timer",
        Need.REPLACEABLE,
        "the drive does not notice by itself that setpoints have ended; only the host's"
        " heartbeat, 0x1016, tells it",
        unsafe=True,
        answer="drives.quirks setpoint_timer = false",
    ),
    ContractObject(0x1600, (0,), "RPDO1 mapping", answer=_MAPPING),
    ContractObject(0x1800, (1, 2), "TPDO1 communication", answer=_MAPPING),
    ContractObject(0x1A00, (0,), "TPDO1 mapping", answer=_MAPPING),
    ContractObject(0x6040, (0,), "controlword"),
    ContractObject(0x6041, (0,), "statusword"),
    ContractObject(0x6060, (0,), "modes of operation"),
    ContractObject(0x6061, (0,), "modes of operation display"),
    ContractObject(0x6064, (0,), "position actual value"),
    ContractObject(0x607A, (0,), "target position"),
    ContractObject(
        0x6098,
        (0,),
        "homing method",
        answer="drives.homing method: drives of the older CiA 402 end at 35, which is 37 of today",
    ),
    ContractObject(
        0x6502,
        (0,),
        "supported drive modes",
        Need.REPLACEABLE,
        "that the drive knows cyclic synchronous position is found out only when it is asked to"
        " go into that mode, under power",
        answer="drives.quirks trust_csp = true, where the maker's manual says that it does",
    ),
    _optional(0x1006, "communication cycle period", "nothing: 0x60C2 tells the drive its period"),
    _optional(0x1007, "synchronous window length", "nothing: the host does not use it"),
    _optional(
        0x1016,
        "consumer heartbeat time",
        "the drive does not notice that the host is gone; only the time-out of setpoints,"
        " 0x1400:5, stops it",
        subs=(1,),
        unsafe=True,
    ),
    _optional(0x1019, "synchronous counter", "nothing: SYNC has no counter"),
    _optional(
        0x1029,
        "error behaviour",
        "what the drive's NMT state becomes once the host is lost is the maker's choice",
        subs=(1,),
    ),
    _optional(
        0x2010, "Duoglide's own homed flag", "nothing: the host keeps the reference by itself"
    ),
    _optional(
        0x6007,
        "abort connection option code",
        "what the drive does once it has lost the host is the maker's choice, perhaps nothing",
        unsafe=True,
    ),
    _optional(
        0x603F,
        "error code",
        "after a fault that was there before the host, its cause is not known; later ones are"
        " known from their emergency message",
    ),
    ContractObject(
        0x605A,
        (0,),
        "quick stop option code",
        Need.OPTIONAL,
        "how the drive brakes by itself, and whether it holds afterwards, is the maker's choice",
        unsafe=True,
        answer="drives.quirks quick_stop_option = 2 where the drive knows no 6, or"
        " absent = [0x605A]",
    ),
    _optional(
        0x605B,
        "shutdown option code",
        "power may go off at once where the host asks for shutdown",
    ),
    _optional(
        0x605C,
        "disable operation option code",
        "power may go off at once where the host disables operation",
    ),
    _optional(0x605D, "halt option code", "nothing: the host does not halt by that bit"),
    _optional(
        0x605E,
        "fault reaction option code",
        "in a fault the drive may let the carriage coast instead of braking it",
        unsafe=True,
    ),
    _optional(
        0x6065,
        "following error window",
        "the host alone watches the following error, a cycle later than the drive would",
        unsafe=True,
    ),
    _optional(
        0x6066,
        "following error time out",
        "how long the window may be left before the drive stops is the maker's choice",
    ),
    ContractObject(
        0x607C,
        (0,),
        "home offset",
        Need.REPLACEABLE,
        "homing can only set the position to 0: the place of reference must be 0 mm",
        answer="drives.quirks home_object = [index, subindex] of what the drive has instead, or"
        " absent = [0x607C]",
    ),
    _optional(
        0x607D,
        "software position limit",
        "the drive does not hold back at the ends of its rail; the plan and the host alone do",
        subs=(1, 2),
        unsafe=True,
    ),
    _optional(
        0x607F,
        "maximum profile velocity",
        "the drive does not bound the speed of a setpoint that is far off",
        unsafe=True,
    ),
    _optional(
        0x6085,
        "quick stop deceleration",
        "how hard the drive brakes is set by its own tool: quick_stop_deceleration must say the"
        " same, brake-safe plans rely on it",
        unsafe=True,
    ),
    _optional(0x6099, "homing speeds", "searches run at the speeds in the drive", subs=(1, 2)),
    _optional(0x609A, "homing acceleration", "searches run at the acceleration in the drive"),
    ContractObject(
        0x60C2,
        (1, 2),
        "interpolation time period",
        Need.OPTIONAL,
        "the drive interpolates over a period of its own, which must be the cycle",
        answer="a drives.cycle that the drive can be told, in whole milliseconds, or"
        " drives.quirks absent = [0x60C2]",
    ),
    _optional(
        0x60FD,
        "digital inputs",
        "safe torque off is not seen before power is asked for, and no input can be waited for",
        unsafe=True,
    ),
    _optional(
        0x60FE,
        "digital outputs",
        "no outputs in programs, and the host cannot close the holding brake",
        subs=(1,),
    ),
)

OPTIONAL_OBJECTS = frozenset(
    item.index for item in CONTRACT if item.need is Need.OPTIONAL or item.index == 0x607C
)
"""Indices that a machine file may call absent."""


def find_object(index: int, sub: int) -> ContractObject | None:
    """Return what the contract says of an object; None where it does not name it."""
    same = [item for item in CONTRACT if item.index == index]
    return next((item for item in same if sub in item.subs), same[0] if same else None)


def answer_to(index: int, sub: int) -> str:
    """Return which key of the machine file answers a drive that refuses an object.

    Empty where none does: then it is no drive for this machine, or a mistake of a ``writes`` entry.
    """
    item = find_object(index, sub)
    if item is None:
        return ""
    if item.answer or item.need is not Need.OPTIONAL:
        return item.answer
    return f"{_OWN.format(index)}: {item.cost}"
