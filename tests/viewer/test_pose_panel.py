"""What the page says of a pose, in words."""

from __future__ import annotations

import numpy as np

import duoglide as dg
from duoglide.viewer.pose_panel import describe


def test_a_pose_with_too_small_a_carriage_margin_is_told_although_its_clearance_would_do() -> None:
    near_legs_flat = np.array([45.0, 0.0, 260.0])
    words = describe(dg.Machine(), near_legs_flat)
    assert "carriage margin **0.31 mm**" in words
    assert "**Carriage margin is below the machine's 1 mm**" in words
    assert "Clearance is below" not in words
    assert "is below" not in describe(dg.Machine(carriage_margin=0.3), near_legs_flat)
