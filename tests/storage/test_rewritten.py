"""Logs as standard MCAP tools, other people and ill will leave them."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.records import Message
from mcap.writer import CompressionType, Writer
from rewritten_logs import WAYS, rewrite

import duoglide as dg
from duoglide.storage import CycleRecord, Log, LogKind, LogWarning, LogWriter, Topic, read_log
from duoglide.storage.head import METADATA_NAME, checksum


def cycles_of(log: Log) -> list[CycleRecord]:
    return [record for _, record in log.records(Topic.CYCLE)]


@pytest.mark.parametrize("last", [True, False])
@pytest.mark.parametrize("way", WAYS)
def test_a_log_that_was_rewritten_is_the_same(
    way: str, last: bool, run_log: Path, cycles: list[CycleRecord], tmp_path: Path
) -> None:
    original = read_log(run_log)
    log = read_log(rewrite(run_log, tmp_path / "again.mcap", WAYS[way], last=last))
    assert (log.kind, log.missing, log.anchor) == (LogKind.RUN, "", original.anchor)
    assert (log.metadata, log.documents) == (original.metadata, original.documents)
    assert cycles_of(log) == cycles
    for topic in Topic:
        assert list(log.records(topic)) == list(original.records(topic))


def test_what_a_filter_has_taken_is_told(
    run_log: Path, cycles: list[CycleRecord], tmp_path: Path
) -> None:
    file = tmp_path / "filtered.mcap"
    rewrite(run_log, file, {}, keep=lambda message, topic: topic == "/cycle")
    with pytest.warns(LogWarning, match="1 of 61 messages have been filtered out or lost"):
        assert cycles_of(read_log(file)) == cycles
    rewrite(run_log, file, {}, keep=lambda message, topic: not 20 <= message.sequence < 30)
    with pytest.warns(LogWarning, match="10 of 61 messages have been"):
        log = read_log(file)
    assert cycles_of(log) == cycles[:18] + cycles[28:]
    rewrite(run_log, file, {}, documents=False)
    with pytest.raises(
        dg.LogError, match=r"head of the log is not in it; a standard tool .*--incl"
    ):
        read_log(file)


@pytest.mark.parametrize(
    ("keep", "missing"),
    [
        (range(41), "20 of 60 cycles have been filtered out or lost"),
        (range(20, 41), "39 of 60 cycles have been filtered out or lost"),
        (range(0), "60 of 60 cycles have been filtered out or lost"),
        (range(2, 61), "1 of 60 cycles have been filtered out or lost"),
        (range(61), ""),
    ],
)
def test_cycles_that_were_cut_off_the_end_are_told(
    keep: range, missing: str, run_log: Path, cycles: list[CycleRecord], tmp_path: Path
) -> None:
    original = read_log(run_log)
    whole = tmp_path / "whole.mcap"
    with LogWriter(whole, LogKind.RUN, {}, original.anchor) as log:
        for number, record in enumerate(cycles):
            log.write(Topic.CYCLE, original.anchor.monotonic + 0.002 * number, record)
        log.attach("report", {"cycles": len(cycles)})
    assert read_log(whole).missing == ""
    file = tmp_path / "cut.mcap"
    rewrite(whole, file, {}, keep=lambda message, topic: message.sequence in keep)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        assert read_log(file).missing == missing


def test_messages_that_nobody_has_numbered_are_not_missed(
    run_log: Path, cycles: list[CycleRecord], tmp_path: Path
) -> None:
    file = tmp_path / "unnumbered.mcap"
    rewrite(run_log, file, {}, change=lambda message, topic: replace(message, sequence=0))
    log = read_log(file)
    assert log.missing == ""
    assert cycles_of(log) == cycles


@pytest.mark.parametrize(
    "order", [lambda messages: messages[::-1], lambda messages: messages + messages]
)
def test_times_that_run_backwards_are_refused(
    order: Callable[[list[Message]], Iterable[Message]], run_log: Path, tmp_path: Path
) -> None:
    log = read_log(rewrite(run_log, tmp_path / "again.mcap", {}, order=order))
    with pytest.raises(dg.LogError, match=r"message \d+ of /cycle is 0\.\d+ s before the one"):
        cycles_of(log)


def test_a_foreign_mcap_is_called_that_with_its_writer(tmp_path: Path) -> None:
    file = tmp_path / "bag.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "libmcap 0.8.0\x1b[31m")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        number = writer.register_channel("/chatter", "cdr", schema)
        writer.add_message(number, 5, b"\x00\x01\x00\x00", 5)
        writer.add_metadata("rosbag2", {"format": "1"})
        writer.finish()
    words = r"bag\.mcap is not a Duoglide log; it is MCAP written by libmcap 0\.8\.0\?\[31m$"
    with pytest.raises(dg.LogError, match=words):
        read_log(file)


def test_a_log_with_more_in_it_than_ours_opens(
    run_log: Path, cycles: list[CycleRecord], tmp_path: Path
) -> None:
    file = tmp_path / "more.mcap"
    log = read_log(run_log)
    head = {**log.metadata, "crc32": checksum(log.metadata)}
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("", "somebody")
        writer.add_metadata("notes", {"by": "the night shift"})
        writer.add_metadata(METADATA_NAME, head)
        writer.add_attachment(0, 0, "photo.jpg", "image/jpeg", b"\xff\xd8\xff")
        writer.add_attachment(0, 0, "notes", "application/json", b"{not json")
        writer.add_attachment(0, 0, "machine", "", json.dumps(log.documents["machine"]).encode())
        spoken = writer.register_channel("/spoken", "protobuf", 0)
        number = writer.register_channel("/cycle", "json", 0)
        for record in cycles:
            writer.add_message(spoken, 0, b"\x08\x01", 0, record.cycle)
            writer.add_message(number, record.cycle, record.to_json(), 0, record.cycle + 1)
        writer.finish()
    opened = read_log(file)
    assert opened.documents == {"machine": log.documents["machine"]}
    assert cycles_of(opened) == cycles


def two_heads(writer: Writer, head: dict[str, str]) -> None:
    other = {**head, "bus": "another"}
    del other["crc32"]
    writer.add_metadata(METADATA_NAME, {**other, "crc32": checksum(other)})


def two_machines(writer: Writer, head: dict[str, str]) -> None:
    writer.add_attachment(0, 0, "machine", "", b'{"clearance": 2}')
    writer.add_attachment(0, 0, "machine", "", b'{"clearance": 3}')


def document(text: bytes) -> Callable[[Writer, dict[str, str]], None]:
    return lambda writer, head: writer.add_attachment(0, 0, "machine", "", text)


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (two_heads, "two logs in one"),
        (two_machines, "two machine documents, and they differ"),
        (document(b'{"a": NaN}'), "machine document cannot be read: NaN is no number"),
        (document(b'{"a": 1, "a": 2}'), "the key 'a' is there twice"),
        (document(b"[" * 100_000), "machine document cannot be read: maximum recursion"),
        (document(b"\xff"), "machine document cannot be read"),
        (document(b'{"a": ' + b"9" * 5000 + b"}"), "machine document cannot be read: Exceeds"),
    ],
)
def test_documents_that_say_two_things_or_none_are_refused_whole(
    spoil: Callable[[Writer, dict[str, str]], None], why: str, run_log: Path, tmp_path: Path
) -> None:
    file = tmp_path / "spoilt.mcap"
    log = read_log(run_log)
    head = {**log.metadata, "crc32": checksum(log.metadata)}
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("", "somebody")
        writer.add_metadata(METADATA_NAME, head)
        spoil(writer, head)
        writer.finish()
    with pytest.raises(dg.LogError, match=f"spoilt.mcap: it.*{why}"):
        read_log(file)


GOOD = json.loads(CycleRecord(7, 2, 0.1, 1.0, *[(1, 2, 3)] * 4).to_json())  # type: ignore[arg-type]


def with_(**fields: Any) -> bytes:
    return json.dumps({**GOOD, **fields}).encode()


def raw(name: str, text: str) -> bytes:
    """Return a cycle with a field that Python would not write."""
    fields = [f'"{key}":{text if key == name else json.dumps(GOOD[key])}' for key in GOOD]
    return ("{" + ",".join(fields) + "}").encode()


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (raw("lateness", "1e999"), "lateness = inf: must be a whole number"),
        (raw("lateness", "1.0"), "lateness = 1.0: must be a whole number"),
        (raw("rate", "NaN"), "NaN is no number"),
        (raw("path_time", "-Infinity"), "-Infinity is no number"),
        (raw("path_time", "1e400"), "path_time = inf: must be a finite number"),
        (raw("path_time", "1e308"), "path_time = 1e.308: must be a finite number, from"),
        (raw("rate", "1e308"), "rate = 1e.308: must be a finite number, from -0.001 to 1.001"),
        (with_(rate=-1), "rate = -1: must be"),
        (with_(path_time=-1.0), "path_time = -1.0: must be"),
        (raw("cycle", "9" * 30), "cycle = 999999.*: must be a whole number from 0"),
        (raw("cycle", "9" * 5000), "Exceeds the limit"),
        (raw("setpoint", "[" * 50_000), "recursion"),
        (raw("setpoint", f"[1,2,{2**31}]"), "setpoint = .*: must be three whole numbers"),
        (with_(setpoint=[1, 2]), "setpoint = .*: must be three whole numbers"),
        (with_(setpoint=[1, 2, True]), "setpoint = .*: must be three whole numbers"),
        (with_(actual={"0": 1}), "actual = .*: must be three whole numbers"),
        (with_(statusword=[0, 0, -1]), "statusword = .*from 0 to 65535"),
        (with_(phase=4), "phase = 4"),
        (with_(phase="program"), "phase = 'program'"),
        (with_(missing=8), "missing = 8: must be a whole number from 0 to 7"),
        (with_(cycle=-1), "cycle = -1"),
        (with_(lateness=True), "lateness = True"),
        (with_(cycle=None), "cycle = None"),
        (with_(rate="1"), "rate = '1': must be a finite number"),
        (b'{"cycle": 7}', "has no 'phase'"),
        (b"[1, 2]", "cannot be read"),
        (b"7", "cannot be read"),
        (b"", "cannot be read"),
        (b"\xff\xfe", "cannot be read"),
        (b'{"cycle": 1, "cycle": 2}', "the key 'cycle' is there twice"),
    ],
)
def test_a_cycle_that_is_none_is_refused_by_its_number(
    content: bytes, why: str, run_log: Path, tmp_path: Path
) -> None:
    def spoil(message: Message, topic: str) -> Message:
        wrong = topic == "/cycle" and message.sequence == 20
        return replace(message, data=content) if wrong else message

    log = read_log(rewrite(run_log, tmp_path / "wrong.mcap", {}, change=spoil))
    with pytest.raises(dg.LogError, match=rf"wrong\.mcap: message 18 of /cycle .*{why}") as refused:
        cycles_of(log)
    assert len(str(refused.value)) < 350


def test_a_flipped_bit_in_data_that_nothing_else_protects_is_found(
    run_log: Path, tmp_path: Path
) -> None:
    file = tmp_path / "checked.mcap"
    rewrite(run_log, file, {"use_chunking": False, "enable_data_crcs": True})
    whole = file.read_bytes()
    at = whole.index(b'"cycle":7,') + 8
    file.write_bytes(whole[:at] + b"8" + whole[at + 1 :])
    with pytest.raises(dg.LogError, match="damaged, and nothing says where"):
        read_log(file)


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_chunk_that_grows_without_end_is_not_unpacked(
    compression: CompressionType, run_log: Path, tmp_path: Path
) -> None:
    def swell(message: Message, topic: str) -> Message:
        return replace(message, data=bytes(80_000_000)) if message.sequence == 40 else message

    file = tmp_path / "bomb.mcap"
    rewrite(
        run_log, file, {"compression": compression, "chunk_size": 500}, change=swell, last=False
    )
    assert file.stat().st_size < 500_000
    with pytest.warns(LogWarning, match=r"damaged \(a chunk of 80000\d\d\d bytes\): 37 cycles"):
        log = read_log(file)
    assert len(cycles_of(log)) == 37


def test_a_chunk_that_lies_about_its_size_is_not_unpacked_further(
    run_log: Path, tmp_path: Path
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        for compression in ("zstd", "lz4", ""):
            file = tmp_path / "lies.mcap"
            ways = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4}
            way = {"compression": ways.get(compression, CompressionType.NONE), "enable_crcs": False}
            rewrite(run_log, file, way, last=False)
            whole = bytearray(file.read_bytes())
            chunk = whole.index(b"\x06", whole.index(b'"worst": 0.1'))
            for size in (0, 1, 1000, 2**40):
                whole[chunk + 25 : chunk + 33] = size.to_bytes(8, "little")
                file.write_bytes(whole)
                assert "no whole message" in read_log(file).missing
