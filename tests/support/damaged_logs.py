"""Damaged logs by the thousand, and what a reader may do with them: read, or refuse with our error.

Mutations get past the checksums: what is spoilt inside of a chunk, a document or the head is put
together again with the sums that belong to it.
"""

from __future__ import annotations

import io
import json
import random
import struct
import warnings
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import can
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

import duoglide as dg
from duoglide.control.channel.scale import Scales
from duoglide.playback.can_log import read_frames
from duoglide.playback.columns import columns_of
from duoglide.playback.compare import compare
from duoglide.playback.rebuild import rebuild
from duoglide.playback.replay import prepare
from duoglide.playback.summary import summarise
from duoglide.storage import (
    CycleRecord,
    EventKind,
    EventRecord,
    LogKind,
    LogWarning,
    LogWriter,
    Phase,
    Topic,
    read_log,
)
from duoglide.storage.head import METADATA_NAME, checksum

JUNK: tuple[Any, ...] = (
    None, True, -1, 0, 1, 3, 0.5, 1e308, -1e308, 1e-320, "x", "", [], {}, [1, 2], [1, 2, 3],
    [1, [2], 3], [[1, 2], [3, 4]], {"a": 1}, 2**31, 2**63, 2**64, 2**70, 10**30, 65536, "1e999",
)  # fmt: skip
TEXTS = (
    b"NaN", b"-Infinity", b"1e999", b"-1e999", b"9" * 30, b"9" * 5000, b"[" * 3000, b'{"a":' * 3000,
    b'"\xff"', b'"\\ud800"', b"", b"-0", b"1.0", b"true", b"null", b"[1,2,3]", b'{"a":1,"a":2}',
)  # fmt: skip
BYTES = (
    b"\0", b"\xff", b"\x7f\xff\xff\xff", b"\xff" * 8, b"\0" * 8, b"\x89MCAP0\r\n", b"LOBJ",
    b"#", b"##", b"R", b"x", b" ", b"\n", b"-", b".", b"_", b"(", b")", b"1e999", b"0x", b"LOGG",
    b"nan", b"inf", b"9" * 40, b";$FILEVERSION=2.1\n", b";$COLUMNS=N,O,T,I,d,L,D\n", b"base dec",
    b"timestamps relative", b"CANFD", b"ErrorFrame", b"RTR", b"Rx", b"Tx", "\u0663".encode(), b"\r",
)  # fmt: skip


def a_run(file: Path) -> Path:
    """Write a short run with its plan, as a streamer would."""
    machine = dg.Machine.default()
    plan = dg.transfer(machine, (-41.0, 0.0, 300.0), (-41.0, 30.0, 300.0))
    scales, cycle = Scales.of(machine.drives), machine.drives.cycle
    with LogWriter(file, LogKind.RUN, {"bus": "none"}) as log:
        log.attach("machine", machine.to_dict())
        log.attach("trajectory", plan.to_document())
        log.write(Topic.EVENT, 50.0, EventRecord(EventKind.STARTED, "program started"))
        for n in range(int(plan.duration / cycle) + 6):
            u = min(n * cycle, plan.duration)
            moving = 0 < n <= plan.duration / cycle
            setpoint = scales.triple(plan.at(u).carriages)
            phase = Phase.PROGRAM if moving else Phase.HOLD
            record = CycleRecord(
                n, phase, u, float(moving), setpoint, setpoint, (31,) * 3, (5687,) * 3
            )
            log.write(Topic.CYCLE, 50.0 + n * cycle, record)
        log.write(Topic.EVENT, 52.0, EventRecord(EventKind.EMERGENCY, "oh", 2, 0x8611))
    return file


def a_plan(file: Path) -> Path:
    """Write a plan."""
    machine = dg.Machine.default()
    dg.transfer(machine, (-41.0, 0.0, 300.0), (-41.0, 30.0, 300.0)).save(file)
    return file


def spoilt(content: bytes, noise: random.Random, strength: int = 4) -> bytes:
    """Return some bytes with a few of them changed, gone, repeated or put in."""
    data = bytearray(content)
    for _ in range(noise.randint(1, strength)):
        at = noise.randrange(len(data) + 1)
        length = noise.choice((1, 1, 2, 4, 8, 40))
        match noise.randrange(6):
            case 0:
                data[at : at + 1] = bytes([noise.randrange(256)])
            case 1:
                del data[at : at + length]
            case 2:
                data[at:at] = data[at : at + length]
            case 3:
                data[at : at + length] = noise.choice(BYTES)
            case 4:
                data[at:at] = noise.choice(BYTES)
            case _:
                number = noise.choice((0, 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1))
                data[at : at + 8] = struct.pack("<Q", number)
    return bytes(data)


