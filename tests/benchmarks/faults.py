"""The fault table, measured: ``python tests/benchmarks/faults.py``.

Every fault is injected into simulated drives of another process, in the middle of a logged run. The
host takes the drives for real ones: it does not wait for them when the computer stands still, as on
the bus ``virtual``. What is printed comes from the log: when the host could first know, when the
first setpoint or controlword of the reaction went out, and how far off the path the carriages were.
"""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import duoglide as dg
from duoglide.control.host.run.handle import RunHandle
from duoglide.drives.simulation.faults import (
    Clear,
    DeviceFault,
    DropFrames,
    Injection,
    Jam,
    Reboot,
    Silence,
    Sto,
)
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages
from duoglide.storage import CycleRecord, EventKind, Log, Phase, Topic, read_log

MACHINE = dg.Machine.default()
START = home_carriages(MACHINE).tolist()
QUICK_STOP = 0x0002
NEWS = (EventKind.FAULT, EventKind.EMERGENCY, EventKind.BUS, EventKind.QUICK_STOP, EventKind.STOP)

SLOW = {"no heartbeat, axis 2": 0.1}  # its watch takes 0.25 s

Inject = Callable[[SimulatedDrives, dg.Robot, RunHandle], None]


def drive(injection: Injection) -> Inject:
    """Return an injection into a simulated drive."""

    return lambda drives, robot, handle: drives.inject(injection)


def pause(drives: SimulatedDrives, robot: dg.Robot, handle: RunHandle) -> None:
    """Stop the streamer for 15 ms: late cycles."""
    pid = robot._connection.process.pid
    os.kill(pid, signal.SIGSTOP)
    time.sleep(0.015)
    os.kill(pid, signal.SIGCONT)


FAULTS: dict[str, Inject] = {
    "stop": lambda drives, robot, handle: handle.stop(),
    "quick stop": lambda drives, robot, handle: handle.quick_stop(),
    "device fault, axis 2": drive(DeviceFault(2)),
    "jam, axis 1": drive(Jam(1)),
    "safe torque off, axis 3": drive(Sto(3)),
    "no feedback, axis 2": drive(Silence(2, heartbeat=False)),
    "no heartbeat, axis 2": drive(Silence(2, tpdo=False)),
    "reboot, axis 1": drive(Reboot(1)),
    "one setpoint lost": drive(DropFrames(1, 1)),
    "one feedback lost": drive(DropFrames(1, 1, received=False)),
    "streamer paused 15 ms": pause,
}


def measure(name: str, inject: Inject, folder: Path) -> str:
    """Run, inject, and return one line of the table."""
    path = folder / "run.mcap"
    with (
        SimulatedDrives(MACHINE.drives, START, standstill=0.0) as drives,
        dg.Robot.connect(MACHINE, bus=drives.address) as robot,
    ):
        robot.enable()
        robot.home()
        start, end = (-41.0, -140.0, 300.0), (-41.0, 140.0, 300.0)
        robot.run(dg.transfer(MACHINE, dg.forward(MACHINE.geometry, robot.held), start))
        trajectory = dg.transfer(MACHINE, start, end)
        handle = robot.start(trajectory, log=path, override=SLOW.get(name, 1.0))
        while handle.status.path_time < 0.25 * trajectory.duration and not handle.done:
            time.sleep(0.001)
        inject(drives, robot, handle)
        places = []
        while not handle.done or len(places) < 50:
            places.append([drive.position for drive in drives.snapshot()])
        report = handle.wait(10.0)
        late = [drives.snapshot() for _ in range(100)]  # a quick stop goes on
        places += [[drive.position for drive in seen] for seen in late]
        for axis in (1, 2, 3):
            drives.inject(Clear(axis))
    log = read_log(path)
    rows = [(t, r) for t, r in log.records(Topic.CYCLE) if isinstance(r, CycleRecord)]
    reaction = "completed" if report.completed else _reaction(rows)
    what = report.faults[0].words if report.faults else ""
    cycles, away = _delay(log, rows), _deviation(trajectory, np.array(places))
    whole = "no" if log.missing else "yes"
    return f"{name:<24}{reaction:<20}{cycles:>7}{away:>12.3f}   {whole:<5}{what}"


def _reaction(rows: list[tuple[float, CycleRecord]]) -> str:
    quick = any(QUICK_STOP in record.controlword for _, record in rows)
    return "quick stop" if quick else "stop on the path"


def _delay(log: Log, rows: list[tuple[float, CycleRecord]]) -> str:
    """Cycles from the news to the first frame that differs."""
    told = [t for t, record in log.records(Topic.EVENT) if getattr(record, "kind", "") in NEWS]
    changed = [t for t, r in rows if r.phase is Phase.STOP or QUICK_STOP in r.controlword]
    if not told or not changed:
        return "-"
    return str(max(0, round((changed[0] - told[0]) / MACHINE.drives.cycle)))


def _deviation(trajectory: dg.Trajectory, carriages: np.ndarray) -> float:
    """Worst distance of the platform from the path, from where the carriages really were [mm]."""
    path = trajectory.position_at(np.linspace(0.0, trajectory.duration, 20_000))
    try:
        places = dg.forward(MACHINE.geometry, carriages)
    except dg.UnreachableError:  # a carriage that jams at full speed tears the others out of reach
        return float("inf")
    return float(max(np.linalg.norm(path - place, axis=1).min() for place in places))


def main() -> None:
    """Print the matrix."""
    print(
        f"{'fault':<24}{'reaction':<20}{'cycles':>7}{'off path':>12}   {'log':<5}what is reported"
    )
    for name, inject in FAULTS.items():
        with tempfile.TemporaryDirectory() as folder:
            print(measure(name, inject, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
