from __future__ import annotations

import math
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.exceptions import McapError
from mcap.records import Attachment, Message
from mcap.stream_reader import StreamReader

import duoglide as dg
from duoglide.storage import (
    CycleRecord,
    EventKind,
    EventRecord,
    LogKind,
    LogWarning,
    LogWriter,
    Topic,
    read_log,
)
from duoglide.storage.atomic import appearing

KILLED = """
import sys, time
from duoglide.storage import CycleRecord, LogKind, LogWriter, Phase, Topic
with LogWriter(sys.argv[1], LogKind.RUN) as log:
    log.attach("machine", {"clearance": 2.0})
    begin = time.monotonic()
    for n in range(100_000):
        three = (n, n, n)
        log.write(Topic.CYCLE, time.monotonic(),
                  CycleRecord(n, Phase.PROGRAM, n * 0.002, 1.0, three, three, three, three))
        print(time.monotonic(), flush=True)
        time.sleep(max(0.0, begin + 0.002 * n - time.monotonic()))
"""


def names(folder: Path) -> list[str]:
    return [file.name for file in folder.iterdir()]


def an_event() -> EventRecord:
    return EventRecord(EventKind.NOTE, "something")


def an_old_log(file: Path, kind: LogKind) -> bytes:
    """Write a log that says it is of yesterday, and return its bytes."""
    with LogWriter(file, kind, {"of": "yesterday"}) as log:
        log.write(Topic.EVENT, 0.0, an_event())
    return file.read_bytes()


def test_a_killed_writer_loses_at_most_a_second(tmp_path: Path) -> None:
    file = tmp_path / "killed.mcap"
    writer = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(file)], stdout=subprocess.PIPE, text=True
    )
    assert writer.stdout is not None
    with writer, writer.stdout:
        lines = [writer.stdout.readline() for _ in range(900)]
        writer.send_signal(signal.SIGKILL)
        lines += writer.stdout
    written = [float(line) for line in lines if line.endswith("\n")]
    with pytest.warns(LogWarning, match="was not closed"):
        log = read_log(file)
    records = list(log.records(Topic.CYCLE))
    assert [record.cycle for _, record in records] == list(range(len(records)))
    assert written[-1] - records[-1][0] < 1.0  # by its own clock, however busy the computer is
    assert log.documents["machine"] == {"clearance": 2.0}

    kinds = [type(record) for record in plain_records(file)]
    assert kinds.count(Message) == len(records)
    assert kinds.count(Attachment) == 1


def plain_records(file: Path) -> list[object]:
    """What the mcap package reads of a log before it comes upon the missing end."""
    found: list[object] = []
    with file.open("rb") as stream:
        try:
            found.extend(StreamReader(stream).records)
        except McapError:  # extend keeps what came before
            return found
    raise AssertionError("the file is whole")


def test_a_plan_appears_only_when_it_is_complete(tmp_path: Path) -> None:
    file = tmp_path / "plan.mcap"
    old = an_old_log(file, LogKind.PLAN)
    with LogWriter(file, LogKind.PLAN) as log:
        log.attach("trajectory", {})
        log.write(Topic.EVENT, 0.0, an_event())
        log.flush()
        assert file.read_bytes() == old
    assert "of" not in read_log(file).metadata
    assert names(tmp_path) == ["plan.mcap"]


@pytest.mark.parametrize("kind", list(LogKind))
def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path, kind: LogKind) -> None:
    file = tmp_path / "log.mcap"
    old = an_old_log(file, kind)
    with pytest.raises(RuntimeError, match="on purpose"), LogWriter(file, kind) as log:
        log.attach("machine", {})
        raise RuntimeError("on purpose")
    assert file.read_bytes() == old
    assert names(tmp_path) == ["log.mcap"]


def test_a_run_that_fails_on_the_way_is_kept_and_whole(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with pytest.raises(RuntimeError), LogWriter(file, LogKind.RUN) as log:
        log.write(Topic.EVENT, time.monotonic(), an_event())
        assert file.exists(), "a run is on disk from its first message"
        raise RuntimeError("on purpose")
    assert read_log(file).missing == ""
    assert names(tmp_path) == ["run.mcap"]


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with (
        pytest.raises(dg.LogError, match="cannot write"),
        LogWriter(tmp_path / "no" / "such.mcap", LogKind.RUN),
    ):
        pass


def test_a_device_is_refused_and_stays_one(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    link = tmp_path / "link"
    link.symlink_to(pipe)
    for place in (pipe, link):
        with pytest.raises(dg.LogError, match="device"), LogWriter(place, LogKind.RUN):
            pass
        with pytest.raises(dg.LogError, match="device"), appearing(place):
            pass
    assert pipe.is_fifo()
    assert link.is_symlink()


def test_a_link_stays_and_its_file_is_written(tmp_path: Path) -> None:
    file, link = tmp_path / "folder" / "run.mcap", tmp_path / "run.mcap"
    file.parent.mkdir()
    link.symlink_to(file)
    with LogWriter(link, LogKind.RUN) as log:
        log.write(Topic.EVENT, time.monotonic(), an_event())
    assert link.is_symlink()
    assert read_log(file).missing == ""


def test_a_disk_that_fills_up_is_told_and_what_is_written_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, hard))
    try:
        with (
            pytest.raises(dg.LogError, match=r"cannot write .*run\.mcap: File too large"),
            LogWriter(file, LogKind.RUN) as log,
        ):
            for n in range(100_000):
                log.write(Topic.CYCLE, 0.002 * n, moving(n))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    with pytest.warns(LogWarning, match=r"\d+ cycles over .* s are read"):
        records = [record for _, record in read_log(file).records(Topic.CYCLE)]
    assert len(records) > 200
    assert records == [moving(n) for n in range(len(records))]


@pytest.mark.parametrize("bad", [float("nan"), {1, 2}])
def test_a_document_that_is_no_json_is_refused(tmp_path: Path, bad: object) -> None:
    with (
        pytest.raises(dg.LogError, match="document machine"),
        LogWriter(tmp_path / "x.mcap", LogKind.PLAN) as log,
    ):
        log.attach("machine", {"value": bad})
    assert names(tmp_path) == []


def test_a_log_at_500_hz_stays_under_150_mb_an_hour(tmp_path: Path) -> None:
    file = tmp_path / "size.mcap"
    count = 5000
    with LogWriter(file, LogKind.RUN) as log:
        for n in range(count):
            log.write(Topic.CYCLE, 0.002 * n, moving(n))
    assert file.stat().st_size / (count * 0.002) * 3600 < 150e6


def moving(n: int) -> CycleRecord:
    """A carriage that swings 300 mm, with a little noise in what is measured."""
    setpoint = [round(300e3 * math.sin(0.025 * n + axis)) for axis in range(3)]
    noise = [(n * 7919 * (axis + 1)) % 173 - 86 for axis in range(3)]
    actual = [s + e for s, e in zip(setpoint, noise, strict=True)]
    return CycleRecord.from_json(
        {
            "cycle": n,
            "phase": 2,
            "path_time": n * 0.002 % 0.5,
            "rate": 1.0,
            "setpoint": setpoint,
            "actual": actual,
            "controlword": [31] * 3,
            "statusword": [5687] * 3,
            "lateness": n * 31 % 97,
            "missing": 0,
        }
    )
