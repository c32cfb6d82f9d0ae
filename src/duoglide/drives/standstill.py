"""How simulated drives stand still with the computer that they share with their host.

A shared computer leaves a process without a processor for tens of milliseconds now and then. Real
drives and real time go on meanwhile; simulated ones need not. They have an object that no real
drive has: it says for how long they bear it that nothing comes. Whoever reads it promises to move
his schedule instead of skipping cycles. With a host that does not ask, late is late. The promise
ends where the drives go back to PRE-OPERATIONAL, as every bring-up begins, and with the host's
connection.
"""

from __future__ import annotations

from dataclasses import dataclass

INDEX = 0x20F0  # where manufacturers have objects of their own
SIGN = 1  # sub-index that only says whose drive it is, and promises nothing
_SIGNATURE = 0xD61D0000  # above the milliseconds: no other manufacturer's object reads like it
_MILLISECONDS = 0xFFFF


def signature() -> bytes:
    """Return what sub-index SIGN holds."""
    return _SIGNATURE.to_bytes(4, "little")


@dataclass(slots=True)
class Standstill:
    """What the drives of one simulation have in common.

    Attributes:
        seconds: For how long they stand still; 0: never, and they do not have the object.
        agreed: Whether a host has promised to stand still with them.
    """

    seconds: float = 0.0
    agreed: bool = False

    def agree(self) -> bytes:
        """Take a host's promise; return what the object holds."""
        self.agreed = True
        value = _SIGNATURE | min(round(self.seconds * 1e3), _MILLISECONDS)
        return value.to_bytes(4, "little")


def seconds_in(data: bytes) -> float:
    """Return for how long a drive stands still [s]; 0 where it says something else."""
    value = int.from_bytes(data, "little")
    simulated = len(data) == 4 and value & ~_MILLISECONDS == _SIGNATURE
    return (value & _MILLISECONDS) * 1e-3 if simulated else 0.0
