"""The simulated drives under somebody else's master: that of the ``canopen`` package."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import canopen
import pytest

from duoglide.drives.linear_axis import eds_path
from duoglide.drives.simulation import faults
from duoglide.drives.simulation.simulated import SimulatedDrives


@pytest.fixture
def node(network: canopen.Network) -> Iterator[canopen.RemoteNode]:
    node = network.add_node(1, str(eds_path()))
    node.sdo.MAX_RETRIES = 5  # a drive that boots does not answer
    yield node
    network.sync.stop()


def wait_until(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_pdos_are_read_mapped_and_received_by_their_names(
    node: canopen.RemoteNode, network: canopen.Network
) -> None:
    node.tpdo.read()
    node.tpdo[1].clear()
    node.tpdo[1].add_variable("Position actual value")
    node.tpdo[1].add_variable("Statusword")
    node.tpdo[1].trans_type = 2
    node.tpdo[1].enabled = True
    node.tpdo[1].save()
    node.nmt.state = "OPERATIONAL"
    network.sync.start(0.005)
    assert node.tpdo[1].wait_for_reception(2.0) is not None
    assert node.tpdo[1]["Statusword"].raw & 0x6F == 0x40
    node.tpdo[1].read()
    assert [variable.name for variable in node.tpdo[1]] == ["Position actual value", "Statusword"]
    assert node.tpdo[1].trans_type == 2


def test_heartbeat_emergency_and_error_history_are_understood(
    node: canopen.RemoteNode, drives: SimulatedDrives
) -> None:
    node.sdo["Producer heartbeat time"].raw = 20
    node.nmt.wait_for_heartbeat(2.0)
    assert node.nmt.state == "PRE-OPERATIONAL"
    drives.inject(faults.DeviceFault(1, 0x4310))
    wait_until(lambda: bool(node.emcy.log))
    assert [(said.code, said.register) for said in node.emcy.log] == [(0x4310, 0x09)]
    assert node.sdo[0x1003][1].raw == 0x4310
    node.sdo[0x1003][0].raw = 0
    assert node.sdo[0x1003][0].raw == 0


def test_parameters_are_stored_and_restored(
    node: canopen.RemoteNode, drives: SimulatedDrives
) -> None:
    def reboot() -> int:
        drives.inject(faults.Reboot(1, delay=0.0))
        return int(node.sdo["Following error window"].raw)

    node.sdo["Following error window"].raw = 777
    node.store()
    assert reboot() == 777
    node.restore()
    assert reboot() == 5000


def test_a_wrong_write_is_refused_with_the_code_of_the_standard(node: canopen.RemoteNode) -> None:
    with pytest.raises(canopen.SdoAbortedError) as refusal:
        node.sdo["Statusword"].raw = 1
    assert refusal.value.code == 0x06010002
