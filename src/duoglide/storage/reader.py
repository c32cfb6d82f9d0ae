"""A log reader: opens what standard tools have rewritten, and what is whole of a torn log."""

from __future__ import annotations

import math
import os
import re
import stat
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal, overload

from mcap.opcode import Opcode

from duoglide.errors import DuoglideWarning, LogError
from duoglide.storage.head import FORMAT, METADATA_NAME, checksum
from duoglide.storage.records import (
    RECORDS,
    CycleRecord,
    Document,
    EventRecord,
    LogKind,
    MotionRecord,
    Topic,
)
from duoglide.storage.scan import LATEST, MESSAGE_HEAD, Piece, Scan, add_channel, scan
from duoglide.storage.strict_json import loads
from duoglide.storage.walk import BROKEN, open_chunk, records_in
from duoglide.storage.writer import ClockAnchor

_COUNTED = {Topic.CYCLE: "cycles", Topic.EVENT: "events", Topic.MOTION: "samples of the motion"}
_WHOLE_NUMBER = re.compile(r"-?(0|[1-9][0-9]{0,19})")


class LogWarning(DuoglideWarning):
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
        left_out: How many messages lack between those that are there.
    """

    path: Path
    kind: LogKind
    metadata: Mapping[str, str]
    documents: Mapping[str, Any]
    anchor: ClockAnchor
    missing: str
    left_out: int
    _pieces: tuple[Piece, ...]  # where the whole messages are

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
        before = 0
        for number, (stamp, content) in enumerate(self._messages(topic)):
            where = f"{self.path}: message {number} of {topic}"
            if stamp < before and topic is not Topic.EVENT:  # events are told when they are known
                back = 1e-9 * (before - stamp)
                raise LogError(f"{where} is {back:g} s before the one that it follows")
            before = stamp
            try:
                record = kind.from_json(loads(content))
            except KeyError as error:
                raise LogError(f"{where} has no {error}") from error
            except BROKEN as error:
                raise LogError(f"{where} cannot be read: {error}") from error
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
        channels: dict[int, str] = {}
        try:
            with self.path.open("rb") as file:
                for piece in self._pieces:
                    file.seek(piece.offset)
                    data = file.read(piece.length)
                    if piece.chunk:
                        data = open_chunk(data)
                    for opcode, start, end in records_in(data):
                        if opcode == Opcode.MESSAGE:
                            channel, _, stamp, _ = MESSAGE_HEAD.unpack_from(data, start)
                            if channels[channel] == topic.value:
                                yield stamp, data[start + MESSAGE_HEAD.size : end]
                        elif opcode == Opcode.CHANNEL:
                            add_channel(channels, data[start:end])
        except OSError as error:
            raise LogError(f"cannot read {self.path}: {error.strerror}") from error
        except BROKEN as error:
            raise LogError(f"{self.path} has changed since it was opened: {error}") from error


def read_log(path: str | os.PathLike[str]) -> Log:
    """Open a log.

    Any MCAP file that holds a plan or a run opens, whatever tool has written it again: the messages
    may be in chunks or not, compressed or not, and indices, summary and checksums may be absent. A
    log that was killed, damaged or filtered opens up to its last whole record, with a
    ``LogWarning`` that says what is missing; the same words are in ``Log.missing``.

    Args:
        path: The file.

    Raises:
        LogError: No such file, not a Duoglide log, or its head cannot be read.
    """
    file = Path(path)
    try:
        if not stat.S_ISREG(file.stat().st_mode):
            raise LogError(f"cannot read {file}: it is not a file")
        with file.open("rb") as handle:
            size = handle.seek(0, os.SEEK_END)
            if size == 0:
                raise LogError(f"{file} is empty, not a log")
            found = _scanned(file, handle, size)
    except OSError as error:
        raise LogError(f"cannot read {file}: {error.strerror}") from error
    except ValueError as error:  # a name with a null character
        raise LogError(f"cannot read {str(file)!r}: {error}") from error
    return _log(file, found)


def _scanned(file: Path, handle: IO[bytes], size: int) -> Scan:
    """Scan an open file."""
    try:
        found = scan(handle, size)
    except LogError as error:
        raise LogError(f"{file}: {error}") from error
    if found is None:
        raise LogError(
            f"{file} is not a log (it does not begin as an MCAP file does); plans and runs are MCAP"
        )
    return found


def _log(file: Path, found: Scan) -> Log:
    """Make a log of what a scan has found."""
    head = dict(found.head)
    if not head:
        raise LogError(_foreign(file, found))
    if head.pop("crc32", "") != checksum(head):
        raise LogError(f"{file}: the head of the log is damaged (its checksum does not fit)")
    if head.get("format") != FORMAT:
        raise LogError(
            f"{file} has log format {head.get('format')!r:.40}; this version reads {FORMAT}"
        )
    try:
        kind = LogKind(head["kind"])
        anchor = _anchor(head["anchor_monotonic"], head["anchor_wall_ns"])
    except (KeyError, ValueError) as error:
        raise LogError(f"{file}: the head of the log cannot be understood: {error}") from error
    missing = _missing(found)
    if missing:
        warnings.warn(f"{file}: {missing}", LogWarning, stacklevel=3)
    return Log(
        path=file,
        kind=kind,
        metadata=head,
        documents=found.documents,
        anchor=anchor,
        missing=missing,
        left_out=found.left_out,
        _pieces=tuple(found.pieces),
    )


def _anchor(monotonic: str, wall_ns: str) -> ClockAnchor:
    """Return the clock of a log, or raise ``ValueError``."""
    clock = float(monotonic)
    if not math.isfinite(clock):
        raise ValueError(f"the clock begins at {monotonic!r:.40} s")
    if not _WHOLE_NUMBER.fullmatch(wall_ns) or not 0 <= int(wall_ns) < LATEST:
        raise ValueError(f"the clock begins {wall_ns!r:.40} ns after 1970")
    return ClockAnchor(clock, int(wall_ns))


def _foreign(file: Path, found: Scan) -> str:
    """Say what an MCAP file is that has no head of ours."""
    writer = "".join(c if c.isprintable() else "?" for c in found.library[:60])
    if not found.closed and (not writer or writer.startswith(METADATA_NAME)):
        why = found.damage or "it ends before"
        return f"{file}: the head of the log cannot be read ({why})"
    if set(found.channels.values()) & set(Topic):
        return (
            f"{file}: the head of the log is not in it; {writer} has written it again without its"
            " metadata and attachments (`mcap filter` takes them along with --include-metadata"
            " --include-attachments)"
        )
    return f"{file} is not a Duoglide log; it is MCAP written by {writer or 'nobody knows whom'}"


def _missing(found: Scan) -> str:
    """Say what of a log is missing, in its own units; nothing if it is whole."""
    parts = []
    told = _told_cycles(found) if found.closed else 0
    lacking = max(told - found.counts[Topic.CYCLE], 0)  # at the end too, which no number tells
    if lacking:
        parts.append(f"{lacking} of {told} cycles have been filtered out or lost")
    if found.left_out > lacking:
        whole = found.counts.total() + found.left_out
        parts.append(f"{found.left_out} of {whole} messages have been filtered out or lost")
    if not found.closed:
        parts.append(f"{_end(found)}: {_read(found)}; {_lost(found)}")
    return "; ".join(parts)


def _told_cycles(found: Scan) -> int:
    """Return how many cycles the run had, as its report says; 0 where there is none."""
    report = found.documents.get(Document.REPORT)
    here = report if isinstance(report, dict) else {}
    told = here.get("cycles_in_file", here.get("cycles"))  # a long log has more than one file
    return told if isinstance(told, int) else 0


def _end(found: Scan) -> str:
    return f"the log is damaged ({found.damage})" if found.damage else "the log was not closed"


def _read(found: Scan) -> str:
    """Say what is whole."""
    if not found.counts:
        return "no whole message is left"
    counts = [f"{n} {_COUNTED[topic]}" for topic in Topic if (n := found.counts[topic])]
    return f"{' and '.join(counts)} over {1e-9 * (found.last - found.first):.3f} s are read"


def _lost(found: Scan) -> str:
    """Say what came after that, as far as the file says it."""
    beyond = found.beyond
    after = 1e-9 * max(beyond.until - (found.last or beyond.until), 0)
    if beyond.messages is not None and not found.counts:
        return f"{beyond.messages} messages are lost"
    if beyond.messages is not None:
        return f"{beyond.messages} messages of the {after:.3f} s after that are lost"
    if beyond.until > found.last > 0:
        return f"at least {after:.3f} s after that are lost"
    if found.damage:
        return "how much came after that, nothing in it says"
    return "a writer that is killed loses the last second at most, a copy that is cut may lose more"
