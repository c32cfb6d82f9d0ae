"""The host's side of one drive, against simulated drives in another process."""

from __future__ import annotations

import time
from dataclasses import replace

import canopen
import pytest
from drive_power import disable, enable, reset_fault

from duoglide.drives.axis.axis import Axis
from duoglide.drives.axis.configure import interpolation_time
from duoglide.drives.bus.buses import frame_sender
from duoglide.drives.cia402 import Control, Mode, State
from duoglide.drives.pdo import RPDO1, SETPOINT, SYNC
from duoglide.drives.simulation import faults
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.errors import ConfigError, DriveError, DriveFault, DriveTimeout
from duoglide.machine import DriveSettings, Homing, Quirks


def with_quirks(network: canopen.Network, settings: DriveSettings, quirks: Quirks) -> Axis:
    return Axis(network, replace(settings, quirks=(quirks, Quirks(), Quirks())), 1)


def test_bring_up_ends_enabled_homed_and_where_it_was(
    enabled: list[Axis], drives: SimulatedDrives
) -> None:
    for axis, real in zip(enabled, drives.snapshot(), strict=True):
        assert axis.read_state() is State.OPERATION_ENABLED
        assert axis.read(0x6061) == Mode.CYCLIC_SYNCHRONOUS_POSITION
        assert axis.read_position() == pytest.approx(real.position, abs=0.002)
        assert axis.read_homed()
        assert real.brake_released


@pytest.mark.parametrize(("per_mm", "bound"), [(4e5, 1_760_000_000), (1e6, (1 << 31) - 1)])
def test_the_bound_of_speed_is_as_high_as_a_drive_can_be_told(
    axes: list[Axis], per_mm: float, bound: int
) -> None:
    settings = replace(axes[0].settings, increments_per_mm=(per_mm,) * 3)
    fine = Axis(axes[0].network, settings, 1)
    fine.configure((-100.0, 200.0), 4000.0)
    assert fine.read(0x607F) == bound


def test_everything_that_protects_the_machine_is_in_the_drive(axes: list[Axis]) -> None:
    for axis in axes:
        axis.configure((-100.0, 200.0), 4000.0)
    settings = axes[0].settings
    plain, mirrored = axes[0], axes[1]
    assert [plain.read(0x607D, sub) for sub in (1, 2)] == [-100_000, 200_000]
    assert [mirrored.read(0x607D, sub) for sub in (1, 2)] == [-200_000, 100_000]
    expected = {
        (0x60C2, 1): 2,
        (0x60C2, 2): -3,
        (0x1016, 1): 127 << 16 | 250,
        (0x1017, 0): 50,
        (0x1400, 5): 20,
        (0x6007, 0): 3,
        (0x605A, 0): 6,
        (0x605E, 0): 2,
        (0x6065, 0): 15000,
        (0x6066, 0): 10,
        (0x607F, 0): 4_400_000,
        (0x6085, 0): 60_000_000,
        (0x1006, 0): 2000,
    }
    assert settings.cycle == 0.002
    for axis in axes:
        assert {key: axis.read(*key) for key in expected} == expected


def test_describing_changes_nothing(axis: Axis, drives: SimulatedDrives) -> None:
    before = drives.snapshot()
    report = axis.describe()
    assert report.identity.name == "Duoglide linear axis"
    assert report.identity.product_code == 0x4C415831
    assert report.state is State.SWITCH_ON_DISABLED
    assert not report.homed
    assert drives.snapshot() == before


def test_a_wrong_node_number_names_the_nodes_that_are_there(network: canopen.Network) -> None:
    axis = Axis(network, DriveSettings(node_ids=(9, 2, 3), boot_timeout=0.2), 1)
    with pytest.raises(
        DriveTimeout,
        match=r"node 9 does not answer .* nodes 1, 2, 3 do, of which node_ids does not name 1",
    ) as error:
        axis.wait_for_boot()
    assert error.value.axis == 1
    axis.close()


def test_a_bus_without_anybody_is_named(drives: SimulatedDrives, axis: Axis) -> None:
    for number in (1, 2, 3):
        drives.inject(faults.Reboot(number, delay=2.5))
    with pytest.raises(DriveTimeout, match="node 1 does not answer for 1 s; no other node does"):
        axis.wait_for_boot()


def test_a_drive_that_boots_late_is_waited_for(drives: SimulatedDrives, axis: Axis) -> None:
    drives.inject(faults.Reboot(1, delay=0.4))
    axis.wait_for_boot()
    assert axis.read_state() is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize(
    ("override", "words"),
    [
        (faults.Override(1, 0x1000, 0, 0x00020191), "no CiA 402 drive.*401"),
        (faults.Override(1, 0x6502, 0, 0x21), "does not know cyclic synchronous position"),
    ],
)
def test_a_drive_that_cannot_do_it_is_refused_before_power(
    drives: SimulatedDrives, axis: Axis, override: faults.Override, words: str
) -> None:
    drives.inject(override)
    with pytest.raises(DriveError, match=f"axis 1 .node 1.*{words}"):
        axis.identify()


