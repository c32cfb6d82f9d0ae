"""The application of a linear-axis drive: what its firmware does, in plain Python.

The twin of firmware_interface/reference_axis/axis.c. It knows no bus, no clock and no motor: time
comes as microseconds, the encoder as increments, and out come a demand for the servo, a
statusword and emergency codes. Behaviour in words: firmware_interface/README.md.
"""

from __future__ import annotations

from duoglide.drives.cia402 import Command, Mode, State, command_of
from duoglide.drives.pdo import INTERLOCK
from duoglide.drives.simulation.firmware.demand import FRACTION, SECOND, Phase
from duoglide.drives.simulation.firmware.objects import (
    ALLOWED,
    NO_OBJECT,
    OUT_OF_RANGE,
    WRONG_STATE,
    RefusalError,
    interpolation_period,
)
from duoglide.drives.simulation.firmware.status import AxisStatus
from duoglide.drives.simulation.firmware.watchdogs import HEARTBEAT_LOST, FollowingWatch, HostWatch

STO_ACTIVE = 0x5441
COMMUNICATION = 0x8100
FOLLOWING = 0x8611
HOMING_FAILED = 0x8613

_IDLE_TRANSITIONS = {
    (State.SWITCH_ON_DISABLED, Command.SHUTDOWN): State.READY_TO_SWITCH_ON,
    (State.READY_TO_SWITCH_ON, Command.SWITCH_ON): State.SWITCHED_ON,
    (State.READY_TO_SWITCH_ON, Command.ENABLE): State.OPERATION_ENABLED,
    (State.READY_TO_SWITCH_ON, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,
    (State.READY_TO_SWITCH_ON, Command.QUICK_STOP): State.SWITCH_ON_DISABLED,
    (State.SWITCHED_ON, Command.ENABLE): State.OPERATION_ENABLED,
    (State.SWITCHED_ON, Command.SHUTDOWN): State.READY_TO_SWITCH_ON,
    (State.SWITCHED_ON, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,
    (State.SWITCHED_ON, Command.QUICK_STOP): State.SWITCH_ON_DISABLED,
}


class FirmwareAxis(AxisStatus):
    """One axis. Call ``sync``, then ``setpoint`` if one has come, then ``tick`` as time passes."""

    def __init__(self) -> None:
        super().__init__()
        self._host = HostWatch()
        self._window = FollowingWatch()

    # -- what comes from the bus --------------------------------------------------------------

    def write(self, index: int, sub: int, value: int) -> None:
        """Write an object; RefusalError carries the abort code."""
        if (index, sub) not in self.objects:
            raise RefusalError(NO_OBJECT)
        if value not in ALLOWED.get((index, sub), (value,)):
            raise RefusalError(OUT_OF_RANGE)
        if index == 0x6060:
            self._change_mode(value)
            return
        before = self.objects[index, sub]
        self.objects[index, sub] = value
        if index == 0x6040:
            self._command(before, value)
        elif index == 0x607A and self._follows():
            self._aim(value)
        elif index == 0x60C2:
            self.period = interpolation_period(self.objects)
        elif index == 0x1016:
            self._host.heartbeat_armed = False

    def sync(self) -> None:
        """Note that a SYNC has come."""
        self._host.sync_age = 0

    def setpoint(self, controlword: int, target: int) -> None:
        """Take the controlword and the target position that were sent before this SYNC."""
        before = self.objects[0x6040, 0]
        self.objects[0x6040, 0] = controlword
        self.objects[0x607A, 0] = target
        self._host.take_setpoint(self._operational)
        self._command(before, controlword)
        if self._follows():
            self._aim(target)

    def heartbeat(self) -> None:
        """Note that the host is alive."""
        self._host.take_heartbeat()

    def communication(self, operational: bool) -> None:
        """Note that the node has entered or left NMT OPERATIONAL."""
        left = self._operational and not operational
        self._operational = operational
        if left:
            self._host.setpoint_armed = False
            if self.state is State.OPERATION_ENABLED:
                self._lose_communication(COMMUNICATION)

    def fault(self, code: int) -> None:
        """Take a fault: of the power stage, of the sensor, or one found here."""
        if self.state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
            return
        self._raise_emergency(code)
        ramp = self.powered and self.objects[0x605E, 0] == 2 and not self.sto
        self.state = State.FAULT_REACTION_ACTIVE if ramp else State.FAULT
        self._stop(State.FAULT)

    def set_sto(self, active: bool) -> None:
        """Set or clear safe torque off: at once no power, whatever the state."""
        self.sto = active
        if not active:
            return
        if self.powered:
            self.fault(STO_ACTIVE)
        elif self.state is not State.FAULT:
            self.state = State.SWITCH_ON_DISABLED

    def set_inputs(self, word: int) -> None:
        """Set the digital inputs, 0x60FD; the interlock's bit is not theirs."""
        self.inputs = word & ~INTERLOCK

    def take_emergencies(self) -> list[int]:
        """Return the emergency codes raised since the last call; 0: errors were reset."""
        taken, self._emergencies = self._emergencies, []
        return taken

    # -- time ---------------------------------------------------------------------------------

    def tick(self, dt: int, encoder: int) -> None:
        """Let ``dt`` microseconds pass, at whose end the encoder reads ``encoder`` increments."""
        position = encoder - self.origin
        self.velocity = (position - self.actual) * SECOND // dt if dt else 0
        self.actual = position
        if self.state is State.NOT_READY_TO_SWITCH_ON:
            self.state = State.SWITCH_ON_DISABLED
        self._watch(dt)
        if not self.powered:
            self.demand.place(position)
            self._limited = False
            return
        self.demand.advance(dt, self.objects[0x6085, 0])
        error = self.demand.position // FRACTION - position
        if self._window.exceeded(dt, error, self.objects[0x6065, 0], self.objects[0x6066, 0]):
            self._following_error = True
            self.fault(FOLLOWING)
        if self._after_stop is not None and self.demand.phase is Phase.HOLD:
            self.state, self._after_stop = self._after_stop, None

    def _watch(self, dt: int) -> None:
        """Watch the host: its heartbeat, and in CSP its setpoints and SYNC."""
        self._host.advance(dt)
        if self._host.lost_heartbeat(self.objects[0x1016, 1]):
            self._lose_communication(HEARTBEAT_LOST)
        enabled = self.state is State.OPERATION_ENABLED
        if enabled and self.mode == Mode.CYCLIC_SYNCHRONOUS_POSITION:
            code = self._host.lost_setpoints(self.objects[0x1400, 5])
            if code:
                self._lose_communication(code)

    # -- inside -------------------------------------------------------------------------------

    def _raise_emergency(self, code: int) -> None:
        self.error_code = code
        self._emergencies.append(code)

    def _lose_communication(self, code: int) -> None:
        """Do what 0x6007 says: nothing, fault, power off, or quick stop."""
        option = self.objects[0x6007, 0]
        if self.state is not State.OPERATION_ENABLED or option == 0:
            self._raise_emergency(code)
        elif option == 1:
            self.fault(code)
        else:
            self._raise_emergency(code)
            if option == 2:
                self._switch_off()
            else:
                self._quick_stop()

    def _stop(self, goal: State | None) -> None:
        """Brake; once it stands, go to ``goal``."""
        self.demand.brake()
        self._after_stop = goal if self.powered else None

    def _quick_stop(self) -> None:
        option = self.objects[0x605A, 0]
        if option == 0:
            self._switch_off()
            return
        self.state = State.QUICK_STOP_ACTIVE
        self._stop(State.SWITCH_ON_DISABLED if option == 2 else None)

    def _aim(self, target: int) -> None:
        """Follow a setpoint within the software limits and the greatest speed."""
        period = self.period
        low, high = self.objects[0x607D, 1], self.objects[0x607D, 2]
        goal = min(max(target, low), high) if self.homed and low < high else target
        reach = max(self.objects[0x607F, 0] * period // SECOND, 1)
        here = self.demand.position // FRACTION
        goal = min(max(goal, here - reach), here + reach)
        self._limited = goal != target
        self.demand.aim(goal, period)

    def _change_mode(self, mode: int) -> None:
        if self.powered and self.demand.velocity:
            raise RefusalError(WRONG_STATE)
        if mode != self.mode and self.powered:
            self._stand(self.demand.position // FRACTION)
        self.objects[0x6060, 0] = mode
        self._homing_done = self._homing_error = False

    def _stand(self, position: int) -> None:
        """Make ``position`` demand and target both."""
        self.demand.place(position)
        self.objects[0x607A, 0] = position

    def _command(self, before: int, word: int) -> None:
        """Act on a controlword (CiA 402-2, table of transitions)."""
        rising = word & ~before
        if rising & 0x80 and self.state is State.FAULT and not self.sto:
            self._reset_fault()
            return
        command = command_of(word)
        if self._after_stop is not None and command not in (
            Command.DISABLE_VOLTAGE,
            Command.QUICK_STOP,
        ):
            return
        if self.state is State.OPERATION_ENABLED:
            self._command_enabled(command, word, rising)
        elif self.state is State.QUICK_STOP_ACTIVE:  # no way back up: a host that has not
            if command is Command.DISABLE_VOLTAGE:  # noticed would still be commanding 0xF
                self._switch_off()
        elif (goal := _IDLE_TRANSITIONS.get((self.state, command))) is not None and not self.sto:
            if goal is State.OPERATION_ENABLED:
                self._enable()
            self.state = goal

    def _command_enabled(self, command: Command, word: int, rising: int) -> None:
        if command is Command.DISABLE_VOLTAGE:
            self._switch_off()
        elif command is Command.QUICK_STOP:
            self._quick_stop()
        elif command in (Command.SHUTDOWN, Command.SWITCH_ON):
            shutdown = command is Command.SHUTDOWN
            goal = State.READY_TO_SWITCH_ON if shutdown else State.SWITCHED_ON
            if self.objects[0x605B if shutdown else 0x605C, 0] == 1:
                self._stop(goal)
            else:
                self.state = goal
        else:
            self._halted = bool(word & 0x100)
            if self._halted:
                self.demand.brake()
            if self.mode == Mode.HOMING and rising & 0x10:
                self._home()

    def _switch_off(self) -> None:
        self.state = State.SWITCH_ON_DISABLED
        self._after_stop = None

    def _enable(self) -> None:
        """Begin to hold the carriage where it is; then the target acts, whatever it is."""
        self.demand.place(self.actual)
        self._halted = self._limited = False
        self._window.beyond = 0
        self._after_stop = None
        if self.mode == Mode.CYCLIC_SYNCHRONOUS_POSITION:
            self._aim(self.objects[0x607A, 0])

    def _reset_fault(self) -> None:
        self.state = State.SWITCH_ON_DISABLED
        self._following_error = False
        self.error_code = 0
        self._emergencies.append(0)

    def _home(self) -> None:
        """Homing method 37: here is the position 0x607C."""
        if self.objects[0x6098, 0] != 37:
            self._homing_error = True
            self._homing_done = False
            self._raise_emergency(HOMING_FAILED)
            return
        self.origin += self.actual - self.objects[0x607C, 0]
        self.actual = self.objects[0x607C, 0]
        self._stand(self.actual)
        self.homed = self._homing_done = True
        self._homing_error = False
