"""One pass over a file that may be torn or corrupted: what of it is whole."""

from __future__ import annotations

import json
import mmap
import struct
import zlib
from io import BytesIO
from typing import Any

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk, Metadata
from mcap.writer import MCAP0_MAGIC

from duoglide.storage.head import METADATA_NAME
from duoglide.storage.walk import BROKEN, PREFIX, records_in

MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
LARGEST_CHUNK = 16 * 1024 * 1024  # bytes: a corrupted size must not fill the memory

_EXPECTED = (
    Opcode.HEADER,
    Opcode.METADATA,
    Opcode.ATTACHMENT,
    Opcode.CHUNK,
    Opcode.MESSAGE_INDEX,
)
_DATA_END_LENGTH = 4


class Scan:
    """What one pass over a file has found."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.unread = 0
        self.closed = False
        self.metadata: dict[str, str] = {}
        self.documents: dict[str, Any] = {}
        self.chunks: list[tuple[int, int]] = []
        self.messages = 0
        self.first_stamp = 0
        self.last_stamp = 0

    def take(self, opcode: int, payload: bytes, offset: int) -> None:
        """Take one record, or raise one of ``BROKEN``."""
        stream = ReadDataStream(BytesIO(payload))
        if opcode not in _EXPECTED:
            raise ValueError(f"record {opcode:#x} in the data")
        if opcode == Opcode.METADATA:
            record = Metadata.read(stream)
            if record.name == METADATA_NAME:
                self.metadata = record.metadata
        elif opcode == Opcode.ATTACHMENT:
            self._take_document(payload, Attachment.read(stream))
        elif opcode == Opcode.CHUNK:
            self._take_chunk(open_chunk(payload))
            self.chunks.append((offset, len(payload)))

    def _take_chunk(self, data: bytes) -> None:
        heads = [
            MESSAGE_HEAD.unpack_from(data, start)
            for opcode, start, _ in records_in(data)
            if opcode == Opcode.MESSAGE
        ]
        numbers = [sequence for _, sequence, _, _ in heads]
        if numbers != list(range(self.messages + 1, self.messages + 1 + len(heads))):
            raise ValueError("a chunk is lost")
        stamps = [stamp for _, _, stamp, _ in heads]
        if stamps:
            self.first_stamp = min(stamps) if not self.messages else self.first_stamp
            self.last_stamp = max(stamps)
            self.messages += len(stamps)

    def _take_document(self, payload: bytes, attachment: Attachment) -> None:
        (expected,) = struct.unpack("<I", payload[-4:])
        if zlib.crc32(payload[:-4]) != expected:
            raise ValueError(f"checksum of document {attachment.name}")
        self.documents[attachment.name] = json.loads(attachment.data)


def scan(data: mmap.mmap) -> Scan | None:
    """Go through a file record by record, until its data ends or something is not whole."""
    if data[: len(MCAP0_MAGIC)] != MCAP0_MAGIC:
        return None
    found = Scan(len(data))
    offset = len(MCAP0_MAGIC)
    while offset < len(data):
        found.unread = len(data) - offset
        start = offset + PREFIX.size
        if start > len(data):
            return found
        opcode, length = PREFIX.unpack_from(data, offset)
        if length > len(data) - start:
            return found
        if opcode == Opcode.DATA_END and length == _DATA_END_LENGTH:
            found.closed = True
            break
        try:
            found.take(opcode, data[start : start + length], start)
        except BROKEN:
            return found
        offset = start + length
    found.unread = 0
    return found


def open_chunk(payload: bytes) -> bytes:
    """Return the records in a chunk, or raise one of ``BROKEN`` if any bit of it is wrong."""
    chunk = Chunk.read(ReadDataStream(BytesIO(payload)))
    if chunk.compression != "lz4":
        raise ValueError(f"compression {chunk.compression!r}")
    data: bytes = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, LARGEST_CHUNK)
    if zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("checksum of a chunk")
    return data
