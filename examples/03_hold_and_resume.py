"""Somebody is at the panel: feed hold, resume, slower, while the machine moves.

Nothing leaves the planned path: only the pace along it changes, within what the plan allows.
"""

from __future__ import annotations

import time

import duoglide as dg

machine = dg.Machine.default()
there = dg.pick_and_place((-41, -100, 295), (-41, 100, 295))
back = dg.pick_and_place((-41, 100, 295), (-41, -100, 295))
trajectory = dg.plan(machine, there.then(back))

with dg.Robot.connect(machine) as robot:
    robot.enable()
    robot.home()
    run = robot.start(trajectory, log="run.mcap", approach=True, override=0.2)
    time.sleep(0.8)
    run.hold()
    time.sleep(0.5)
    print(f"held: {run.status}")
    assert not run.done
    run.resume()
    time.sleep(0.3)
    run.set_override(0.3)
    report = run.wait(timeout=30)

print(report)
assert report.completed
