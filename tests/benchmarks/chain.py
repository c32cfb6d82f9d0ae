"""A program of many moves on the virtual bus, and somebody else on it who counts.

    python tests/benchmarks/chain.py [--moves 10000] [--planned 300] [--override 1.0] [--seed 1]

First ``--planned`` short moves that end at rest are planned while they run. Then a round of moves
that hand over in motion is planned once, and run again and again until ``--moves`` are done. Both
are logged. A listener in a process of its own counts SYNCs and setpoints. Printed: rests that were
not planned, setpoints lost, cycles between two moves, lateness, the files of the log, and memory of
host and streamer after a tenth of the moves and at the end.

The exit code is 1 where a setpoint is lost, a cycle is missing in the log, or the second program
rests where it should not.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import count, pairwise
from pathlib import Path

import numpy as np

import duoglide as dg
from duoglide.control.host.run.feed import PlannerProcess
from duoglide.control.host.run.parts import ProgramOrder
from duoglide.drives import pdo
from duoglide.drives.bus.buses import open_bus
from duoglide.storage import Topic, read_log

MACHINE = dg.Machine.default()
ROUND, TURNS = 120, 9  # moves, turns around the machine
PLACES = (-41.0, 0.0, 302.0), (-41.0, 25.0, 302.0)


def listen(address: str) -> None:
    """Count what is on the bus until nobody writes to stdin any more."""
    syncs, moved, wrong, running = 0, 0, 0, False
    setpoints: dict[int, tuple[int, int]] = {}
    before: tuple[int, ...] = ()
    ids = [pdo.RPDO1 + node for node in MACHINE.drives.node_ids]
    os.set_blocking(0, False)
    with open_bus(address) as bus:
        print("listening", flush=True)
        while True:
            message = bus.recv(0.5)
            if message is None or message.arbitration_id == pdo.SYNC:
                if message is None or syncs % 500 == 0:
                    try:
                        if os.read(0, 1) == b"":
                            break
                    except BlockingIOError:
                        pass
                syncs += 1
                complete = all(setpoints.get(i, (0, 0))[1] == 1 for i in ids)
                running = running or complete
                wrong += running and not complete
                places = tuple(setpoints.get(i, (0, 0))[0] for i in ids)
                moved += places != before
                before = places
                setpoints = {}
            elif message.arbitration_id in ids:
                _, place = pdo.SETPOINT.unpack(bytes(message.data))
                _, times = setpoints.get(message.arbitration_id, (0, 0))
                setpoints[message.arbitration_id] = (place, times + 1)
    print(json.dumps({"syncs": syncs, "moved": moved, "wrong": wrong}))


def to_and_fro(moves: int) -> Iterator[dg.Path]:
    """Yield short moves that end at rest."""
    for k in range(moves):
        yield dg.Path.line(PLACES[k % 2], PLACES[1 - k % 2])


def visits(seed: int) -> Iterator[dg.Path]:
    """Yield moves around the machine and back to their start, joined by corners."""
    rng = np.random.default_rng(seed)
    angles = 2.0 * np.pi * TURNS * np.arange(ROUND + 1) / ROUND
    lift = rng.uniform(-5.0, 5.0, ROUND + 1)
    lift[-1] = lift[0]
    points = np.column_stack([-41.0 + 22.0 * np.cos(angles), 95.0 * np.sin(angles), 300.0 + lift])
    for here, there in pairwise(points):
        yield dg.Path.line(here, there)


def memory(pid: int) -> int:
    """Return the resident memory of a process [kB]."""
    status = Path(f"/proc/{pid}/status").read_text("ascii")
    return int(status.split("VmRSS:")[1].split()[0])


def tell(name: str, report: dg.RunReport, file: Path) -> int:
    """Print how a run went; return how many cycles its log lacks."""
    program = report.program
    assert program is not None
    files = sorted(file.parent.glob(f"{file.stem}*"))
    logged, still = 0, []
    for each in files:
        log = read_log(each)
        pause = 0
        part = -1
        for _, record in log.records(Topic.CYCLE):
            logged += 1
            if record.part != part:
                if part >= 0:
                    still.append(pause)
                part, pause = record.part, 0
            pause = pause + 1 if record.rate == 0.0 else 0
    late = report.lateness
    print(
        f"{name}: {report.ending}; {program.parts} parts, {program.paths} paths,"
        f" {report.cycles} cycles in {report.duration:.1f} s; waited {program.waits} times,"
        f" {program.waited:.2f} s; {report.skipped} cycles left out, {report.lost} frames lost;"
        f" late median {late.median:.0f}, 99.9 % {late.p999:.0f}, worst {late.worst:.0f} us"
    )
    for words in (*(fault.words for fault in report.faults), *report.remarks):
        print(f"  {words}")
    for _, event in list(report.events)[-6:]:
        print(f"  event: {event.text}")
    size = sum(each.stat().st_size for each in files) / 1e6
    print(
        f"  cycles at rest between two parts: median {np.median(still):.0f}, worst {max(still)};"
        f" {len(files)} files of log, {size:.1f} MB, {logged} cycles in them"
    )
    return abs(report.cycles - logged) + report.dropped


def run(options: argparse.Namespace, folder: Path) -> int:
    """Run both programs; return how much was wrong."""
    with dg.Robot.connect(MACHINE) as robot:
        robot.enable()
        robot.home()
        robot.move_to(PLACES[0], override=1.0)
        ear = subprocess.Popen(
            [sys.executable, __file__, "--listen", robot.bus],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert ear.stdout is not None and ear.stdin is not None
        ear.stdout.readline()
        wrong, file = 0, folder / "planned.mcap"
        if options.planned:
            report = robot.run_program(
                to_and_fro(options.planned), brake_safe=False, log=file, override=options.override
            )
            wrong += tell("planned while it runs", report, file)
        parts = list(dg.plan_program(MACHINE, visits(options.seed), tolerance=3.0))
        moving = sum(part.whole is not None for part in parts)
        print(f"a round of {ROUND} moves: {len(parts)} parts, {moving} handed over in motion")
        rounds = -(-options.moves // ROUND)
        streamer = robot._connection.process.pid
        sizes: list[tuple[int, int]] = []

        def many() -> Iterator[dg.Trajectory]:
            for done in count():
                if done == rounds:
                    break
                if done in (rounds // 10, rounds - 1):
                    sizes.append((memory(os.getpid()), memory(streamer)))
                yield from parts

        file = folder / "round.mcap"
        robot.move_to(parts[0].position_at(0.0), override=1.0)
        source = PlannerProcess(ProgramOrder(MACHINE, planned=True), many())
        handle = robot._start_feed(source, file, approach=True, override=options.override)
        report = handle.wait()
        wrong += tell(f"{rounds * ROUND} moves", report, file)
        assert report.program is not None
        wrong += report.program.waits + (not report.completed)
        for (host, stream), when in zip(sizes, ("after a tenth", "at the end"), strict=False):
            print(f"  memory {when}: host {host / 1e3:.1f} MB, streamer {stream / 1e3:.1f} MB")
        ear.stdin.close()
        heard = json.loads(ear.stdout.read())
        print(
            f"the listener heard {heard['syncs']} SYNCs, {heard['moved']} of them after setpoints"
            f" that moved, {heard['wrong']} without one setpoint of each drive"
        )
    return wrong + heard["wrong"]


def main() -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moves", type=int, default=10_000)
    parser.add_argument("--planned", type=int, default=300)
    parser.add_argument("--override", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--listen")
    options = parser.parse_args()
    if options.listen:
        listen(options.listen)
        return 0
    print(f"{platform.processor() or platform.machine()}, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as folder:
        return 1 if run(options, Path(folder)) else 0


if __name__ == "__main__":
    sys.exit(main())
