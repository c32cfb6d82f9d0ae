"""A log reader that takes what is whole of a killed, a torn or a corrupted log."""

from __future__ import annotations

import json
import mmap
import struct
import warnings
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Literal, overload

import lz4.frame
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Message, Metadata
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

from duoglide.errors import LogError
from duoglide.storage.records import (
    RECORDS,
    CycleRecord,
    EventRecord,
    LogKind,
    MotionRecord,
    Topic,
)
from duoglide.storage.writer import FORMAT, METADATA_NAME, ClockAnchor, checksum

_PREFIX = struct.Struct("<BQ")  # opcode, length of the record that follows
_LARGEST_CHUNK = 16 * 1024 * 1024  # bytes: a corrupted size must not fill the memory
_BROKEN = (McapError, ArithmeticError, RuntimeError, ValueError, KeyError, TypeError, struct.error)


class LogWarning(UserWarning):
    """A log that is not whole."""


@dataclass(frozen=True, slots=True)
class Log:
    """An opened log: its documents in memory, its messages read from the file when asked for.

    Attributes:
        path: The file.
        kind: Plan or run.
        metadata: Versions, hashes and the clock anchor, as text.
        documents: The JSON documents that travel in it, by name.
        anchor: The clock that the messages' times are on.
        missing: What is missing, in words; empty for a log that is whole.
    """

    path: Path
    kind: LogKind
    metadata: Mapping[str, str]
    documents: Mapping[str, Any]
    anchor: ClockAnchor
    missing: str
    _chunks: tuple[tuple[int, int], ...]  # (offset, length) of the whole chunk records

    @overload
    def records(self, topic: Literal[Topic.CYCLE]) -> Iterator[tuple[float, CycleRecord]]: ...
    @overload
    def records(self, topic: Literal[Topic.EVENT]) -> Iterator[tuple[float, EventRecord]]: ...
    @overload
    def records(self, topic: Literal[Topic.MOTION]) -> Iterator[tuple[float, MotionRecord]]: ...
    def records(
        self, topic: Topic
    ) -> Iterator[tuple[float, CycleRecord | EventRecord | MotionRecord]]:
        """Read the messages of one topic in the order in which they were written.

        Args:
            topic: Which channel.

        Yields:
            Time on the anchor's monotonic clock [s], and the record.

        Raises:
            LogError: The file has changed or a message is not what its topic holds.
        """
        kind = RECORDS[topic]
        for number, message in enumerate(self._messages(topic)):
            try:
                record = kind.from_json(json.loads(message.data))
            except (ValueError, KeyError, TypeError) as error:
                raise LogError(
                    f"{self.path}: message {number} of {topic} cannot be read: {error!r}"
                ) from error
            yield self.anchor.time(message.log_time), record

    def document(self, name: str) -> Any:
        """Return one document.

        Raises:
            LogError: The log does not hold it.
        """
        if name not in self.documents:
            held = ", ".join(self.documents) or "none"
            raise LogError(f"{self.path} holds no {name} document (it holds: {held})")
        return self.documents[name]

    def _messages(self, topic: Topic) -> Iterator[Message]:
        channels: set[int] = set()
        try:
            with self.path.open("rb") as file:
                for offset, length in self._chunks:
                    file.seek(offset)
                    for record in _open_chunk(file.read(length)):
                        if isinstance(record, Channel) and record.topic == topic.value:
                            channels.add(record.id)
                        elif isinstance(record, Message) and record.channel_id in channels:
                            yield record
        except OSError as error:
            raise LogError(f"cannot read {self.path}: {error.strerror}") from error
        except _BROKEN as error:
            raise LogError(f"{self.path} has changed since it was opened: {error}") from error


def read_log(path: str | Path) -> Log:
    """Open a log.

    A log that was killed or damaged opens up to its last whole record, with a ``LogWarning`` that
    says how much is missing; the same words are in ``Log.missing``.

    Args:
        path: The file.

    Raises:
        LogError: No such file, not a Duoglide log, or its head cannot be read.
    """
    file = Path(path)
    try:
        with file.open("rb") as handle:
            if handle.seek(0, 2) == 0:
                raise LogError(f"{file} is empty, not a log")
            with mmap.mmap(handle.fileno(), 0, access=mmap.ACCESS_READ) as data:
                scan = _scan(data)
    except OSError as error:
        raise LogError(f"cannot read {file}: {error.strerror}") from error
    if scan is None:
        raise LogError(f"{file} is not a log (it does not begin as an MCAP file does)")
    return _log(file, scan)


