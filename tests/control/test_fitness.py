from __future__ import annotations

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.host.fitness import require_fit
from duoglide.motion.profile import Profile


def test_what_begins_or_ends_in_motion_is_not_run_by_itself(machine: dg.Machine) -> None:
    whole = dg.plan(machine, dg.Path.line((-41, -40, 300), (-41, 40, 300)))
    require_fit(whole, machine)
    knot = len(whole.profile.knots) // 2
    part = whole.until(knot, whole.stops)
    with pytest.raises(dg.PathError, match="ends in motion"):
        require_fit(part, machine)
    time = whole.profile.knots[knot, 0]
    later = Profile(whole.profile.knots[knot:] - np.array([time, 0.0, 0.0, 0.0]))
    with pytest.raises(dg.PathError, match="begins in motion"):
        require_fit(dg.Trajectory(whole.path, later, whole.stops), machine)
