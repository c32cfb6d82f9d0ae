from __future__ import annotations

from math import inf, nextafter

import numpy as np
import pytest

from duoglide.planning.compare import first_least, less, whole
from duoglide.planning.timing import solver


def test_what_differs_by_rounding_is_not_less() -> None:
    assert not less(nextafter(1.0, 0.0), 1.0)
    assert not less(1.0, 1.0)
    assert less(0.9999, 1.0)
    assert less(1.0, inf)
    assert not less(inf, inf)
    assert not less(-1e-7, 0.0, within=1e-6)


def test_of_equal_values_the_first_is_the_least() -> None:
    values = np.array([2.0, nextafter(1.0, 2.0), 1.0, nextafter(1.0, 0.0)])
    assert first_least(values) == 1
    assert first_least(np.array([inf, inf])) == 0
    assert first_least(np.array([3.0, -inf, -inf])) == 1
    assert first_least(np.array([[2.0, 1.0], [1.0, 1.0]])).tolist() == [1, 0]


@pytest.mark.parametrize("count", [1, 2, 7, 300])
def test_a_whole_number_of_parts_stays_itself(count: int) -> None:
    assert whole(nextafter(float(count), inf)) == count
    assert whole(nextafter(float(count), 0.0)) == count
    assert whole(count + 0.01) == count + 1


@pytest.mark.parametrize("cells", range(480, 1500, 37))
def test_windows_are_cut_alike_seen_from_either_end(cells: int) -> None:
    for cuts in solver._choose_cuts(cells):
        assert cuts[0] == 0
        np.testing.assert_array_equal(cuts[::-1], cells - cuts)
        widths = np.diff(cuts)
        assert widths.max() <= solver.LONG
