"""The state machine of a drive, as pure functions on words (CiA 402-2, IEC 61800-7-201).

Nothing here touches a bus. A statusword that matches no state raises: of the 65 536 words only
12 288 mean anything, and guessing at the rest is how a drive is enabled by accident.
"""

from __future__ import annotations

from enum import Enum, IntEnum, IntFlag

from duoglide.errors import DriveError


class State(Enum):
    """The states of a drive; the value is (mask, pattern) of its statusword, 0x6041."""

    NOT_READY_TO_SWITCH_ON = (0x004F, 0x0000)
    SWITCH_ON_DISABLED = (0x004F, 0x0040)
    READY_TO_SWITCH_ON = (0x006F, 0x0021)
    SWITCHED_ON = (0x006F, 0x0023)
    OPERATION_ENABLED = (0x006F, 0x0027)
    QUICK_STOP_ACTIVE = (0x006F, 0x0007)
    FAULT_REACTION_ACTIVE = (0x004F, 0x000F)
    FAULT = (0x004F, 0x0008)

    def __init__(self, mask: int, pattern: int) -> None:
        self.mask = mask  # of the bits that make the state ...
        self.pattern = pattern  # ... and what they are

    @property
    def words(self) -> str:
        """The state's name as a person writes it."""
        return self.name.replace("_", " ").lower()


class Status(IntFlag):
    """Bits of the statusword, 0x6041, that do not belong to the state."""

    VOLTAGE_ENABLED = 1 << 4
    WARNING = 1 << 7
    REMOTE = 1 << 9
    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT_ACTIVE = 1 << 11
    FOLLOWS_COMMAND = 1 << 12  # in CSP; in homing mode the same bit is HOMING_ATTAINED
    HOMING_ATTAINED = 1 << 12
    FOLLOWING_ERROR = 1 << 13  # in CSP; in homing mode the same bit is HOMING_ERROR
    HOMING_ERROR = 1 << 13


class Control(IntEnum):
    """Controlwords, 0x6040, that ask for a transition."""

    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007
    ENABLE_OPERATION = 0x000F
    START_HOMING = 0x001F  # enable operation with bit 4: in homing mode, go
    FAULT_RESET = 0x0080  # acts on the rising edge of bit 7 only
    HALT = 0x0100


class Command(Enum):
    """What a controlword commands, the way a drive reads it: (mask, pattern)."""

    DISABLE_VOLTAGE = (0x02, 0x00)
    QUICK_STOP = (0x06, 0x02)
    SHUTDOWN = (0x07, 0x06)
    SWITCH_ON = (0x0F, 0x07)  # in OPERATION_ENABLED: disable operation
    ENABLE = (0x0F, 0x0F)


_COMMANDS = tuple(next(c for c in Command if low & c.value[0] == c.value[1]) for low in range(16))


def command_of(controlword: int) -> Command:
    """Return what a controlword commands; every word commands something."""
    return _COMMANDS[controlword & 0x0F]


# Homing methods, 0x6098, by which the place where the carriage stands is the known one; 35 is what
# older editions of CiA 402 call 37.
METHODS_HERE = frozenset({35, 37})


class Mode(IntEnum):
    """Modes of operation, 0x6060 and 0x6061, that a linear axis uses."""

    NONE = 0
    PROFILE_POSITION = 1
    HOMING = 6
    CYCLIC_SYNCHRONOUS_POSITION = 8

    @property
    def supported_bit(self) -> int:
        """Which bit of 0x6502 says that the drive knows this mode; mode n has bit n - 1."""
        return 1 << (self.value - 1) if self.value else 0


def _lookup() -> tuple[State | None, ...]:
    """Tabulate the state of every combination of the seven low bits."""
    return tuple(next((s for s in State if low & s.mask == s.pattern), None) for low in range(128))


_STATES = _lookup()


def decode(statusword: int) -> State:
    """Return the state that a statusword means.

    Raises:
        DriveError: The word matches no CiA 402 state.
    """
    state = _STATES[statusword & 0x7F]
    if state is None:
        raise DriveError(f"statusword 0x{statusword:04X} matches no CiA 402 state")
    return state


