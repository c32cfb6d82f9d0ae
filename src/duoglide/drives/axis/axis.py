"""One drive, as the host sees it: objects, states, homing. Blocking calls over SDO.

Everything here is for bring-up and shut-down: nothing may be called from a callback of the bus,
and nothing belongs in the cycle.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

from duoglide.drives import pdo, standstill
from duoglide.drives.axis.configure import (
    Identity,
    Refusals,
    configure,
    identify,
    list_homing,
    wait_for_boot,
)
from duoglide.drives.axis.objects import DriveObjects
from duoglide.drives.axis.sdo_client import ObjectError, SdoRefusalError
from duoglide.drives.axis.units import read_units
from duoglide.drives.cia402 import (
    Control,
    Mode,
    State,
    Status,
    controlword_towards,
    decode,
    emergency_words,
)
from duoglide.drives.scale import RateUnits
from duoglide.errors import DriveFault, DriveTimeout
from duoglide.machine.drive_contract import answer_to
from duoglide.machine.drive_quirks import Interlock

_SIMULATED_HOMED = 0x2010  # of the drive of firmware_interface/
_FIRST_PAUSE, _LONGEST_PAUSE = 0.002, 0.05  # between two looks at an object [s]
_STATE_PATIENCE = 2.0  # how long a drive may take for one change of state [s]


def growing_pauses() -> Iterator[float]:
    """Yield how long to wait before each next look at a drive, more and more [s].

    A quick drive is not kept waiting, and a slow one is not asked the same hundreds of times.
    """
    pause = _FIRST_PAUSE
    while True:
        yield pause
        pause = min(2.0 * pause, _LONGEST_PAUSE)


@dataclass(frozen=True, slots=True)
class AxisReport:
    """What a drive says while nothing is asked of it: for commissioning."""

    axis: int
    node_id: int
    identity: Identity
    state: State
    error: str
    position: float  # [mm], meaningful once homed
    homed: bool | None  # None: the drive cannot say
    safe_torque_off: bool
    units: RateUnits


class Axis(DriveObjects):
    """One drive: ``DriveObjects`` and what one does with them."""

    @cached_property
    def units(self) -> RateUnits:
        """What its velocities and accelerations mean; asked of the drive at the first use."""
        return read_units(self)

    # -- bring-up -----------------------------------------------------------------------------

    def wait_for_boot(self) -> None:
        """Wait until the drive answers at all; DriveTimeout after ``boot_timeout``."""
        wait_for_boot(self)

    def identify(self) -> Identity:
        """Find out what the drive is; DriveError if it is not what the machine file says."""
        return identify(self)

    def configure(
        self, travel: tuple[float, float] | None = None, speed: float | None = None
    ) -> None:
        """Write everything that the drive must know before it gets power.

        Args:
            travel: Software limits, 0x607D [mm]; None leaves those of the drive.
            speed: Greatest one that it will be asked for, 0x607F [mm/s]; None leaves its own.
        """
        if self.read_state() in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE):
            self.go_to(State.SWITCH_ON_DISABLED)  # somebody left it under power
        configure(self, lambda: self.units, travel, speed)

    def limit_travel(self, travel: tuple[float, float]) -> None:
        """Write the software limits, 0x607D, of a drive that knows where it is.

        Args:
            travel: The limits [mm].
        """
        for sub, value in enumerate(sorted(map(self.scale.to_increments, travel)), start=1):
            if self.has(0x607D):
                self.write_checked(0x607D, sub, value)

    # -- what it says -------------------------------------------------------------------------

    def read_statusword(self) -> int:
        """Return the statusword, 0x6041."""
        return self.read(0x6041)

    def read_state(self) -> State:
        """Return the state; DriveError if the statusword means none."""
        return decode(self.read_statusword())

    def read_position(self) -> float:
        """Return where the drive says the carriage is [mm]."""
        return self.scale.to_mm(self.read(0x6064))

    def read_inputs(self) -> int:
        """Return the digital inputs, 0x60FD; 0 where the drive has none."""
        return self.read(0x60FD) if self.has(0x60FD) else 0

    @property
    def simulated(self) -> bool:
        """Whether the drive carries the signature of Duoglide's own simulation."""
        try:
            return self.read_bytes(standstill.INDEX, standstill.SIGN) == standstill.signature()
        except SdoRefusalError:
            return False

    def read_homed(self) -> bool | None:
        """Whether the drive remembers its reference; None where it cannot say.

        An object outside CiA 301 and 402 means what its maker wants: it counts where the machine
        file names it, or where the drive is one of Duoglide's own simulation.
        """
        index = self.quirks.homed_object
        if not index and self.has(_SIMULATED_HOMED) and self.simulated:
            index = _SIMULATED_HOMED
        if not index:
            return None
        try:
            return int.from_bytes(self.read_bytes(index, 0), "little") == 1
        except SdoRefusalError as refusal:
            raise self.error(
                f"0x{index:04X} cannot be read: drives.quirks homed_object = 0 goes without it"
            ) from refusal

    def read_identity(self, sub: int) -> int:
        """Return a field of 0x1018; 0 where the drive does not have it."""
        try:
            return int.from_bytes(self.read_bytes(0x1018, sub), "little")
        except SdoRefusalError:
            return 0

    def safe_torque_off(self) -> bool:
        """Whether the safe torque off circuit is open."""
        interlock = self.quirks.interlock
        if interlock is Interlock.NONE or not self.has(0x60FD):
            return False
        return bool(self.read_inputs() & pdo.INTERLOCK) is (interlock is Interlock.SET)

    def read_error_code(self) -> int:
        """Return the code of the fault, 0x603F or the newest of 0x1003; 0 where neither says it."""
        if self.has(0x603F):
            with suppress(SdoRefusalError):  # not worth a refusal: it only names what is known
                return self.read(0x603F)
        with suppress(SdoRefusalError):
            return self.read(0x1003, 1) & 0xFFFF
        return 0

    def fault(self) -> DriveFault:
        """Make the error for the fault that the drive is in."""
        code = self.read_error_code()
        cause = f"0x{code:04X}, {emergency_words(code)}" if code else "of unknown cause"
        return DriveFault(
            f"axis {self.number} (node {self.node_id}): fault {cause};"
            " once its cause is gone, reset_fault() acknowledges it",
            axis=self.number,
            code=code,
        )

    def ask_standstill(self) -> float:
        """Return for how long the drive stands still with this computer [s]; a real one never does.

        Whoever asks promises to stand still with it.
        """
        try:
            return standstill.seconds_in(self.read_bytes(standstill.INDEX, 0))
        except SdoRefusalError:
            return 0.0

    def describe(self) -> AxisReport:
        """Ask the drive what it is and how it is; changes nothing."""
        identity = self.identify()
        code = self.read_error_code()
        return AxisReport(
            axis=self.number,
            node_id=self.node_id,
            identity=identity,
            state=self.read_state(),
            error=emergency_words(code) if code else "",
            position=self.read_position(),
            homed=self.read_homed(),
            safe_torque_off=self.safe_torque_off(),
            units=self.units,
        )

    # -- states -------------------------------------------------------------------------------

    def set_mode(self, mode: Mode) -> None:
        """Choose the mode of operation and wait until the drive is in it."""
        self.write(0x6060, 0, mode)
        deadline, pauses = time.monotonic() + _STATE_PATIENCE, growing_pauses()
        while self.read(0x6061) != mode:
            if time.monotonic() > deadline:
                raise DriveTimeout(
                    f"axis {self.number} (node {self.node_id}): does not go into mode {mode.value}"
                    f" within {_STATE_PATIENCE:g} s",
                    axis=self.number,
                )
            time.sleep(next(pauses))

    def go_to(self, goal: State) -> None:
        """Walk to a state, one transition after the other.

        Raises:
            DriveFault: The drive is in fault, or falls into it on the way.
            DriveTimeout: A transition takes too long.
        """
        deadline, pauses = time.monotonic() + _STATE_PATIENCE, growing_pauses()
        while (state := self.read_state()) is not goal:
            if state is State.FAULT:
                raise self.fault()
            if time.monotonic() > deadline:
                raise DriveTimeout(
                    f"axis {self.number} (node {self.node_id}): stays in {state.words}"
                    f" for {_STATE_PATIENCE:g} s instead of going to {goal.words}",
                    axis=self.number,
                )
            word = controlword_towards(state, goal)
            if word is not None:
                self.write(0x6040, 0, word)
            time.sleep(next(pauses))

    # -- homing -------------------------------------------------------------------------------

    def prepare_homing(self, position: float) -> None:
        """Say how to home, and go into homing mode; nothing begins before bit 4 rises.

        All of it is read back before it returns: a drive that begins on the level of bit 4, or with
        what it has in memory, must find everything in its place.

        Args:
            position: Where the carriage is once homing ends [mm]. Method 37: where it stands.
        """
        refusals = Refusals(self)
        for index, sub, value in list_homing(self, self.units):
            if self.has(index):
                with refusals.collected():
                    self.write_checked(index, sub, value)
        offset = self.quirks.home_offset_sign * self.scale.to_increments(position)
        with refusals.collected():
            self._write_home(offset)
        refusals.raise_them()
        self.set_mode(Mode.HOMING)

    def start_homing(self, position: float) -> None:
        """Prepare homing, and begin it by SDO; the drive must be enabled, and nobody else stream.

        Args:
            position: As for ``prepare_homing``.
        """
        self.prepare_homing(position)
        self.write(0x6040, 0, Control.ENABLE_OPERATION)
        self.write(0x6040, 0, Control.START_HOMING)

    def _write_home(self, position: int) -> None:
        """Write the position at the place of reference [increments] and read it back."""
        index, sub = self.quirks.home_object
        if not self.has(index):
            if position:
                raise ObjectError(
                    f"axis {self.number} (node {self.node_id}), 0x{index:04X}:{sub}: is absent, so"
                    f" that homing could only end at 0, and must end at {position} increments",
                    axis=self.number,
                    index=index,
                    sub=sub,
                )
            return
        data = position.to_bytes(4, "little", signed=True)
        self.write_bytes(index, sub, data)
        if (kept := self.read_bytes(index, sub)) != data:
            value = int.from_bytes(kept, "little", signed=True)
            raise self.mismatch(index, sub, position, value)

    def homing_done(self) -> bool:
        """Whether the drive has found its reference and stands.

        Raises:
            DriveError: Homing has failed.
            DriveFault: The drive is in fault.
        """
        word = self.read_statusword()
        if decode(word) is State.FAULT:
            raise self.fault()
        if word & Status.HOMING_ERROR:
            method = self.settings.homing.method[self.number - 1]
            raise self.error(
                f"homing has failed, by method {method}; {answer_to(0x6098, 0)}", 0x8613
            )
        done = Status.HOMING_ATTAINED | Status.TARGET_REACHED
        return word & done == done

    def end_homing(self, position: float) -> None:
        """Go back to CSP and see that the drive now counts from the right place.

        Raises:
            DriveError: 0x6064 is not what it should be: vendors differ in the sign of 0x607C.
        """
        self.write(0x6040, 0, Control.ENABLE_OPERATION)
        self.write(0x607A, 0, self.read(0x6064))
        self.set_mode(Mode.CYCLIC_SYNCHRONOUS_POSITION)
        says = self.read_position()
        if abs(says - position) > self.settings.following_error_window:
            sign = self.quirks.home_offset_sign
            opposite = abs(says + position) <= self.settings.following_error_window
            answer = f"home_offset_sign = {-sign}" if opposite else "home_object may be another one"
            raise self.error(
                f"says {says:.3f} mm after homing, should say {position:.3f} mm;"
                f" drives.quirks {answer}"
            )
