from __future__ import annotations

import numpy as np
import pytest

from duoglide.control.host.run.history import History, HistoryTally

SCALE = np.array([0.001, 0.002, 0.001])


def history_of(cycles: int) -> History:
    tally = HistoryTally()
    for number in range(cycles):
        tally.add(5_000_000_000 + 2_000_000 * number, (number, -number, 1), number % 7 * 1000)
    assert len(tally.rows) <= 1024
    return tally.history(SCALE)


def test_a_short_run_is_kept_cycle_by_cycle() -> None:
    found = history_of(100)
    assert (found.start, found.cycles) == (5.0, 1)
    assert found.times == pytest.approx(0.002 * np.arange(100))
    assert found.following_error[-1] == pytest.approx([0.099, 0.198, 0.001])
    assert found.lateness[:8] == pytest.approx([0, 1, 2, 3, 4, 5, 6, 0])


@pytest.mark.parametrize("cycles", [1024, 1025, 2048, 2049, 30_001])
def test_a_long_run_keeps_the_worst_of_every_few_cycles(cycles: int) -> None:
    found = history_of(cycles)
    begins = np.arange(0, cycles, found.cycles)
    assert found.times == pytest.approx(0.002 * begins)
    ends = np.minimum(begins + found.cycles, cycles) - 1
    assert found.following_error[:, 0] == pytest.approx(0.001 * ends)
    assert found.following_error[:, 1] == pytest.approx(0.002 * ends)


def test_a_run_without_a_cycle_has_an_empty_history() -> None:
    assert history_of(0).following_error.shape == (0, 3)
    with pytest.raises(ValueError, match="read-only"):
        history_of(3).times[0] = 1.0
