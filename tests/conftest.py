from __future__ import annotations

import pytest

import duoglide as dg


@pytest.fixture
def machine() -> dg.Machine:
    return dg.Machine.default()


@pytest.fixture
def geometry() -> dg.Geometry:
    return dg.Geometry()