def _log(file: Path, scan: _Scan) -> Log:
    """Make a log of what a scan has found."""
    head = dict(scan.metadata)
    if not head:
        raise LogError(f"{file}: the head of the log cannot be read")
    if head.pop("crc32", "") != checksum(head):
        raise LogError(f"{file}: the head of the log is damaged (its checksum does not fit)")
    if head.get("format") != FORMAT:
        raise LogError(f"{file} has log format {head.get('format')}; this version reads {FORMAT}")
    try:
        kind = LogKind(head["kind"])
        anchor = ClockAnchor(float(head["anchor_monotonic"]), int(head["anchor_wall_ns"]))
    except (KeyError, ValueError) as error:
        raise LogError(f"{file}: the head of the log cannot be understood: {error}") from error
    missing = _missing(scan, anchor)
    if missing:
        warnings.warn(f"{file}: {missing}", LogWarning, stacklevel=3)
    return Log(file, kind, head, scan.documents, anchor, missing, tuple(scan.chunks))


def _missing(scan: _Scan, anchor: ClockAnchor) -> str:
    """Say what of a log is missing; nothing if it is whole."""
    if scan.closed:
        return ""
    if scan.chunks:
        since = anchor.time(scan.last_stamp) - anchor.time(scan.first_stamp)
        whole = f"{scan.messages} whole messages over {since:.3f} s are read"
    else:
        whole = "no whole message is left"
    if scan.unread:
        share = 100.0 * scan.unread / scan.size
        return f"the log is damaged: {whole}; {scan.unread} bytes ({share:.1f} %) are missing"
    return f"the log was not closed: {whole}; at most the last second is missing"


class _Scan:
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
        """Take one record, or raise one of ``_BROKEN``."""
        stream = ReadDataStream(BytesIO(payload))
        if opcode == Opcode.METADATA:
            record = Metadata.read(stream)
            if record.name == METADATA_NAME:
                self.metadata = record.metadata
        elif opcode == Opcode.ATTACHMENT:
            self._take_document(payload, Attachment.read(stream))
        elif opcode == Opcode.CHUNK:
            stamps = [r.log_time for r in _open_chunk(payload) if isinstance(r, Message)]
            if stamps:
                self.first_stamp = min(stamps) if not self.messages else self.first_stamp
                self.last_stamp = max(stamps)
                self.messages += len(stamps)
            self.chunks.append((offset, len(payload)))

    def _take_document(self, payload: bytes, attachment: Attachment) -> None:
        (expected,) = struct.unpack("<I", payload[-4:])
        if zlib.crc32(payload[:-4]) != expected:
            raise ValueError(f"checksum of document {attachment.name}")
        self.documents[attachment.name] = json.loads(attachment.data)


def _scan(data: mmap.mmap) -> _Scan | None:
    """Go through a file record by record, until its data ends or something is not whole."""
    if data[: len(MCAP0_MAGIC)] != MCAP0_MAGIC:
        return None
    scan = _Scan(len(data))
    offset = len(MCAP0_MAGIC)
    while offset < len(data):
        scan.unread = len(data) - offset
        start = offset + _PREFIX.size
        if start > len(data):
            return scan
        opcode, length = _PREFIX.unpack_from(data, offset)
        if length > len(data) - start:
            return scan
        if opcode == Opcode.DATA_END:
            scan.closed = True
            break
        try:
            scan.take(opcode, data[start : start + length], start)
        except _BROKEN:
            return scan
        offset = start + length
    scan.unread = 0
    return scan


def _open_chunk(payload: bytes) -> list[Any]:
    """Return the records in a chunk, or raise one of ``_BROKEN`` if any bit of it is wrong."""
    chunk = Chunk.read(ReadDataStream(BytesIO(payload)))
    if chunk.compression != "lz4":
        raise ValueError(f"compression {chunk.compression!r}")
    data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, _LARGEST_CHUNK)
    if zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("checksum of a chunk")
    plain = Chunk(
        compression="",
        data=data,
        message_start_time=chunk.message_start_time,
        message_end_time=chunk.message_end_time,
        uncompressed_crc=0,
        uncompressed_size=len(data),
    )
    return [*breakup_chunk(plain)]
