"""A program in a file: moves, a gripper on a drive's digital output, and a dwell.

The same file works from the shell: duoglide plan program.toml
"""

from __future__ import annotations

from pathlib import Path

import duoglide as dg
from duoglide.planning.programs.read import read_program
from duoglide.storage import EventKind

PROGRAM = """\
start = [-41, -80, 295]
tolerance = 2.0
speed = 900                   # of the tool, mm/s

[[moves]]
type = "set_output"           # close the gripper, on an output of drive 1
axis = 1
bit = 16
value = true

[[moves]]
type = "dwell"
seconds = 0.05

[[moves]]
type = "pick_and_place"
place = [-41, 80, 295]
lift = 25

[[moves]]
type = "set_output"
axis = 1
bit = 16
value = false
"""

file = Path("program.toml")
file.write_text(PROGRAM, encoding="utf-8")

machine = dg.Machine.default()
trajectory = dg.plan(machine, read_program(file))
for t, action in trajectory.actions:
    print(f"{t:7.4f} s  {action}")

with dg.Robot.connect(machine) as robot:
    robot.enable()
    robot.home()
    run = robot.run(trajectory, log="run.mcap", approach=True)
switched = [event for _, event in run.events if event.kind is EventKind.OUTPUT]
for event in switched:
    print(event.text)
assert len(switched) == 2