_CLIMB = {
    State.SWITCH_ON_DISABLED: Control.SHUTDOWN,
    State.READY_TO_SWITCH_ON: Control.SWITCH_ON,
    State.SWITCHED_ON: Control.ENABLE_OPERATION,
    State.OPERATION_ENABLED: Control.ENABLE_OPERATION,
}
_ORDER = tuple(_CLIMB)


def controlword_towards(state: State, goal: State) -> Control | None:
    """Return the controlword that takes a drive one transition nearer to ``goal``.

    Args:
        state: Where the drive is.
        goal: SWITCH_ON_DISABLED, READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION_ENABLED or
            QUICK_STOP_ACTIVE.

    Returns:
        The controlword; None while the drive is in a state that it leaves by itself.

    Raises:
        DriveError: No controlword leads there: the drive is in FAULT (reset it on purpose), or
            ``goal`` cannot be commanded.
    """
    if state in (State.NOT_READY_TO_SWITCH_ON, State.FAULT_REACTION_ACTIVE):
        return None
    if state is State.FAULT:
        raise DriveError(f"the drive is in fault: reset it before going to {goal.words}")
    if goal is State.QUICK_STOP_ACTIVE:
        if state not in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE):
            raise DriveError(f"no quick stop from {state.words}")
        return Control.QUICK_STOP
    if goal not in _ORDER:
        raise DriveError(f"{goal.words} cannot be commanded")
    if state is State.QUICK_STOP_ACTIVE:
        return Control.DISABLE_VOLTAGE
    if _ORDER.index(state) < _ORDER.index(goal):
        return _CLIMB[state]
    return Control.DISABLE_VOLTAGE if goal is State.SWITCH_ON_DISABLED else _descend(goal)


def _descend(goal: State) -> Control:
    """Return the controlword that holds ``goal`` or comes down to it."""
    return {
        State.READY_TO_SWITCH_ON: Control.SHUTDOWN,
        State.SWITCHED_ON: Control.SWITCH_ON,
    }.get(goal, Control.ENABLE_OPERATION)


_EMERGENCIES = {
    0x0000: "no error, or an error was reset",
    0x1000: "generic error",
    0x2000: "current",
    0x2310: "continuous over-current",
    0x2320: "short circuit at the output",
    0x3000: "voltage",
    0x3210: "over-voltage in the DC link",
    0x3220: "under-voltage in the DC link",
    0x4000: "temperature",
    0x4210: "over-temperature of the drive",
    0x4310: "over-temperature of the motor",
    0x5000: "drive hardware",
    0x5441: "safe torque off (STO) is active",
    0x5530: "parameter memory",
    0x6000: "drive software",
    0x6010: "software reset (watchdog)",
    0x6320: "a parameter is out of range",
    0x7000: "additional modules",
    0x7121: "motor blocked",
    0x7305: "position sensor",
    0x7320: "position is lost",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun, frames were lost",
    0x8120: "CAN in error-passive mode",
    0x8130: "the master's heartbeat is missing",
    0x8140: "recovered from bus-off",
    0x8150: "CAN-ID collision",
    0x8200: "protocol",
    0x8210: "a PDO was too short and was not processed",
    0x8220: "a PDO was too long",
    0x8240: "SYNC has an unexpected length",
    0x8250: "setpoints are missing (RPDO time-out)",
    0x8611: "following error is too large",
    0x8612: "software position limit",
    0x8613: "homing failed",
    0x8700: "SYNC is missing",
    0x9000: "external error",
    0xF000: "additional functions",
    0xFF00: "device specific",
}


def emergency_words(code: int) -> str:
    """Say what an emergency error code means (CiA 301 table 26, CiA 402-2).

    An unknown code is described by its class, the way the standard groups them.
    """
    for mask in (0xFFFF, 0xFF00, 0xF000):
        if code & mask in _EMERGENCIES and (mask == 0xFFFF or code & mask):
            text = _EMERGENCIES[code & mask]
            return text if mask == 0xFFFF else f"{text} (code not named by the standard)"
    return "unknown error code"
