"""A log writer that loses no more than the last second when its process is killed."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import IO, Self

from mcap.writer import CompressionType, Writer

from duoglide.errors import LogError
from duoglide.storage.atomic import file_behind
from duoglide.storage.head import FORMAT, METADATA_NAME, checksum
from duoglide.storage.paths import require_replaceable
from duoglide.storage.records import LogKind, Record, Topic
from duoglide.storage.schemas import schema_name, schema_of

FLUSH_PERIOD = 0.5  # [s]
CHUNK_SIZE = 64 * 1024  # bytes before compression: what one message may have to wait for
JSON_TYPE = "application/json"


@dataclass(frozen=True, slots=True)
class ClockAnchor:
    """One instant on both clocks; every stamp in a log is counted from it on the monotonic clock.

    Attributes:
        monotonic: [s], the clock of ``time.monotonic``.
        wall_ns: [ns] since 1970.
    """

    monotonic: float
    wall_ns: int

    @classmethod
    def now(cls) -> ClockAnchor:
        """Read both clocks."""
        return cls(time.monotonic(), time.time_ns())

    @classmethod
    def zero(cls) -> ClockAnchor:
        """Read the wall clock only: for a plan, whose own time begins at zero."""
        return cls(0.0, time.time_ns())

    def stamp(self, t: float) -> int:
        """Turn a time on the monotonic clock [s] into nanoseconds since 1970."""
        return self.wall_ns + round((t - self.monotonic) * 1e9)

    def time(self, stamp: int) -> float:
        """Undo ``stamp``."""
        return self.monotonic + (stamp - self.wall_ns) * 1e-9


class LogWriter:
    """Writes one plan or run.

    The file appears under its name only when there is something to keep: a plan when it is
    complete, a run with its first message. Until then an older file of that name stays as it is; it
    must be of the same kind, for nothing else is replaced.

    Args:
        path: Where to write.
        kind: Plan or run.
        metadata: What to keep beside the documents: short texts, such as the hash of the EDS.
        anchor: The clock that ``t`` of ``write`` is on; default: now for a run, zero for a plan.

    Example:
        >>> import tempfile
        >>> from duoglide.storage import Document, EventKind, EventRecord
        >>> file = Path(tempfile.mkdtemp()) / "run.mcap"
        >>> with LogWriter(file, LogKind.RUN) as log:
        ...     log.attach(Document.MACHINE, {"clearance": 2.0})
        ...     log.write(Topic.EVENT, time.monotonic(), EventRecord(EventKind.STARTED, "go"))
    """

    def __init__(
        self,
        path: str | Path,
        kind: LogKind,
        metadata: Mapping[str, str] | None = None,
        anchor: ClockAnchor | None = None,
    ) -> None:
        self._path = Path(path)
        self._kind = LogKind(kind)
        self._metadata = dict(metadata or {})
        self._anchor = anchor
        self._published = False

    def __enter__(self) -> Self:
        run = self._kind is LogKind.RUN
        anchor = self._anchor or (ClockAnchor.now() if run else ClockAnchor.zero())
        self._stamp = anchor.stamp
        self._goal = file_behind(self._path)
        require_replaceable(self._path, self._kind)
        self._temporary = self._goal.with_name(f".{self._goal.name}.{os.getpid()}.part")
        try:
            self._file = self._temporary.open("wb")
        except OSError as error:
            raise LogError(f"cannot write {self._path}: {error.strerror}") from error
        try:
            self._begin(anchor)
        except OSError as error:
            self._discard()
            raise LogError(f"cannot write {self._path}: {error.strerror}") from error
        return self

    def _begin(self, anchor: ClockAnchor) -> None:
        self._mcap = open_mcap(self._file)
        self._numbers = {
            topic: add_channel(self._mcap, topic, schema_name(topic), schema_of(topic))
            for topic in Topic
        }
        self._sequence = 0
        head = {
            **self._metadata,
            "format": FORMAT,
            "kind": self._kind.value,
            "anchor_monotonic": repr(anchor.monotonic),
            "anchor_wall_ns": str(anchor.wall_ns),
            "duoglide": version("duoglide"),
            "python": platform.python_version(),
        }
        self._mcap.add_metadata(METADATA_NAME, {**head, "crc32": checksum(head)})
        self._publish_now = self._kind is LogKind.RUN
        self._next_flush = time.monotonic() + FLUSH_PERIOD

    def attach(self, name: str, document: object) -> None:
        """Write a JSON document into the log; it is on disk when this returns.

        Args:
            name: Of the document.
            document: Its values, or its JSON as bytes.

        Raises:
            LogError: The document is not JSON, or the disk is full.
        """
        try:
            if not isinstance(document, bytes):
                document = json.dumps(document, allow_nan=False).encode()
        except (TypeError, ValueError) as error:
            raise LogError(f"document {name} cannot be written as JSON: {error}") from error
        try:
            now = time.time_ns()
            self._mcap.add_attachment(now, now, str(name), JSON_TYPE, document)
            self._file.flush()
        except OSError as error:
            raise LogError(f"cannot write {self._path}: {error.strerror}") from error

    @property
    def size(self) -> int:
        """How many bytes have been written [byte], but for what is still to be compressed."""
        return self._file.tell()

    def write(self, topic: Topic, t: float, record: Record) -> None:
        """Write one message.

        Args:
            topic: Its channel.
            t: When, on the anchor's monotonic clock [s].
            record: What.

        Raises:
            LogError: The disk is full, or the file cannot be put in place.
        """
        stamp = self._stamp(t)
        self._sequence = (self._sequence + 1) & 0xFFFFFFFF
        try:
            self._mcap.add_message(
                self._numbers[topic], stamp, record.to_json(), stamp, self._sequence
            )
        except OSError as error:
            raise LogError(f"cannot write {self._path}: {error.strerror}") from error
        if self._publish_now or time.monotonic() >= self._next_flush:
            self.flush()

    def flush(self) -> None:
        """Hand everything written so far to the operating system: a killed process loses none.

        ``write`` does this twice a second; call it where writing pauses.

        Raises:
            LogError: The disk is full, or the file cannot be put in place.
        """
        try:
            self._mcap.flush()
            if self._publish_now:
                self._publish()
        except OSError as error:
            raise LogError(f"cannot write {self._path}: {error.strerror}") from error
        self._next_flush = time.monotonic() + FLUSH_PERIOD

    def _publish(self) -> None:
        self._temporary.replace(self._goal)
        self._published = True
        self._publish_now = False

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None and not self._published:
            self._discard()
            return
        try:
            self._mcap.finish()
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
            if not self._published:
                self._publish()
        except OSError as failure:
            self._discard()
            raise LogError(f"cannot write {self._path}: {failure.strerror}") from failure

    def _discard(self) -> None:
        with contextlib.suppress(OSError):
            self._file.close()
        if not self._published:
            self._temporary.unlink(missing_ok=True)


def open_mcap(file: IO[bytes]) -> Writer:
    """Begin an MCAP file as ours are: in small chunks, compressed, with their checksums.

    Args:
        file: An empty file, open for writing bytes; it is not closed here.
    """
    writer = Writer(file, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
    writer.start(profile="", library=f"duoglide {version('duoglide')}")
    return writer


def add_channel(writer: Writer, topic: str, name: str, schema: bytes) -> int:
    """Add a channel of JSON messages with the name and the text of its schema; return its number.

    Messages of a channel can be written from then on.
    """
    return writer.register_channel(
        topic=topic,
        message_encoding="json",
        schema_id=writer.register_schema(name=name, encoding="jsonschema", data=schema),
    )
