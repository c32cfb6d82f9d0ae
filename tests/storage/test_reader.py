from __future__ import annotations

import os
import random
import re
import struct
import warnings
from pathlib import Path

import pytest
from mcap.reader import make_reader

import duoglide as dg
from duoglide.storage import (
    ClockAnchor,
    CycleRecord,
    EventKind,
    LogKind,
    LogWarning,
    LogWriter,
    Topic,
    read_log,
)


def messages_of(file: Path) -> list[CycleRecord]:
    """What a reader gets, who may get less, but nothing wrong."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        log = read_log(file)
    return [record for _, record in log.records(Topic.CYCLE)]


def test_a_whole_log_gives_back_what_was_written(run_log: Path, cycles: list[CycleRecord]) -> None:
    log = read_log(run_log)
    assert (log.kind, log.missing) == (LogKind.RUN, "")
    assert log.metadata["eds_sha256"] == "abc"
    assert log.documents == {"machine": {"clearance": 2.0}, "report": {"worst": 0.1}}
    assert [record for _, record in log.records(Topic.CYCLE)] == cycles
    times = [t for t, _ in log.records(Topic.CYCLE)]
    assert times == pytest.approx([1234.5 + 0.002 * i for i in range(len(cycles))], abs=1e-9)
    [(_, event)] = log.records(Topic.EVENT)
    assert event.kind is EventKind.STARTED
    assert not list(log.records(Topic.MOTION))


def test_a_document_that_is_not_there_is_named(run_log: Path) -> None:
    with pytest.raises(dg.LogError, match=r"no trajectory document \(it holds: machine, report\)"):
        read_log(run_log).document("trajectory")


def test_every_truncation_opens_up_to_its_last_whole_record_or_is_refused(
    run_log: Path, cycles: list[CycleRecord], tmp_path: Path
) -> None:
    whole = run_log.read_bytes()
    torn = tmp_path / "torn.mcap"
    opened = refused = 0
    longest = 0
    for size in range(0, len(whole), 23):
        torn.write_bytes(whole[:size])
        try:
            got = messages_of(torn)
        except dg.LogError:
            refused += 1
            assert size < 600, "only a torn head may be refused"
            continue
        opened += 1
        assert got == cycles[: len(got)]
        assert len(got) >= longest, "a longer file never holds less"
        longest = len(got)
    assert longest == len(cycles)
    assert min(opened, refused) > 5


def test_flipped_bits_never_give_a_wrong_message(
    run_log: Path, cycles: list[CycleRecord], tmp_path: Path
) -> None:
    whole = run_log.read_bytes()
    file = tmp_path / "flipped.mcap"
    rng = random.Random(2)
    for _ in range(600):
        damaged = bytearray(whole)
        for _ in range(rng.choice((1, 1, 3, 40))):
            damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
        file.write_bytes(damaged)
        try:
            got = messages_of(file)
        except dg.LogError:
            continue
        assert got == cycles[: len(got)]


def test_rubbish_in_the_middle_ends_the_log_there(
    run_log: Path, cycles: list[CycleRecord], tmp_path: Path
) -> None:
    whole = run_log.read_bytes()
    file = tmp_path / "rubbish.mcap"
    rng = random.Random(3)
    for _ in range(300):
        cut = rng.randrange(700, len(whole))
        file.write_bytes(whole[:cut] + rng.randbytes(rng.randrange(1, 3000)) + whole[cut:])
        got = messages_of(file)
        assert got == cycles[: len(got)]


def test_a_record_that_claims_to_be_huge_is_not_believed(run_log: Path, tmp_path: Path) -> None:
    head = run_log.read_bytes()[:900]
    file = tmp_path / "huge.mcap"
    for length in (2**40, 2**64 - 1):
        for opcode in range(256):
            file.write_bytes(head + struct.pack("<BQ", opcode, length) + bytes(64))
            assert messages_of(file) == []


def missing(file: Path, content: bytes) -> str:
    """What a reader is told of a log with this content, the warning as well."""
    file.write_bytes(content)
    with pytest.warns(LogWarning) as told:
        log = read_log(file)
    assert [str(warning.message) for warning in told] == [f"{file}: {log.missing}"]
    return log.missing


def test_what_a_cut_log_has_lost_is_told_as_far_as_it_says_it(run_log: Path) -> None:
    whole = run_log.read_bytes()
    chunks = [match.start() - 9 - 32 for match in re.finditer(b"zstd", whole)][1:4]
    assert missing(run_log, whole[: chunks[2]]) == (
        "the log was not closed: 40 cycles and 1 events over 0.078 s are read; a writer that is"
        " killed loses the last second at most, a copy that is cut may lose more"
    )
    assert missing(run_log, whole[: chunks[2] + 100]) == (
        "the log is damaged (it ends within a record): 40 cycles and 1 events over 0.078 s are"
        " read; at least 0.040 s after that are lost"
    )
    assert missing(run_log, whole[: chunks[2] + 12]) == (
        "the log is damaged (it ends within a record): 40 cycles and 1 events over 0.078 s are"
        " read; how much came after that, nothing in it says"
    )
    spoilt = bytearray(whole)
    spoilt[chunks[1] + 100] ^= 1
    assert re.fullmatch(
        r"the log is damaged \(.*\): 20 cycles and 1 events over 0\.038 s are read;"
        r" 40 messages of the 0\.080 s after that are lost",
        missing(run_log, bytes(spoilt)),
    )
    assert re.fullmatch(
        r"the log is damaged \(.*\): 20 cycles and 1 events over 0\.038 s are read;"
        r" at least 0\.080 s after that are lost",
        missing(run_log, bytes(spoilt[:-300])),
    )


def test_a_damaged_head_is_refused(run_log: Path) -> None:
    whole = run_log.read_bytes()
    run_log.write_bytes(whole.replace(b"1700000000000000000", b"1700000000000000001", 1))
    with pytest.raises(dg.LogError, match="checksum"):
        read_log(run_log)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "is empty"),
        (b"not a log at all, just text", "not a log"),
        (b"\x89MCAP0\r\n", "head of the log cannot be read"),
    ],
)
def test_what_is_not_a_log_is_refused(tmp_path: Path, content: bytes, why: str) -> None:
    file = tmp_path / "file.mcap"
    file.write_bytes(content)
    with pytest.raises(dg.LogError, match=why):
        read_log(file)


def test_a_missing_file_and_a_directory_are_refused(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)  # whoever opened it would wait for ever
    for file in (tmp_path / "none.mcap", tmp_path, pipe, Path("/dev/zero"), Path("a\0b")):
        with pytest.raises(dg.LogError, match="cannot read"):
            read_log(file)


def test_a_file_that_vanishes_after_opening_is_an_error_not_a_crash(run_log: Path) -> None:
    log = read_log(run_log)
    run_log.unlink()
    with pytest.raises(dg.LogError, match="cannot read"):
        list(log.records(Topic.CYCLE))


def test_the_plain_mcap_package_reads_a_whole_log(run_log: Path, cycles: list[CycleRecord]) -> None:
    with run_log.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        messages = list(reader.iter_messages(topics=["/cycle"]))
        documents = [attachment.name for attachment in reader.iter_attachments()]
        summary = reader.get_summary()
    assert documents == ["machine", "report"]
    assert len(messages) == len(cycles)
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(cycles) + 1
    schema, channel, message = messages[3]
    assert schema is not None
    assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
    assert message.data == cycles[3].to_json()


def test_times_survive_to_the_nanosecond() -> None:
    anchor = ClockAnchor(987654.321, 1_800_000_000_123_456_789)
    for t in (987654.321, 987655.0, 1087654.3210004):
        assert anchor.time(anchor.stamp(t)) == pytest.approx(t, abs=1e-9)


def test_a_plan_has_its_own_time(tmp_path: Path) -> None:
    file = tmp_path / "plan.mcap"
    with LogWriter(file, LogKind.PLAN) as log:
        log.attach("trajectory", {"duration": 0.1 + 0.2})
    opened = read_log(file)
    assert (opened.kind, opened.anchor.monotonic) == (LogKind.PLAN, 0.0)
    assert opened.documents["trajectory"]["duration"] == 0.1 + 0.2
