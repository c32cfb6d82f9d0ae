"""Why not? Four paths that the machine refuses, and what it says about each.

An error names where, what and by how much, and where it can, the nearest thing that would work.
Programs find the same in its attributes.
"""

from __future__ import annotations

from dataclasses import replace

import duoglide as dg

machine = dg.Machine.default()
box = dg.Box(low=(-60, -20, 310), high=(-20, 20, 330), name="feeder")

refused = {
    "past the end of the rails": (machine, dg.Path.line((-41, 0, 295), (-41, 200, 295))),
    "higher than the links reach": (machine, dg.Path.line((-41, 0, 295), (-41, 0, 390))),
    "through flat legs": (machine, dg.Path.line((0, 0, 300), (0, 0, 240))),
    "through the feeder": (
        replace(machine, keep_out=(box,)),
        dg.pick_and_place((-41, -100, 295), (-41, 100, 295)),
    ),
}

for story, (cell, path) in refused.items():
    try:
        dg.check_path(cell, path)
    except dg.PathError as error:
        print(f"{story}:\n  {error}")
        print(f"  as data: {error.quantity}, {error.amount:.3f} mm, at {error.arc_length:.1f} mm\n")
    else:
        raise AssertionError(f"{story} has been accepted")
