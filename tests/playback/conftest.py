from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.control.channel.scale import Scales
from duoglide.motion.path_clock import PathClock
from duoglide.storage import (
    ClockAnchor,
    CycleRecord,
    EventKind,
    EventRecord,
    LogKind,
    LogWriter,
    Phase,
    Topic,
)

Pace = Sequence[tuple[float, float, Phase]]
"""Path time, rate and phase of each cycle."""
WriteRun = Callable[..., Path]
"""Takes a pace, the name of the log, and the plan if it is not the fixture's."""

CYCLE = 0.002
ANCHOR = ClockAnchor(monotonic=50.0, wall_ns=1_700_000_000_000_000_000)


@pytest.fixture(scope="session")
def trajectory() -> dg.Trajectory:
    """A plan with so much reserve that its pace can be changed anywhere."""
    machine = dg.Machine(
        limits=dg.CarriageLimits(velocity=600.0, acceleration=10e3, jerk=500e3),
        stop_limits=dg.CarriageLimits(),
    )
    path = dg.Path.polyline([(-41, -60, 300), (-41, 60, 300), (-41, 60, 320)], tolerance=2.0)
    return dg.plan(machine, path, brake_safe=False)


@pytest.fixture
def at_full_speed(trajectory: dg.Trajectory) -> Pace:
    """The pace of a run that nobody touched: a cycle of rest, the plan, a few cycles of rest."""
    end = trajectory.duration
    cycles = int(end / CYCLE) + 1
    moving = [(k * CYCLE, 1.0, Phase.PROGRAM) for k in range(1, cycles)]
    return [(0.0, 0.0, Phase.HOLD), *moving, *[(end, 0.0, Phase.HOLD)] * 4]


@pytest.fixture
def paced(trajectory: dg.Trajectory) -> Callable[[dict[int, float]], Pace]:
    """Makes the pace of a run whose override was changed at some cycles; 0 stops it for good."""

    def make(overrides: dict[int, float]) -> Pace:
        clock = PathClock(trajectory.stops, CYCLE)
        pace: list[tuple[float, float, Phase]] = [(0.0, 0.0, Phase.HOLD)]
        phase = Phase.PROGRAM
        for cycle in range(4000):
            if overrides.get(cycle) == 0.0:
                clock.stop()
                phase = Phase.STOP
            elif cycle in overrides:
                clock.set_override(overrides[cycle])
            u, rate = clock.step(CYCLE)
            done = u >= trajectory.duration or (phase is Phase.STOP and rate == 0.0)
            pace.append((u, rate, Phase.HOLD if done else phase))
            if done:
                return [*pace, *[(u, 0.0, Phase.HOLD)] * 4]
        raise AssertionError("the run does not end")

    return make


@pytest.fixture
def write_run(trajectory: dg.Trajectory, tmp_path: Path) -> WriteRun:
    """Writes the log that a streamer would, with drives that follow two cycles later."""

    def write(pace: Pace, name: str = "run.mcap", plan: dg.Trajectory = trajectory) -> Path:
        file = tmp_path / name
        scales = Scales.of(plan.machine.drives)
        noise = random.Random(4)
        sent = [scales.triple(plan.at(pace[0][0]).carriages)] * 2
        with LogWriter(file, LogKind.RUN, {"bus": "none"}, ANCHOR) as log:
            log.attach("machine", plan.machine.to_dict())
            log.attach("trajectory", plan.to_document())
            log.write(Topic.EVENT, 50.0, EventRecord(EventKind.STARTED, "program started"))
            for number, (u, rate, phase) in enumerate(pace):
                setpoint = scales.triple(plan.at(float(u)).carriages)
                first, second, third = (at + noise.randint(-20, 20) for at in sent[-2])
                sent.append(setpoint)
                record = CycleRecord(
                    cycle=1000 + number,
                    phase=phase,
                    path_time=float(u),
                    rate=rate,
                    setpoint=setpoint,
                    actual=(first, second, third),
                    controlword=(15, 15, 15),
                    statusword=(0x1237, 0x1237, 0x1237),
                    lateness=noise.randint(20, 150),
                )
                log.write(Topic.CYCLE, 50.0 + number * CYCLE, record)
            log.write(Topic.EVENT, 51.0, EventRecord(EventKind.EMERGENCY, "oh", 2, 0x8611))
        return file

    return write


@pytest.fixture
def run_log(write_run: WriteRun, at_full_speed: Pace) -> Path:
    return write_run(at_full_speed)
