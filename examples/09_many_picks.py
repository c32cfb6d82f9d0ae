"""Many picks: as one plan that runs without a stop in between, and as a program without an end.

A pick and a place turn back on the same vertical, so the platform rests there for an instant. Where
no station is in the way, paths are joined with a corner tolerance, and nothing stops at all.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import duoglide as dg

BELT, BOX = (-41, -100, 295), (-41, 100, 295)  # [mm]


def stations() -> Iterator[tuple[float, float, float]]:
    """Belt, box, belt, the next place in the box, and so on for ever."""
    number = 0
    while True:
        yield BELT
        yield BOX[0] + 8 * (number % 5), BOX[1], BOX[2]
        number += 1


machine = dg.Machine.default()

# Ten moves as one plan: checked, timed and logged as a whole.
path = dg.chain(dg.picks(islice(stations(), 11), lift=25))
trajectory = dg.plan(machine, path)
print(f"ten moves in {trajectory.duration:.3f} s, {600 / trajectory.duration:.0f} a minute")

# A way through several points: joined with a tolerance, it does not stop at the joint.
there = dg.Path.line((-41, -100, 320), (-41, 0, 320))
onward = dg.Path.line((-41, 0, 320), (-10, 80, 320))
smooth = dg.plan(machine, there.then(onward, tolerance=3.0))
stopping = dg.plan(machine, there.then(onward))
print(f"{smooth.duration:.3f} s with 3 mm of tolerance, {stopping.duration:.3f} s with a stop")
assert smooth.duration < stopping.duration

with dg.Robot.connect(machine) as robot:
    robot.enable()
    robot.home()
    run = robot.run(trajectory, log="ten_moves.mcap", approach=True)
    assert run.completed

    # Without an end: while one move runs, the next ones are planned. Here four of them.
    run = robot.run_program(dg.picks(islice(stations(), 5), lift=25), approach=True)
    assert run.completed
    assert run.program is not None
    print(f"{run.program.paths} moves, planned while they ran; waited {run.program.waits} times")
