from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.kinematics.skeleton import LINKS, joints

GEOMETRY = dg.Geometry(riser_height=12.0, arm_drop=-7.0, strut_drop=9.0)
LENGTHS = {
    "post 1": GEOMETRY.carriage_height,
    "post 2": GEOMETRY.carriage_height,
    "post 3": GEOMETRY.carriage_height,
    "leg 1": GEOMETRY.leg_length,
    "leg 2": GEOMETRY.leg_length,
    "coupler": GEOMETRY.coupler_length,
    "riser": GEOMETRY.riser_height,
    "arm": GEOMETRY.arm_length,
    "arm drop": abs(GEOMETRY.arm_drop),
    "platform": 2.0 * GEOMETRY.platform_half_width,
    "strut drop": GEOMETRY.strut_drop,
    "strut": GEOMETRY.strut_length,
}


@settings(max_examples=50, deadline=None)
@given(
    x=st.floats(-120.0, 150.0),
    y=st.floats(-100.0, 100.0),
    z=st.floats(240.0, 330.0),
    v=st.sampled_from([1, -1]),
)
def test_every_link_keeps_its_length(x: float, y: float, z: float, v: int) -> None:
    mode = dg.WorkingMode(v=v)
    if not dg.reachable(GEOMETRY, (x, y, z), mode):
        return
    found = joints(GEOMETRY, (x, y, z), mode)
    for link, (start, end) in LINKS.items():
        length = np.linalg.norm(found[end] - found[start])
        assert abs(length - LENGTHS[link]) < 1e-9, link


def test_joints_of_a_batch_are_those_of_its_rows() -> None:
    poses = np.array([[-41.0, 10.0, 302.0], [20.0, -30.0, 290.0]])
    batch = joints(GEOMETRY, poses)
    for row, pose in enumerate(poses):
        for letter, centre in joints(GEOMETRY, pose).items():
            np.testing.assert_array_equal(batch[letter][row], centre)
