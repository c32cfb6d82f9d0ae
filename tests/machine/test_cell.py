from __future__ import annotations

import pytest

import duoglide as dg


def test_a_box_keeps_its_corners_as_floats() -> None:
    box = dg.Box(low=(0, 1, 2), high=[3, 4, 5], name="post")  # type: ignore[arg-type]
    assert (box.low, box.high, box.name) == ((0.0, 1.0, 2.0), (3.0, 4.0, 5.0), "post")


@pytest.mark.parametrize(
    ("low", "high", "message"),
    [
        ((0.0, 0.0, 0.0), (1.0, 0.0, 1.0), "y must be below 0 mm"),
        ((5.0, 0.0, 0.0), (1.0, 1.0, 1.0), "x must be below 1 mm"),
        ((0.0, 0.0), (1.0, 1.0, 1.0), "low = .*must be three numbers"),
        ((0.0, 0.0, 0.0), (1.0, 1.0, float("inf")), "high = .*must be finite numbers"),
    ],
)
def test_a_box_without_inside_is_refused(low: tuple, high: tuple, message: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(dg.ConfigError, match=message):
        dg.Box(low=low, high=high)


def test_a_name_is_text() -> None:
    with pytest.raises(dg.ConfigError, match="name = 5: must be text"):
        dg.Box(low=(0, 0, 0), high=(1, 1, 1), name=5)  # type: ignore[arg-type]
