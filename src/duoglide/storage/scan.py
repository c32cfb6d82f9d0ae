"""One pass over a file that may be torn, corrupted or rewritten: what of it is whole."""

from __future__ import annotations

import struct
import zlib
from array import array
from collections import Counter
from dataclasses import dataclass, field
from io import BytesIO
from typing import IO, Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, DataEnd, Footer, Header, Metadata, Statistics
from mcap.writer import MCAP0_MAGIC

from duoglide.errors import LogError
from duoglide.storage.head import METADATA_NAME
from duoglide.storage.records import Topic, is_document
from duoglide.storage.strict_json import loads
from duoglide.storage.walk import BROKEN, PREFIX, PRIVATE, open_chunk, records_in

MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
LATEST = 2**63  # [ns]: a stamp from here on, the year 2262, is none
_FOOTER_SIZE = PREFIX.size + 20
_CHUNK_TIMES = struct.Struct("<QQ")  # of its first and its last message
_TOPICS = frozenset(Topic)
_ENCODING = "json"


@dataclass(frozen=True, slots=True)
class Piece:
    """Where in the file messages are.

    Attributes:
        offset: Of the chunk's content, or of the first record that is in none.
        length: [bytes].
        chunk: Whether it is a chunk.
    """

    offset: int
    length: int
    chunk: bool


@dataclass(slots=True)
class Beyond:
    """What the file says of messages that could not be read.

    Attributes:
        messages: How many; None where it does not say.
        until: Stamp of the last [ns]; 0 where it does not say.
        whole: Whether that is all, or there may have been more.
    """

    messages: int | None = None
    until: int = 0
    whole: bool = False


@dataclass(slots=True)
class Scan:
    """What one pass over a file has found.

    Attributes:
        size: Of the file [bytes].
        library: Who wrote the file, in its own words.
        head: The table of texts of a log of ours.
        documents: Our JSON documents, by name.
        pieces: Where the messages are.
        channels: Topic of each channel.
        counts: How many messages of each of our topics are whole.
        first: Stamp of the first message [ns].
        last: Stamp of the last [ns].
        closed: Whether the data was read up to its end.
        damage: What ended the reading before, in words; empty where the file just ends.
        beyond: What the file says of what was not read.
    """

    size: int
    library: str = ""
    head: dict[str, str] = field(default_factory=dict)
    documents: dict[str, Any] = field(default_factory=dict)
    pieces: list[Piece] = field(default_factory=list)
    channels: dict[int, str] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    first: int = 0
    last: int = 0
    closed: bool = False
    damage: str = ""
    beyond: Beyond = field(default_factory=Beyond)
    _messages: int = 0
    _sequences: array[int] = field(default_factory=lambda: array("I"))

    @property
    def left_out(self) -> int:
        """How many messages lack among those that were read; 0 where nobody numbered them.

        Our writer numbers its messages from 1 on. Tools that filter keep the numbers, and tools
        that make their own give no number twice to one channel only.
        """
        numbers = set(self._sequences)
        if not numbers or len(numbers) < len(self._sequences) or 0 in numbers:
            return 0
        return max(numbers) - len(numbers)

    def take(self, opcode: int, payload: bytes, offset: int) -> None:
        """Take one record, or raise one of ``BROKEN``.

        Raises:
            LogError: The file holds two logs.
        """
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            self._take_bare(opcode, payload, offset)
        elif opcode == Opcode.CHUNK:
            self._take_records(open_chunk(payload))
            self.pieces.append(Piece(offset, len(payload), chunk=True))
        elif opcode == Opcode.HEADER:
            self.library = Header.read(_stream(payload)).library
        elif opcode == Opcode.METADATA:
            self._take_head(Metadata.read(_stream(payload)))
        elif opcode == Opcode.ATTACHMENT:
            self._take_document(payload, Attachment.read(_stream(payload)))
        elif opcode != Opcode.MESSAGE_INDEX and opcode < PRIVATE:
            raise ValueError(f"a record {opcode:#x} among the data")

    def _take_head(self, table: Metadata) -> None:
        if table.name != METADATA_NAME:
            return
        if self.head not in ({}, table.metadata):
            raise LogError("it holds two logs in one; they have to be read one by one")
        self.head = table.metadata

    def _take_document(self, payload: bytes, attachment: Attachment) -> None:
        (expected,) = struct.unpack("<I", payload[-4:])
        if expected not in (0, zlib.crc32(payload[:-4])):  # 0: its writer made none
            raise ValueError(f"the checksum of document {attachment.name[:40]!r}")
        if not is_document(attachment.name):
            return
        try:
            document = loads(attachment.data)
        except BROKEN as error:
            raise LogError(f"its {attachment.name} document cannot be read: {error}") from error
        if self.documents.get(attachment.name, document) != document:
            raise LogError(f"it holds two {attachment.name} documents, and they differ")
        self.documents[attachment.name] = document

    def _take_bare(self, opcode: int, payload: bytes, offset: int) -> None:
        """Take a record that is in no chunk."""
        record = PREFIX.pack(opcode, len(payload)) + payload
        self._take_records(record)
        start = offset - PREFIX.size
        last = self.pieces[-1] if self.pieces else None
        if last is None or last.chunk or last.offset + last.length != start:
            self.pieces.append(Piece(start, len(record), chunk=False))
        else:
            self.pieces[-1] = Piece(last.offset, last.length + len(record), chunk=False)

    def _take_records(self, data: bytes) -> None:
        """Take the records of a chunk, all of them or none."""
        channels = dict(self.channels)
        heads = []
        for opcode, start, end in records_in(data):
            if opcode == Opcode.MESSAGE:
                if end - start < MESSAGE_HEAD.size:
                    raise ValueError("a message without its stamp")
                heads.append(MESSAGE_HEAD.unpack_from(data, start))
            elif opcode == Opcode.CHANNEL:
                add_channel(channels, data[start:end])
            elif opcode != Opcode.SCHEMA and opcode < PRIVATE:
                raise ValueError(f"a record {opcode:#x} in a chunk")
        known = {number for number, topic in channels.items() if topic in _TOPICS}
        if unknown := {number for number, _, _, _ in heads} - channels.keys():
            raise ValueError(f"messages of channel {min(unknown)}, which is not there")
        ours = [head for head in heads if head[0] in known]
        stamps = [stamp for _, _, stamp, _ in ours]
        if max(stamps, default=0) >= LATEST:
            raise ValueError("a message of a year after 2262")
        self.channels = channels
        self._messages += len(heads)
        if not ours:
            return
        self.first = min(self.first, *stamps) if self.counts else min(stamps)
        self.last = max(self.last, *stamps)
        for number, count in Counter([number for number, _, _, _ in ours]).items():
            self.counts[channels[number]] += count
        self._sequences.extend([number for _, number, _, _ in ours])