@pytest.mark.parametrize("quirks", [Quirks(vendor_id=0x99), Quirks(product_code=7)])
def test_another_vendors_drive_is_refused(network: canopen.Network, quirks: Quirks) -> None:
    axis = with_quirks(network, DriveSettings(), quirks)
    with pytest.raises(DriveError, match="the machine file wants 0x000000"):
        axis.identify()
    axis.close()


def test_an_object_that_the_drive_lacks_is_named(network: canopen.Network) -> None:
    axis = with_quirks(network, DriveSettings(), Quirks(writes=((0x2345, 1, 5, 2),)))
    with pytest.raises(DriveError, match=r"writing 0x2345:1: refused, no such object"):
        axis.configure()
    axis.close()


def test_objects_that_the_machine_file_calls_absent_are_not_written(
    network: canopen.Network,
) -> None:
    quirks = Quirks(absent=(0x6065, 0x1006, 0x60FE), setpoint_timer=False)
    axis = with_quirks(network, DriveSettings(following_error_window=1.0), quirks)
    axis.configure()
    assert axis.read(0x6065) == 5000
    assert axis.read(0x1006) == 0
    assert axis.read(0x1400, 5) == 0
    axis.close()


def test_a_drive_that_counts_syncs_is_told_not_to(axis: Axis) -> None:
    axis.write(0x1019, 0, 10)
    axis.write(0x1006, 0, 4000)
    axis.configure()
    assert axis.read(0x1019) == 0
    assert axis.read(0x1006) == 2000


def test_a_value_that_the_drive_changes_is_noticed(drives: SimulatedDrives, axis: Axis) -> None:
    with pytest.raises(DriveError, match=r"0x6065:0: was written as 15000 but reads 1234 \[drives"):
        original = axis.read
        axis.read = lambda index, sub=0, timeout=None: (  # type: ignore[method-assign]
            1234 if index == 0x6065 else original(index, sub, timeout)
        )
        axis.configure()


def test_a_drive_in_fault_is_not_enabled_and_says_why(drives: SimulatedDrives, axis: Axis) -> None:
    drives.inject(faults.DeviceFault(1, 0x4310))
    with pytest.raises(DriveFault, match="over-temperature of the motor") as error:
        enable(axis)
    assert (error.value.axis, error.value.code) == (1, 0x4310)
    reset_fault(axis)
    enable(axis)
    assert axis.read_state() is State.OPERATION_ENABLED


def test_resetting_without_a_fault_does_nothing(axis: Axis) -> None:
    reset_fault(axis)
    assert axis.read_state() is State.SWITCH_ON_DISABLED


def test_safe_torque_off_is_said_before_anything_is_tried(
    drives: SimulatedDrives, axis: Axis
) -> None:
    drives.inject(faults.Sto(1))
    assert axis.describe().safe_torque_off
    with pytest.raises(DriveError, match="safe torque off"):
        enable(axis)


def test_safe_torque_off_under_power_is_a_fault_that_needs_its_circuit_closed(
    drives: SimulatedDrives, axis: Axis
) -> None:
    enable(axis)
    drives.inject(faults.Sto(1))
    with pytest.raises(DriveFault, match="safe torque off"):
        reset_fault(axis)
    drives.inject(faults.Sto(1, active=False))
    reset_fault(axis)
    enable(axis)


def test_enabling_does_not_jump_to_an_old_target(drives: SimulatedDrives, axis: Axis) -> None:
    axis.write(0x607A, 0, 50_000)
    before = drives.snapshot()[0].position
    enable(axis)
    time.sleep(0.05)
    assert drives.snapshot()[0].position == pytest.approx(before, abs=0.01)


def test_a_slow_drive_is_asked_again(drives: SimulatedDrives, axis: Axis) -> None:
    drives.inject(faults.SlowSdo(1, 0.15))  # one answer within 0.1 s was agreed
    assert axis.read(0x1000) == 0x00020192
    drives.inject(faults.Clear(1))
    assert axis.read(0x6065) == 5000  # and late answers are not taken for this one
    assert axis.read(0x6085) == 60_000_000


def test_a_drive_that_does_not_answer_is_a_timeout(drives: SimulatedDrives, axis: Axis) -> None:
    drives.inject(faults.SlowSdo(1, 10.0))
    with pytest.raises(DriveTimeout, match=r"reading 0x6041:0: no answer within 0.1 s, asked 6"):
        axis.read_state()


