from __future__ import annotations

from pathlib import Path

import pytest

from duoglide.storage import (
    ClockAnchor,
    CycleRecord,
    Document,
    EventKind,
    EventRecord,
    LogKind,
    LogWriter,
    Phase,
    Topic,
)

CYCLES = 60
ANCHOR = ClockAnchor(monotonic=1234.5, wall_ns=1_700_000_000_000_000_000)


def cycle(number: int) -> CycleRecord:
    return CycleRecord(
        cycle=number,
        phase=Phase.PROGRAM,
        path_time=number * 0.1,
        rate=1.0,
        setpoint=(number, -number, 7 * number),
        actual=(number - 1, 1 - number, 7 * number - 7),
        controlword=(31, 31, 31),
        statusword=(5687, 5687, 5687),
        lateness=number % 60,
        missing=0,
    )


@pytest.fixture
def cycles() -> list[CycleRecord]:
    return [cycle(number) for number in range(CYCLES)]


@pytest.fixture
def run_log(tmp_path: Path, cycles: list[CycleRecord]) -> Path:
    file = tmp_path / "run.mcap"
    with LogWriter(file, LogKind.RUN, {"eds_sha256": "abc"}, ANCHOR) as log:
        log.attach(Document.MACHINE, {"clearance": 2.0})
        log.write(Topic.EVENT, 1234.5, EventRecord(EventKind.STARTED, "the stream begins"))
        for record in cycles:
            log.write(Topic.CYCLE, 1234.5 + 0.002 * record.cycle, record)
            if record.cycle % 20 == 19:
                log.flush()
        log.attach(Document.REPORT, {"worst": 0.1})
    return file
