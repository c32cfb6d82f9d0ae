"""A run is recorded and streamed once more: every setpoint the same, increment for increment.

Onto another machine it is checked again first, and refused by name where it does not fit.
"""

from __future__ import annotations

from dataclasses import replace

import duoglide as dg
from duoglide.playback.compare import compare
from duoglide.storage import read_log

machine = dg.Machine.default()
trajectory = dg.plan(machine, dg.pick_and_place((-41, -80, 295), (-41, 80, 295)))
with dg.Robot.connect(machine) as robot:
    robot.enable()
    robot.home()
    robot.run(trajectory, log="run.mcap", approach=True)

dg.replay("run.mcap", machine, log="again.mcap", approach=True)
result = compare(read_log("run.mcap"), read_log("again.mcap"))
print(f"{result.common} cycles, and setpoints that differ by {max(result.setpoint)} increments")
assert result.same_setpoints

slower = replace(machine, limits=dg.CarriageLimits(velocity=1000.0))
try:
    dg.replay("run.mcap", slower)
except dg.LimitError as error:
    print(f"on a slower machine: {error}")
else:
    raise AssertionError("a machine that is too slow has accepted the run")
