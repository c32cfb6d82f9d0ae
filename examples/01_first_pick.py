"""A first pick and place: planned, looked at, streamed to three simulated drives, recorded.

Run it anywhere; it writes plan.mcap and run.mcap where it stands.
"""

from __future__ import annotations

import duoglide as dg

machine = dg.Machine.default()  # Table 1 of the paper
path = dg.pick_and_place(pick=(-41, -152.5, 295), place=(-41, 152.5, 295), lift=25, tolerance=2)

# Checking proves every point of the path before anything is timed, and says how near it comes.
checked = dg.check_path(machine, path)
print(f"tightest: {checked.report.tightest}")

# Planning checks again, times the path, and makes it safe against drives that brake alone.
trajectory = dg.plan(machine, path)
print(trajectory.audit())
trajectory.save("plan.mcap")

with dg.Robot.connect(machine, bus="virtual") as robot:
    robot.enable()
    robot.home()
    # The drives stand at the home pose: approach=True plans and checks the way to the start.
    run = robot.run(trajectory, log="run.mcap", approach=True)
print(run)
assert run.completed
