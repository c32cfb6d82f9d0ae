"""The MCAP container, written chunk by chunk.

The records are those of the ``mcap`` package. The chunks are put together here, because its own
writer takes several times as long for a message, and the cycle has no time to give away.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import IO

import lz4.frame
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

CHUNK_SIZE = 64 * 1024  # bytes before compression
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log and publish time
_MESSAGE_HEAD = 22  # bytes of a message record between its length and its data
_FOOTER_HEAD = struct.Struct("<BQQQ")
_INDEX_HEAD = struct.Struct("<BQHI")  # opcode, length, channel, bytes of entries
_COMPRESSION = 3  # of lz4: a seventh smaller than its default, for 3 us a message


@dataclass(frozen=True, slots=True)
class ChannelSpec:
    """A channel of JSON messages: its topic, and the name and text of its schema."""

    topic: str
    schema_name: str
    schema: bytes


class ContainerWriter:
    """Writes one MCAP file.

    Args:
        file: An empty file, open for writing bytes; it is not closed here.
        library: What to call the writer in the file's header.
        channels: What messages there will be; their numbers count from 1 in this order.
    """

    def __init__(self, file: IO[bytes], library: str, channels: Sequence[ChannelSpec]) -> None:
        self._file = file
        self._offset = 0
        self._schemas = [
            Schema(number, encoding="jsonschema", name=spec.schema_name, data=spec.schema)
            for number, spec in enumerate(channels, 1)
        ]
        self._channels = [
            Channel(
                number, topic=spec.topic, message_encoding="json", metadata={}, schema_id=number
            )
            for number, spec in enumerate(channels, 1)
        ]
        self._index = _Index()
        self._sequence = 0
        self._chunk = bytearray(_encoded([*self._schemas, *self._channels]))
        self._entries: dict[int, list[int]] = {}  # by channel: stamp, offset, stamp, offset, ...
        self._put(MCAP0_MAGIC + _encoded([Header("", library)]))

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Write a table of texts."""
        data = _encoded([Metadata(name=name, metadata=values)])
        index = MetadataIndex(offset=self._put(data), length=len(data), name=name)
        self._index.metadata.append(index)

    def add_attachment(self, name: str, media_type: str, stamp: int, content: bytes) -> None:
        """Write a document."""
        attachment = Attachment(
            create_time=stamp, log_time=stamp, name=name, media_type=media_type, data=content
        )
        data = _encoded([attachment])
        index = AttachmentIndex(
            offset=self._put(data),
            length=len(data),
            log_time=stamp,
            create_time=stamp,
            data_size=len(content),
            name=name,
            media_type=media_type,
        )
        self._index.attachments.append(index)

    def add_message(self, channel: int, stamp: int, content: bytes) -> None:
        """Write one message; it is in the file when its chunk is full, or at the next ``flush``."""
        chunk = self._chunk
        self._sequence = (self._sequence + 1) & 0xFFFFFFFF
        self._entries.setdefault(channel, []).extend((stamp, len(chunk)))
        length = _MESSAGE_HEAD + len(content)
        chunk += _MESSAGE.pack(Opcode.MESSAGE, length, channel, self._sequence, stamp, stamp)
        chunk += content
        if len(chunk) >= CHUNK_SIZE:
            self._end_chunk()

    def flush(self) -> None:
        """End the chunk and hand everything to the operating system."""
        self._end_chunk()
        self._file.flush()

    def finish(self) -> None:
        """Write the summary that makes the file quick to open."""
        self._end_chunk()
        self._put(_encoded([DataEnd(0)]))
        summary, offsets = bytearray(), bytearray()
        start = self._offset
        for group in self._index.groups(self._schemas, self._channels):
            data = _encoded(group)
            where = SummaryOffset(
                group_opcode=data[0], group_start=start + len(summary), group_length=len(data)
            )
            summary += data
            offsets += _encoded([where])
        offset_start = start + len(summary)
        summary += offsets
        head = _FOOTER_HEAD.pack(Opcode.FOOTER, 20, start, offset_start)
        crc = zlib.crc32(head, zlib.crc32(summary))
        footer = Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=crc)
        self._put(summary + _encoded([footer]) + MCAP0_MAGIC)
        self._file.flush()

    def _end_chunk(self) -> None:
        if not self._entries:
            return
        plain = bytes(self._chunk)
        chunk = Chunk(
            compression="lz4",
            data=lz4.frame.compress(plain, compression_level=_COMPRESSION),
            message_start_time=min(min(entries[::2]) for entries in self._entries.values()),
            message_end_time=max(max(entries[::2]) for entries in self._entries.values()),
            uncompressed_crc=zlib.crc32(plain),
            uncompressed_size=len(plain),
        )
        data = _encoded([chunk])
        start = self._put(data)
        first = self._offset
        offsets = {
            channel: self._put(_message_index(channel, entries))
            for channel, entries in self._entries.items()
        }
        self._index.add_chunk(chunk, start, len(data), offsets, self._offset - first)
        self._index.count({channel: len(e) // 2 for channel, e in self._entries.items()})
        self._chunk = bytearray()
        self._entries = {}

    def _put(self, data: bytes | bytearray) -> int:
        """Write ``data`` and return where it begins."""
        start = self._offset
        self._file.write(data)
        self._offset += len(data)
        return start


class _Index:
    """What the summary at the end of the file will say."""

    def __init__(self) -> None:
        self.metadata: list[MetadataIndex] = []
        self.attachments: list[AttachmentIndex] = []
        self._chunks: list[ChunkIndex] = []
        self._counts: dict[int, int] = {}

    def add_chunk(
        self, chunk: Chunk, start: int, length: int, offsets: dict[int, int], index_length: int
    ) -> None:
        self._chunks.append(
            ChunkIndex(
                chunk_start_offset=start,
                chunk_length=length,
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                message_index_offsets=offsets,
                message_index_length=index_length,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                uncompressed_size=chunk.uncompressed_size,
            )
        )

    def count(self, messages: dict[int, int]) -> None:
        for channel, number in messages.items():
            self._counts[channel] = self._counts.get(channel, 0) + number

    def groups(
        self, schemas: Sequence[Schema], channels: Sequence[Channel]
    ) -> list[Sequence[McapRecord]]:
        """Return the records of the summary, each kind together."""
        starts = [chunk.message_start_time for chunk in self._chunks]
        ends = [chunk.message_end_time for chunk in self._chunks]
        statistics = Statistics(
            attachment_count=len(self.attachments),
            channel_count=len(channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=max(ends, default=0),
            message_start_time=min(starts, default=0),
            metadata_count=len(self.metadata),
            schema_count=len(schemas),
        )
        groups: list[Sequence[McapRecord]] = [
            schemas,
            channels,
            [statistics],
            self._chunks,
            self.attachments,
            self.metadata,
        ]
        return [group for group in groups if group]


def _message_index(channel: int, entries: list[int]) -> bytes:
    """Return a MessageIndex record; one by one, its entries cost more than their messages."""
    size = 8 * len(entries)
    head = _INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + size, channel, size)
    return head + struct.pack(f"<{len(entries)}Q", *entries)


def _encoded(records: Sequence[McapRecord]) -> bytes:
    """Return the bytes of some records, one after another."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]  # mcap says no type here
    return data
