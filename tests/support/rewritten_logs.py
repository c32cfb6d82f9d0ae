"""What standard MCAP tools make of a file: its records once more, put together otherwise."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

PLAIN: dict[str, Any] = {"compression": CompressionType.NONE}
BARE: dict[str, Any] = {
    "index_types": IndexType.NONE,
    "repeat_channels": False,
    "repeat_schemas": False,
    "use_statistics": False,
    "use_summary_offsets": False,
    "enable_crcs": False,
}
WAYS: dict[str, dict[str, Any]] = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "uncompressed": PLAIN,
    "unchunked": {"use_chunking": False},
    "in small chunks": {"chunk_size": 700},
    "in one chunk": {"chunk_size": 2**30},
    "with nothing that is optional": {**BARE, **PLAIN},
    "unchunked, with nothing that is optional": {**BARE, "use_chunking": False},
    "with a checksum of its data": {"enable_data_crcs": True},
    "lz4 without checksums": {"compression": CompressionType.LZ4, "enable_crcs": False},
}


def rewrite(
    source: Path,
    goal: Path,
    way: dict[str, Any],
    keep: Callable[[Message, str], bool] = lambda message, topic: True,
    *,
    change: Callable[[Message, str], Message] = lambda message, topic: message,
    text: Callable[[str, bytes], bytes] = lambda name, data: data,
    documents: bool = True,
    last: bool = True,
    order: Callable[[list[Message]], Iterable[Message]] = iter,
) -> Path:
    """Write a file once more with the writer of the ``mcap`` package.

    Args:
        source: What to read.
        goal: What to write.
        way: Arguments of the writer.
        keep: Which messages to keep.
        change: What to make of each message.
        text: What to make of each document, by its name.
        documents: Whether metadata and attachments come along.
        last: Whether they come after the messages.
        order: In which order the messages come.
    """
    with source.open("rb") as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
    channels = {record.id: record for record in records if isinstance(record, Channel)}
    schemas = {record.id: record for record in records if isinstance(record, Schema)}
    messages = [record for record in records if isinstance(record, Message)]
    with goal.open("wb") as stream:
        writer = Writer(stream, **way)
        writer.start("", "a standard tool")
        if not last:
            _add_documents(writer, records if documents else [], text)
        numbers: dict[int, int] = {}
        for message in order(messages):
            channel = channels[message.channel_id]
            if keep(message, channel.topic):
                if channel.id not in numbers:
                    schema = schemas[channel.schema_id]
                    number = writer.register_schema(schema.name, schema.encoding, schema.data)
                    numbers[channel.id] = writer.register_channel(channel.topic, "json", number)
                changed = change(message, channel.topic)
                writer.add_message(
                    numbers[channel.id],
                    changed.log_time,
                    changed.data,
                    changed.publish_time,
                    changed.sequence,
                )
        if last:
            _add_documents(writer, records if documents else [], text)
        writer.finish()
    return goal


def _add_documents(
    writer: Writer, records: Iterable[object], text: Callable[[str, bytes], bytes]
) -> None:
    for record in records:
        if isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Attachment):
            writer.add_attachment(
                record.create_time,
                record.log_time,
                record.name,
                record.media_type,
                text(record.name, record.data),
            )
