"""A log reader that takes what is whole of a killed, a torn or a corrupted log."""

from __future__ import annotations

import json
import mmap
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Literal, overload

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel

from duoglide.errors import LogError
from duoglide.storage.head import FORMAT, checksum
from duoglide.storage.records import (
    RECORDS,
    CycleRecord,
    EventRecord,
    LogKind,
    MotionRecord,
    Topic,
)
from duoglide.storage.scan import MESSAGE_HEAD, Scan, open_chunk, scan
from duoglide.storage.walk import BROKEN, records_in
from duoglide.storage.writer import ClockAnchor


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
        for number, (stamp, content) in enumerate(self._messages(topic)):
            try:
                record = kind.from_json(json.loads(content))
            except (ValueError, KeyError, TypeError) as error:
                raise LogError(
                    f"{self.path}: message {number} of {topic} cannot be read: {error!r}"
                ) from error
            yield self.anchor.time(stamp), record

    def document(self, name: str) -> Any:
        """Return one document.

        Raises:
            LogError: The log does not hold it.
        """
        if name not in self.documents:
            held = ", ".join(self.documents) or "none"
            raise LogError(f"{self.path} holds no {name} document (it holds: {held})")
        return self.documents[name]

    def _messages(self, topic: Topic) -> Iterator[tuple[int, bytes]]:
        """Read the stamps and the contents of one topic's messages."""
        wanted: set[int] = set()
        try:
            with self.path.open("rb") as file:
                for offset, length in self._chunks:
                    file.seek(offset)
                    data = open_chunk(file.read(length))
                    for opcode, start, end in records_in(data):
                        if opcode == Opcode.MESSAGE:
                            channel, _, stamp, _ = MESSAGE_HEAD.unpack_from(data, start)
                            if channel in wanted:
                                yield stamp, data[start + MESSAGE_HEAD.size : end]
                        elif opcode == Opcode.CHANNEL:
                            found = Channel.read(ReadDataStream(BytesIO(data[start:end])))
                            if found.topic == topic.value:
                                wanted.add(found.id)
        except OSError as error:
            raise LogError(f"cannot read {self.path}: {error.strerror}") from error
        except BROKEN as error:
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
                found = scan(data)
    except OSError as error:
        raise LogError(f"cannot read {file}: {error.strerror}") from error
    if found is None:
        raise LogError(f"{file} is not a log (it does not begin as an MCAP file does)")
    return _log(file, found)


def _log(file: Path, found: Scan) -> Log:
    """Make a log of what a scan has found."""
    head = dict(found.metadata)
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
    missing = _missing(found, anchor)
    if missing:
        warnings.warn(f"{file}: {missing}", LogWarning, stacklevel=3)
    return Log(file, kind, head, found.documents, anchor, missing, tuple(found.chunks))


def _missing(found: Scan, anchor: ClockAnchor) -> str:
    """Say what of a log is missing; nothing if it is whole."""
    if found.closed:
        return ""
    if found.chunks:
        since = anchor.time(found.last_stamp) - anchor.time(found.first_stamp)
        whole = f"{found.messages} whole messages over {since:.3f} s are read"
    else:
        whole = "no whole message is left"
    if found.unread:
        share = 100.0 * found.unread / found.size
        return f"the log is damaged: {whole}; {found.unread} bytes ({share:.1f} %) are missing"
    return f"the log was not closed: {whole}; at most the last second is missing"
