"""What a simulated drive keeps without its supply: 0x1010 stores, 0x1011 restores (CiA 301)."""

from __future__ import annotations

from collections.abc import Mapping

STORE = 0x1010
RESTORE = 0x1011
SAVE = int.from_bytes(b"save", "little")  # the signatures, CiA 301 7.5.2.13 and 7.5.2.14
LOAD = int.from_bytes(b"load", "little")

# Written by the host, but of the moment: a drive must not wake up with an old command.
_OF_THE_MOMENT = frozenset(
    {(0x1003, 0), (STORE, 1), (RESTORE, 1), (0x6040, 0), (0x6060, 0), (0x607A, 0), (0x60FE, 1)}
)

Key = tuple[int, int]


class ParameterMemory:
    """The parameters that survive power-off; nothing is in it when the drive is new."""

    def __init__(self) -> None:
        self.stored: dict[Key, int] = {}

    def store(self, values: Mapping[Key, int]) -> None:
        """Keep the parameters among ``values``, all that the host may write."""
        self.stored = {key: value for key, value in values.items() if key not in _OF_THE_MOMENT}

    def forget(self) -> None:
        """Go back to the defaults; they hold from the next reset on."""
        self.stored = {}