def test_the_sign_of_the_home_offset_is_found_out(network: canopen.Network) -> None:
    axis = with_quirks(network, DriveSettings(), Quirks(home_offset_sign=-1))
    axis.configure()
    enable(axis)
    axis.start_homing(-100.0)
    assert axis.homing_done()
    with pytest.raises(DriveError, match=r"says 100.000 mm after homing, should say -100.000"):
        axis.end_homing(-100.0)
    axis.close()


def test_a_homing_method_that_the_drive_lacks_fails_loudly(network: canopen.Network) -> None:
    settings = DriveSettings()
    homing = replace(settings.homing, method=(-5, 37, 37))
    axis = Axis(network, replace(settings, homing=homing), 1)
    axis.configure()
    enable(axis)
    axis.start_homing(0.0)
    with pytest.raises(DriveError, match="homing has failed"):
        axis.homing_done()
    axis.close()


def test_disabling_brakes_the_carriage_and_sets_the_brake(
    enabled: list[Axis], drives: SimulatedDrives
) -> None:
    for axis in enabled:
        disable(axis)
    for real in drives.snapshot():
        assert real.state is State.SWITCH_ON_DISABLED
        assert not real.brake_released


def test_a_quick_stop_holds_under_power(enabled: list[Axis], drives: SimulatedDrives) -> None:
    enabled[0].write(0x6040, 0, Control.QUICK_STOP)
    assert enabled[0].read_state() is State.QUICK_STOP_ACTIVE
    assert drives.snapshot()[0].brake_released
    disable(enabled[0])
    enable(enabled[0])


def test_a_drive_left_under_power_is_configured_without(enabled: list[Axis]) -> None:
    enabled[0].configure()
    assert enabled[0].read_state() is State.SWITCH_ON_DISABLED


def test_a_reboot_loses_the_reference(enabled: list[Axis], drives: SimulatedDrives) -> None:
    drives.inject(faults.Reboot(1))
    enabled[0].wait_for_boot()
    assert not enabled[0].read_homed()


def test_the_brake_can_be_set_through_the_outputs(
    enabled: list[Axis], drives: SimulatedDrives
) -> None:
    enabled[0].write(0x60FE, 1, 1)
    assert not drives.snapshot()[0].brake_released
    enabled[0].write(0x60FE, 1, 0)
    assert drives.snapshot()[0].brake_released


def test_a_drive_that_hears_no_more_setpoints_stops_by_itself(
    enabled: list[Axis], drives: SimulatedDrives, network: canopen.Network
) -> None:
    send = frame_sender(network.bus)
    start = time.monotonic()
    positions = [axis.read(0x6064) for axis in enabled]
    for k in range(100):
        target = [p + 10 * k for p in positions]
        frames = [(SYNC, b"")]
        for axis, t in zip(enabled, target, strict=True):
            frames.append((RPDO1 + axis.node_id, SETPOINT.pack(Control.ENABLE_OPERATION, t)))
        send(frames)
        time.sleep(max(0.0, start + 0.002 * (k + 1) - time.monotonic()))
    time.sleep(0.1)
    for axis, real in zip(enabled, drives.snapshot(), strict=True):
        assert real.state is State.QUICK_STOP_ACTIVE
        assert axis.read(0x603F) in (0x8700, 0x8250)
        assert real.velocity == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(
    ("cycle", "value"),
    [(0.002, (2, -3)), (0.0005, (5, -4)), (0.00125, (125, -5)), (0.1, (100, -3)), (0.5, (50, -2))],
)
def test_the_cycle_is_written_as_a_drive_takes_it(cycle: float, value: tuple[int, int]) -> None:
    number, exponent = interpolation_time(cycle)
    assert number * 10.0**exponent == pytest.approx(cycle, rel=1e-12)
    assert (number, exponent) == value


def test_a_cycle_that_no_drive_can_be_told_is_refused() -> None:
    with pytest.raises(ConfigError, match="0x60C2 cannot say that"):
        interpolation_time(0.0012345678)


def test_axes_can_search_their_references_together(network: canopen.Network) -> None:
    settings = DriveSettings(homing=Homing(method=(33, 34, 37), creep_speed=200.0))
    axes = [Axis(network, settings, number) for number in (1, 2, 3)]
    for axis in axes:
        axis.configure()
        enable(axis)
    for axis in axes:
        axis.start_homing(5.0)
    deadline = time.monotonic() + 60.0
    while not all(axis.homing_done() for axis in axes):
        assert time.monotonic() < deadline
    for axis in axes:
        assert axis.read_homed()
        axis.close()


def test_a_drive_that_can_only_stop_and_switch_off_does_so(network: canopen.Network) -> None:
    axis = with_quirks(network, DriveSettings(), Quirks(quick_stop_option=2))
    axis.configure()
    enable(axis)
    axis.write(0x6040, 0, Control.QUICK_STOP)
    axis.go_to(State.SWITCH_ON_DISABLED)
    axis.close()