def spoilt_value(value: Any, noise: random.Random) -> Any:
    """Return a JSON value with one value inside of it gone or another."""
    if isinstance(value, dict) and value and noise.random() < 0.9:
        key = noise.choice(list(value))
        if noise.random() < 0.15:
            return {name: item for name, item in value.items() if name != key}
        return {**value, key: spoilt_value(value[key], noise)}
    if isinstance(value, list) and value and noise.random() < 0.8:
        at = noise.randrange(len(value))
        return [*value[:at], spoilt_value(value[at], noise), *value[at + 1 :]]
    if isinstance(value, float | int) and noise.random() < 0.5:
        return value * noise.choice((-1, 2, 1.0000001, 1e3, 1e9, 0.999)) + noise.choice((0, 0, 1))
    return noise.choice(JUNK)


def spoilt_json(text: bytes, noise: random.Random) -> bytes:
    """Return a JSON text with something wrong in it."""
    match noise.randrange(4):
        case 0:
            return spoilt(text, noise)
        case 1:
            places = [at for at, byte in enumerate(text) if byte in b":,["]
            at = noise.choice(places) + 1 if places else 0
            end = min((text.find(c, at) % (len(text) + 1) for c in (b",", b"}", b"]")), default=at)
            return text[:at] + noise.choice(TEXTS) + text[end:]
        case _:
            return json.dumps(spoilt_value(json.loads(text), noise)).encode()


@dataclass
class McapInputs:
    """Makes spoilt files of a whole one.

    Attributes:
        whole: A log.
    """

    whole: bytes
    records: list[Any] = field(init=False)

    def __post_init__(self) -> None:
        self.records = list(StreamReader(io.BytesIO(self.whole)).records)

    def draw(self, noise: random.Random) -> bytes:
        """Return the next file."""
        if noise.random() < 0.2:
            return spoilt(self.whole, noise)
        if noise.random() < 0.25:
            return self._with_spoilt_chunk(noise)
        return self._written_again(noise)

    def _written_again(self, noise: random.Random) -> bytes:
        """Spoil one message, document or head, and put the file together again."""
        kinds = [Message, Message, Attachment, Metadata]
        kind = noise.choice(kinds)
        victim = noise.choice([record for record in self.records if isinstance(record, kind)])
        stream = io.BytesIO()
        compression = noise.choice(list(CompressionType))
        writer = Writer(
            stream,
            chunk_size=noise.choice((200, 5000, 10**6)),
            compression=compression,
            use_chunking=noise.random() < 0.8,
            enable_crcs=noise.random() < 0.8,
            enable_data_crcs=noise.random() < 0.2,
        )
        writer.start("", "fuzz")
        for record in self.records:
            self._write(writer, record, noise if record is victim else None)
        if noise.random() < 0.8:
            writer.finish()
        else:
            writer.flush()
        return stream.getvalue()

    def _write(self, writer: Writer, record: Any, noise: random.Random | None) -> None:
        if isinstance(record, Schema):
            writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel):
            writer.register_channel(record.topic, record.message_encoding, record.schema_id)
        elif isinstance(record, Metadata):
            table = dict(record.metadata)
            if noise is not None:
                key = noise.choice(list(table))
                table[key] = spoilt(table[key].encode(), noise).decode("utf-8", "replace")
                if noise.random() < 0.8:
                    del table[noise.choice(("crc32", "crc32", key))]
                    table.pop("crc32", None)
                    table["crc32"] = checksum(table)
            writer.add_metadata(record.name, table)
        elif isinstance(record, Attachment):
            data = record.data if noise is None else spoilt_json(record.data, noise)
            writer.add_attachment(0, 0, record.name, record.media_type, data)
        elif isinstance(record, Message):
            data, stamp, sequence = record.data, record.log_time, record.sequence
            if noise is not None:
                data = spoilt_json(data, noise)
                if noise.random() < 0.2:
                    stamp = noise.choice((0, 1, 2**63, 2**64 - 1, stamp - 10**9, stamp + 10**18))
                    sequence = noise.choice((0, 1, 2**32 - 1, sequence))
            writer.add_message(record.channel_id, stamp, data, stamp, sequence)

    def _with_spoilt_chunk(self, noise: random.Random) -> bytes:
        """Spoil the records of a chunk, and give the chunk the checksum that they have now."""
        chunks = list(StreamReader(io.BytesIO(self.whole), emit_chunks=True).records)
        stream = io.BytesIO()
        writer = Writer(stream, use_chunking=False)
        writer.start("", "fuzz")
        head = next(r for r in chunks if isinstance(r, Metadata) and r.name == METADATA_NAME)
        writer.add_metadata(head.name, head.metadata)
        for record in chunks:
            if isinstance(record, Attachment):
                writer.add_attachment(0, 0, record.name, record.media_type, record.data)
        for record in chunks:
            if type(record).__name__ == "Chunk":
                content = _content(record)
                if noise.random() < 0.7:
                    content = spoilt(content, noise)
                body = struct.pack(
                    "<QQQII",
                    0,
                    2**62,
                    len(content),
                    zlib.crc32(content) * (noise.random() < 0.7),
                    0,
                )
                body += struct.pack("<Q", len(content)) + content
                stream.write(struct.pack("<BQ", 6, len(body)) + body)
        writer.finish()
        return stream.getvalue()


