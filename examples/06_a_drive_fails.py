"""A drive fails in the middle of a move: all three carriages stop, and the log says why.

The fault is injected into a simulated drive; everything else is what real drives would see.
"""

from __future__ import annotations

import time

import duoglide as dg
from duoglide.drives.simulation.faults import DeviceFault
from duoglide.storage import Topic, read_log

machine = dg.Machine.default()
trajectory = dg.plan(machine, dg.pick_and_place((-41, -120, 295), (-41, 120, 295)))

with dg.Robot.connect(machine) as robot:
    robot.enable()
    robot.home()
    run = robot.start(trajectory, log="run.mcap", approach=True, override=0.1)
    time.sleep(1.5)
    assert robot.simulated is not None
    robot.simulated.inject(DeviceFault(axis=2))
    report = run.wait(timeout=10)
    print(report)
    assert not report.completed
    assert report.faults

    # The log is whole, whatever happened.
    log = read_log("run.mcap")
    for t, event in log.records(Topic.EVENT):
        print(f"{t - log.anchor.monotonic:7.3f} s  {event.kind.value}: {event.text}")

    # Faults are acknowledged on purpose, never by themselves.
    robot.reset_fault()
    robot.enable()
    print(f"enabled again: {robot.enabled}, still homed: {robot.homed}")