def add_channel(channels: dict[int, str], payload: bytes) -> None:
    """Take a channel record into a table of topics, or raise one of ``BROKEN``."""
    channel = Channel.read(_stream(payload))
    if channels.setdefault(channel.id, channel.topic) != channel.topic:
        raise ValueError(f"channel {channel.id} has two topics")
    if channel.topic in _TOPICS and channel.message_encoding != _ENCODING:
        raise ValueError(f"messages of {channel.topic} are {channel.message_encoding[:20]!r}")


def scan(file: IO[bytes], size: int) -> Scan | None:
    """Go through a file record by record, until its data ends or something is not whole.

    Args:
        file: The open file.
        size: How long it is [bytes].

    Returns:
        What was found; None where the file is no MCAP at all.

    Raises:
        LogError: It holds what no log of ours holds.
        OSError: The file cannot be read.
    """
    file.seek(0)
    if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        return None
    found = Scan(size)
    offset = len(MCAP0_MAGIC)
    while offset < size:
        file.seek(offset)
        prefix = file.read(PREFIX.size)
        start = offset + PREFIX.size
        if len(prefix) < PREFIX.size:
            found.damage = "it ends within a record"
            break
        opcode, length = PREFIX.unpack(prefix)
        if length > size - start:
            found.damage = "it ends within a record"
            break
        payload = file.read(length)
        try:
            if opcode == Opcode.DATA_END:
                _require_whole(file, offset, DataEnd.read(_stream(payload)).data_section_crc)
                found.closed = True
                return found
            found.take(opcode, payload, start)
        except BROKEN as error:
            found.damage = _words(error)
            break
        offset = start + length
    found.beyond = _beyond(file, offset, size, found._messages)
    return found


def _require_whole(file: IO[bytes], end: int, expected: int) -> None:
    """Check the data as a whole, where its writer made a checksum."""
    if expected == 0:
        return
    file.seek(0)
    crc = 0
    while end > 0:
        block = file.read(min(end, 1024 * 1024))
        if not block:
            break
        crc = zlib.crc32(block, crc)
        end -= len(block)
    if crc != expected:
        raise LogError("it is damaged, and nothing says where (the checksum of its data)")


def _beyond(file: IO[bytes], offset: int, size: int, read: int) -> Beyond:
    """Find out what there was after ``offset``, from the summary or from the chunks' heads."""
    try:
        if (statistics := _statistics(file, size)) is not None:
            messages = max(statistics.message_count - read, 0)
            return Beyond(messages, statistics.message_end_time, whole=True)
    except BROKEN:
        pass  # then there is no summary to ask
    found = Beyond()
    while offset + PREFIX.size + _CHUNK_TIMES.size <= size:
        file.seek(offset)
        opcode, length = PREFIX.unpack(file.read(PREFIX.size))
        if opcode == Opcode.CHUNK:
            start, end = _CHUNK_TIMES.unpack(file.read(_CHUNK_TIMES.size))
            if start <= end < LATEST:
                found.until = max(found.until, end)
        elif opcode not in (Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA):
            break
        offset += PREFIX.size + length
    return found


def _statistics(file: IO[bytes], size: int) -> Statistics | None:
    """Read the statistics at the end of a file, if they are there and whole."""
    end = size - len(MCAP0_MAGIC) - _FOOTER_SIZE
    if end < 0:
        return None
    file.seek(end)
    tail = file.read()
    opcode, length = PREFIX.unpack_from(tail)
    if opcode != Opcode.FOOTER or length != _FOOTER_SIZE - PREFIX.size:
        return None
    footer = Footer.read(_stream(tail[PREFIX.size :]))
    if not 0 < footer.summary_start < end:
        return None
    file.seek(footer.summary_start)
    summary = file.read(end - footer.summary_start)
    if footer.summary_crc not in (0, zlib.crc32(tail[: _FOOTER_SIZE - 4], zlib.crc32(summary))):
        return None
    for kind, start, stop in records_in(summary):
        if kind == Opcode.STATISTICS:
            statistics: Statistics = Statistics.read(_stream(summary[start:stop]))
            return statistics
    return None


def _stream(payload: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(payload))


def _words(error: BaseException) -> str:
    """Say what is wrong with damaged bytes."""
    return str(error) if type(error) is ValueError else f"a record that is none: {error}"[:120]