def _content(chunk: Any) -> bytes:
    import zstandard

    content: bytes = zstandard.decompress(chunk.data, chunk.uncompressed_size)
    return content


def read_everything(file: Path, noise: random.Random) -> str:
    """Do with a log what the library can do with one; return what became of it.

    Raises:
        Exception: Anything but an error of ours is a fault.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        warnings.simplefilter("ignore", RuntimeWarning)  # of numbers that no motion has
        try:
            log = read_log(file)
            for topic in Topic:
                for _ in log.records(topic):
                    pass
            summarise(log)
            columns_of(log)
            if log.kind is LogKind.PLAN:
                dg.Trajectory.load(file)
            else:
                rebuild(log)
                if noise.random() < 0.05:
                    compare(log, log)
                    prepare(file)
        except dg.DuoglideError as error:
            assert 5 < len(str(error)) < 1500, error
            assert str(error).isprintable(), error
            return type(error).__name__
    return "read"


def frame_logs(folder: Path) -> dict[str, bytes]:
    """Return a whole log of frames of every kind, by its suffix."""
    whole = {}
    writers = {
        ".log": can.CanutilsLogWriter, ".asc": can.ASCWriter, ".blf": can.BLFWriter,
        ".trc": can.TRCWriter,
    }  # fmt: skip
    for suffix, kind in writers.items():
        file = folder / f"whole{suffix}"
        with kind(file) as writer:
            for n in range(12):
                writer.on_message_received(
                    can.Message(
                        timestamp=1.7e9 + 0.001 * n,
                        arbitration_id=0x181 + n if n % 4 else 0x12345678,
                        is_extended_id=n % 4 == 0,
                        is_error_frame=n == 7 and suffix != ".trc",
                        data=bytes(range(n % 9)),
                        channel="can0",
                    )
                )
        whole[suffix] = file.read_bytes()
    return whole


def spoilt_frames(suffix: str, whole: bytes, noise: random.Random) -> bytes:
    """Return a log of frames with something wrong in it; a BLF is packed again."""
    if suffix != ".blf" or noise.random() < 0.3:
        return spoilt(whole, noise)
    start = struct.unpack_from("<L", whole, 4)[0]
    length = struct.unpack_from("<L", whole, start + 8)[0]
    content = spoilt(zlib.decompress(whole[start + 32 : start + length]), noise)
    packed = zlib.compress(content)
    size = noise.choice((len(content),) * 9 + (0,))
    body = struct.pack("<H6xL4x", 2, size) + packed
    item = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 16 + len(body), 10) + body
    item += bytes(len(item) % 4)
    total = noise.choice((0, start + len(item)))
    return whole[:16] + struct.pack("<Q", total) + whole[24:start] + item


def read_all_frames(file: Path) -> str:
    """Read a log of frames; return what became of it."""
    try:
        frames = read_frames(file)
    except dg.DuoglideError as error:
        assert 5 < len(str(error)) < 700, error
        assert str(error).isprintable(), error
        return type(error).__name__
    for frame in frames:
        assert 0 <= frame.can_id <= (0x1FFFFFFF if frame.extended else 0x7FF)
        assert len(frame.data) <= 8
    return "read"


Draw = Callable[[random.Random], bytes]
