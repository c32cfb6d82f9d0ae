"""The frame that every MCAP record has, chunks, and what decoding damaged bytes may raise.

The records' fields are decoded by the ``mcap`` package. Its readers are not used: they take a
record that is cut short as it is, unpack a chunk whatever size it grows to, and cannot say where
in the file something was whole.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import Chunk

PREFIX = struct.Struct("<BQ")  # opcode, length of the record that follows
PRIVATE = 0x80  # opcodes from here on belong to applications, and are for them alone
BROKEN = (
    McapError,
    zstandard.ZstdError,
    ArithmeticError,
    LookupError,
    RuntimeError,  # lz4's, and too deep a recursion
    TypeError,
    ValueError,
    struct.error,
)
"""What decoding damaged bytes may raise."""

_LARGEST = 64 * 1024 * 1024  # bytes of a chunk: ours have 64 kB, other writers' a few MB
_DENSEST = 1000  # times smaller than its content; cycles at rest come to 100


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


def open_chunk(payload: bytes) -> bytes:
    """Return the records in a chunk, or raise one of ``BROKEN`` if any bit of it is wrong."""
    chunk = Chunk.read(ReadDataStream(BytesIO(payload)))
    size = chunk.uncompressed_size
    if size > _LARGEST or size > _DENSEST * max(len(chunk.data), 1024):
        raise ValueError(f"a chunk of {size} bytes")
    if chunk.compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as stream:
            data: bytes = stream.read(size + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, size + 1)
    elif chunk.compression:
        raise ValueError(f"a chunk compressed as {chunk.compression[:20]!r}, not as lz4 or zstd")
    else:
        data = chunk.data
    if len(data) != size:
        raise ValueError("the size of a chunk")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):  # 0: its writer made none
        raise ValueError("the checksum of a chunk")
    return data
