"""Readers of logs on damaged ones: only errors of ours leave them.

The default run takes a few hundred of each kind; ``pytest -m slow tests/fuzz/test_logs.py`` takes
20 000. A file on which a reader fails is kept, and named.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from damaged_logs import (
    McapInputs,
    a_plan,
    a_run,
    frame_logs,
    read_all_frames,
    read_everything,
    spoilt_frames,
)

from duoglide.playback.can_log import SUFFIXES

FEW, MANY = 150, 20_000
COUNTS = [FEW, pytest.param(MANY, marks=pytest.mark.slow)]


def attack(
    file: Path, count: int, draw: Callable[[], bytes], judge: Callable[[Path], str]
) -> Counter[str]:
    """Give a reader so many files, and count what became of them."""
    became: Counter[str] = Counter()
    for number in range(count):
        file.write_bytes(draw())
        try:
            became[judge(file)] += 1
        except BaseException as error:
            kept = file.rename(Path(f"/tmp/failed-{number}-{file.name}"))
            error.add_note(f"input {number}, kept as {kept}")
            raise
    return became


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("make", [a_run, a_plan])
def test_damaged_plans_and_runs(make: Callable[[Path], Path], count: int, tmp_path: Path) -> None:
    noise = random.Random(11)
    inputs = McapInputs(make(tmp_path / "whole.mcap").read_bytes())
    file = tmp_path / f"{make.__name__}.mcap"
    became = attack(
        file, count, lambda: inputs.draw(noise), lambda file: read_everything(file, noise)
    )
    print(became)
    assert became["LogError"] > count // 4
    assert became["read"] > count // 20


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_damaged_logs_of_frames(suffix: str, count: int, tmp_path: Path) -> None:
    noise = random.Random(12)
    whole = frame_logs(tmp_path)[suffix]
    file = tmp_path / f"frames{suffix}"
    became = attack(file, count, lambda: spoilt_frames(suffix, whole, noise), read_all_frames)
    print(became)
    assert became["LogError"] > count // 4
    assert became["read"] > 0
