"""What a message costs in the log, beside the writer of the mcap package, in the same run.

.venv/bin/python tests/benchmarks/log_writer.py [minutes of running at 500 Hz]
"""

from __future__ import annotations

import math
import platform
import random
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mcap.writer import CompressionType, Writer

from duoglide.storage import CycleRecord, LogKind, LogWriter, Phase, Topic, read_log
from duoglide.storage.schemas import schema_name, schema_of

SEED = 7
CYCLE = 0.002
ALLOWED_TIME = 15.0  # us of this process's own time, in the mean
ALLOWED_SIZE = 150.0  # MB an hour


def cycles(count: int) -> list[CycleRecord]:
    """Carriages that swing 300 mm twice a second, with noise in what is measured."""
    noise = random.Random(SEED)
    records = []
    for n in range(count):
        first, second, third = (
            round(300e3 * math.sin(4.0 * math.pi * n * CYCLE + axis)) for axis in range(3)
        )
        a, b, c = (at + round(noise.gauss(0.0, 80.0)) for at in (first, second, third))
        late = round(abs(noise.gauss(50.0, 30.0)))
        records.append(
            CycleRecord(
                n, Phase.PROGRAM, n * CYCLE % 0.5, 1.0, (first, second, third), (a, b, c),
                (15, 15, 15), (0x1237, 0x1237, 0x1237), late,
            )
        )  # fmt: skip
    return records


@dataclass(frozen=True)
class Costs:
    """Of each message on the wall clock [us], and of all of them in the mean in CPU time [us]."""

    each: list[float]
    cpu: float


def measure(write: Callable[[float, CycleRecord], None], records: list[CycleRecord]) -> Costs:
    """Time every message."""
    costs = []
    begin, used = time.monotonic(), time.process_time()
    for n, record in enumerate(records):
        start = time.perf_counter_ns()
        write(begin + n * CYCLE, record)
        costs.append((time.perf_counter_ns() - start) * 1e-3)
    return Costs(costs, (time.process_time() - used) / len(records) * 1e6)


def ours(file: Path, records: list[CycleRecord]) -> Costs:
    with LogWriter(file, LogKind.RUN) as log:
        return measure(lambda t, record: log.write(Topic.CYCLE, t, record), records)


def peer(file: Path, records: list[CycleRecord]) -> Costs:
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=64 * 1024, compression=CompressionType.LZ4)
        writer.start()
        schema = writer.register_schema(
            schema_name(Topic.CYCLE), "jsonschema", schema_of(Topic.CYCLE)
        )
        channel = writer.register_channel(Topic.CYCLE.value, "json", schema)

        def write(t: float, record: CycleRecord) -> None:
            stamp = round(t * 1e9)
            writer.add_message(channel, stamp, record.to_json(), stamp)

        costs = measure(write, records)
        writer.finish()
    return costs


def report(name: str, costs: Costs, file: Path) -> float:
    """Print a line; return the size [MB an hour]."""
    order = sorted(costs.each)
    size = file.stat().st_size / (len(order) * CYCLE) * 3600e-6
    print(
        f"{name:<6} mean {costs.cpu:6.2f} us of CPU; on the clock median"
        f" {order[len(order) // 2]:6.2f}  99.9 % {order[int(0.999 * len(order))]:7.1f}"
        f"  worst {order[-1]:8.1f} us; {size:6.1f} MB an hour"
    )
    return size


def main() -> None:
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 2.0
    records = cycles(int(minutes * 60.0 / CYCLE))
    print(f"{len(records)} cycles, seed {SEED}, {platform.processor() or platform.machine()},")
    print(f"Python {platform.python_version()}, {platform.platform()}")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.mcap"
        costs = ours(file, records)
        size = report("ours", costs, file)
        assert [record for _, record in read_log(file).records(Topic.CYCLE)] == records
        other = Path(folder) / "peer.mcap"
        report("mcap", peer(other, records), other)
    kept = "kept" if costs.cpu < ALLOWED_TIME and size < ALLOWED_SIZE else "BROKEN"
    print(f"allowed: {ALLOWED_TIME:g} us, {ALLOWED_SIZE:g} MB an hour: {kept}")
    sys.exit(kept != "kept")


if __name__ == "__main__":
    main()
