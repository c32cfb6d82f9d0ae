from __future__ import annotations

from dataclasses import dataclass

import pytest

from duoglide.drives.cia402 import Control, Mode, State
from duoglide.drives.pdo import Nmt, pack_nmt
from duoglide.drives.simulation.firmware.homing import INDEX_DISTANCE, HomingAxis
from duoglide.drives.simulation.node.node import DriveNode
from duoglide.drives.simulation.plant import Plant, PlantParameters


@dataclass
class Bench:
    node: DriveNode

    @property
    def word(self) -> int:
        return self.node.axis.statusword

    def home(self, method: int, offset: int, seconds: float) -> None:
        write = self.node.objects.write
        write(0x6060, 0, Mode.HOMING)
        write(0x6098, 0, method)
        write(0x607C, 0, offset)
        write(0x6099, 1, 50_000)
        write(0x6040, 0, Control.ENABLE_OPERATION)
        write(0x6040, 0, Control.START_HOMING)
        assert self.word & 0x3400 == 0x0400  # not attained; it still stands
        for _ in range(round(seconds * 1000)):
            self.node.advance(1000)


@pytest.fixture(params=[1000.0, -1000.0], ids=["along y", "against y"])
def bench(request: pytest.FixtureRequest) -> Bench:
    plant = Plant(PlantParameters(limit_switches=(-12.0, 14.0)))
    node = DriveNode(1, HomingAxis, plant, request.param)
    node.advance(1000)
    node.receive(0, pack_nmt(Nmt.START, 0))
    for word in (Control.SHUTDOWN, Control.SWITCH_ON, Control.ENABLE_OPERATION):
        node.objects.write(0x6040, 0, word)
    return Bench(node)


@pytest.mark.parametrize(("method", "sign"), [(17, -1), (18, 1)])
def test_a_search_ends_at_the_edge_of_its_limit_switch(
    bench: Bench, method: int, sign: int
) -> None:
    """The edge is where the switch, on at and beyond its place, goes off again."""
    bench.home(method, 7_000, 2.0)
    assert bench.word & 0x3400 == 0x1400  # attained, stands
    low, high = bench.node.plant.parameters.limit_switches
    edge = low if sign * bench.node.scale < 0 else high
    here = 7_000 + bench.node.scale * (bench.node.plant.position - edge)
    assert bench.node.axis.actual == pytest.approx(here, abs=40)  # 5 mm/s, 1 ms, and the lag
    assert not any(bench.node.plant.switches)
    assert bench.node.axis.read(0x2010, 0) == 1


@pytest.mark.parametrize(("method", "sign"), [(33, -1), (34, 1)])
def test_a_search_ends_at_the_next_index_pulse(bench: Bench, method: int, sign: int) -> None:
    bench.node.objects.write(0x6099, 2, 20_000)
    bench.home(method, -3_000, 1.5)
    assert bench.word & 0x3400 == 0x1400
    encoder = bench.node.axis.actual + bench.node.axis.origin  # type: ignore[attr-defined]
    pulse = 0 if sign < 0 else INDEX_DISTANCE
    assert bench.node.axis.actual == pytest.approx(encoder - pulse - 3_000, abs=40)


def test_an_interrupted_search_finds_nothing(bench: Bench) -> None:
    bench.home(17, 0, 0.1)
    bench.node.objects.write(0x6040, 0, Control.QUICK_STOP)
    for _ in range(2000):
        bench.node.advance(1000)
    assert bench.node.axis.read(0x2010, 0) == 0
    assert bench.node.axis.statusword & 0x6F != State.OPERATION_ENABLED.pattern
    assert bench.node.plant.velocity == pytest.approx(0.0, abs=1e-3)


def test_the_drive_goes_on_from_where_the_search_left_it(bench: Bench) -> None:
    bench.home(17, 7_000, 2.0)
    bench.node.objects.write(0x6060, 0, Mode.CYCLIC_SYNCHRONOUS_POSITION)
    before = bench.node.plant.position
    for _ in range(100):
        bench.node.advance(1000)
    assert bench.node.plant.position == pytest.approx(before, abs=0.01)
