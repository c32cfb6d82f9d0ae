"""The frame that every MCAP record has, and what decoding damaged ones may raise."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from mcap.exceptions import McapError

PREFIX = struct.Struct("<BQ")  # opcode, length of the record that follows
BROKEN = (McapError, ArithmeticError, RuntimeError, ValueError, KeyError, TypeError, struct.error)
"""What decoding damaged bytes may raise."""


def records_in(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Walk through the records of an opened chunk: opcode, start and end of each.

    Raises:
        ValueError: The last one is cut.
    """
    offset = 0
    while offset < len(data):
        opcode, length = PREFIX.unpack_from(data, offset)
        start = offset + PREFIX.size
        offset = start + length
        if offset > len(data):
            raise ValueError("a record is longer than its chunk")
        yield opcode, start, offset
