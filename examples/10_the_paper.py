"""The paper's claims, computed: topology, tables, workspace, and another machine of the same kind.

`duoglide figures DIR` draws its figures; tests/paper holds every table and erratum against it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import duoglide as dg
from duoglide.kinematics.workspace import analyse, section
from duoglide.paper import topology

for mechanism in (topology.duoglide_robot(), topology.delta()):
    found = topology.analyse(mechanism)
    degrees = found.decomposition.constraint_degrees
    print(f"{mechanism.name}: F = {found.dof}, Delta = {degrees}, kappa {found.coupling_degree:g}")

geometry = dg.Geometry()  # Table 1
for solution in dg.forward_all(geometry, (-111.24, 244.70, 246.92)):  # Table 2
    print(f"{solution.mode}: {np.round(solution.position, 2)} mm")
for number, inverse in enumerate(dg.inverse_all(geometry, (-80.39, 66.73, 307.23)), start=1):
    print(f"no. {number}: {np.round(inverse.carriages, 2)} mm, singular: {inverse.singular}")

# Which link buys workspace? Longer legs widen it across the rails, but stand farther apart on them.
volumes = {}
for name, dimensions in {
    "Table 1": geometry,
    "strut of 340 mm": replace(geometry, strut_length=340.0),
    "legs of 200 mm": replace(geometry, leg_length=200.0),
}.items():
    area = section(dimensions).area  # exact: arcs and one quartic
    volumes[name] = analyse(dg.Machine(geometry=dimensions)).volume * 1e-6
    print(f"{name}: {area:.1f} mm^2 across, {volumes[name]:.2f} litres on these rails")
assert volumes["legs of 200 mm"] < volumes["Table 1"] < volumes["strut of 340 mm"]
