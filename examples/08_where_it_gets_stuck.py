"""Where the mechanism gets stuck: the solutions of a pose, and the way to every singularity.

The numbers are those of the paper's tables, and of its errata.
"""

from __future__ import annotations

import numpy as np

import duoglide as dg

geometry = dg.Geometry()
position = dg.forward(geometry, (-200, 200, 60))
print(f"carriages (-200, 200, 60) hold the platform at {np.round(position, 4)} mm")
assert np.allclose(dg.inverse(geometry, position), (-200, 200, 60))

print(f"{len(dg.forward_all(geometry, (-200, 200, 60)))} poses fit these carriages:")
for assembly in dg.forward_all(geometry, (-200, 200, 60)):
    print(f"  {assembly.mode}: {np.round(assembly.position, 3)}")

room = dg.margins(geometry, position)
print(f"nearest singular surface: {float(dg.clearance(geometry, position)):.2f} mm away")
print(f"legs flat: {float(room.legs_flat):.2f} mm; arm in line with strut: {room.arm_strut:.2f} mm")

# A singular pose well inside reach, which the paper says does not exist (erratum 3).
inside = (187.2797, 0, 250)
print(f"at {inside}: clearance {float(dg.clearance(geometry, inside)):.5f} mm")
assert dg.clearance(geometry, inside) < 1e-3
