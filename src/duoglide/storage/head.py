"""The head of a plan or a run: the table of texts that no other MCAP file has."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Metadata
from mcap.writer import MCAP0_MAGIC

from duoglide.storage.records import LogKind
from duoglide.storage.walk import BROKEN, PREFIX

FORMAT = "1"
METADATA_NAME = "duoglide"
_LARGEST = 1024 * 1024  # bytes: no table of texts of ours comes near


def checksum(head: Mapping[str, str]) -> str:
    """Return the checksum of a log's metadata, which MCAP itself does not protect."""
    return str(zlib.crc32(json.dumps(dict(sorted(head.items()))).encode()))


def kind_of(file: Path) -> LogKind | None:
    """Tell from its head whether a file is a plan or a run of Duoglide, torn or not.

    Args:
        file: What to look at.

    Returns:
        What it is; None where it is anything else.

    Raises:
        OSError: It cannot be read.
    """
    with file.open("rb") as stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            return None
        try:
            while len(prefix := stream.read(PREFIX.size)) == PREFIX.size:
                opcode, length = PREFIX.unpack(prefix)
                if opcode == Opcode.METADATA and (kind := _kind(stream, length)) is not None:
                    return kind
                if opcode != Opcode.METADATA:
                    stream.seek(length, 1)
        except (*BROKEN, OSError):  # a length that no file has
            return None
    return None


def _kind(stream: IO[bytes], length: int) -> LogKind | None:
    """Read a table of texts, and return the kind that it names."""
    if length > _LARGEST:
        stream.seek(length, 1)
        return None
    table = Metadata.read(ReadDataStream(BytesIO(stream.read(length))))
    if table.name != METADATA_NAME:
        return None
    return LogKind(table.metadata.get("kind", ""))
