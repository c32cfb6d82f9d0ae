"""What has been heard of each drive."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from duoglide.drives import pdo
from duoglide.drives.cia402 import Mode, State, Status
from duoglide.drives.cia402 import decode as decode_state
from duoglide.errors import DriveError

_LIMIT = int(Status.INTERNAL_LIMIT_ACTIVE)  # a plain number: an IntFlag's & costs 1.5 us
_NO_NMT = -1
_COMMUNICATION = 0x8100  # emergency codes of drives that do not hear their host, and stop (0x6007)
_NOT_HEARD = (0x8250, 0x8700)  # setpoints, or SYNC
_BRIDGED = 1  # words in a row that cannot be, as one lost frame is
_STARTED = frozenset(State) - {State.NOT_READY_TO_SWITCH_ON}
_SETTLING = 3  # cycles with feedback after which it surely answers the SYNC before


@dataclass(slots=True)
class AxisView:
    """What a cycle saw of one drive; written anew every cycle, never kept."""

    state: State | None = State.SWITCH_ON_DISABLED
    statusword: int = 0
    actual: int = 0
    emergency: int = 0
    following: float = 0.0  # from where the drive's model expects it [increments] ...
    allowed: float = float("inf")  # ... and how much that may be
    stays: bool = False  # that the average of it is too much
    away: bool = False  # that it gets away from its setpoints ...
    far: bool = False  # ... so far that it does not hear them any more
    missing: int = 0
    alone: int = 0  # of those missing, while another drive answered
    heartbeat: int = 0
    limited: int = 0  # cycles in a row with bit 11
    nmt: int = pdo.NmtState.OPERATIONAL
    booted: bool = False

    @property
    def is_deaf(self) -> bool:
        """Whether it says that it does not hear its host."""
        return self.emergency & 0xFF00 == _COMMUNICATION or self.emergency in _NOT_HEARD


def _state_of(statusword: int) -> State | None:
    """Return the state that a statusword means; None for none."""
    try:
        return decode_state(statusword)
    except DriveError:
        return None


class AxisTrack:
    """The last words of one drive.

    Attributes:
        statusword: 0x6041.
        actual: 0x6064 [increments].
        state: Decoded statusword; None where it matches no state.
        inputs: 0x60FD.
        mode: 0x6061.
        nmt: NMT state of its last heartbeat; -1 before the first.
        missing: Cycles in a row without feedback.
        limited: Cycles in a row in which it bounded what it was asked for: statusword, bit 11.
        alone: Of those, the cycles in which another drive gave some.
        garbled: Cycles in a row with a statusword that cannot be: it matches no state, or says that
            the drive is still starting, which it has done.
        gap: Cycles in a row without feedback before the last that came.
        regular: Cycles in a row with feedback.
        silence: Cycles since its last heartbeat.
    """

    __slots__ = (
        "_feedback", "actual", "alone", "boots", "emergencies", "gap", "garbled", "inputs",
        "limited",        "missing", "mode", "nmt", "regular", "silence", "state", "statusword",
    )  # fmt: skip

    def __init__(self) -> None:
        self.statusword = 0
        self.actual = 0
        self.state: State | None = State.NOT_READY_TO_SWITCH_ON
        self.inputs = 0
        self.mode = 0
        self.nmt = _NO_NMT
        self.limited = 0
        self.missing = 0
        self.alone = 0
        self.gap = self.garbled = 0
        self.regular = 0
        self.silence = 0
        self.boots = 0
        self.emergencies: deque[int] = deque(maxlen=16)
        self._feedback: deque[bytes] = deque(maxlen=8)

    @property
    def homing(self) -> bool:
        """Whether the drive has said that it is in homing mode."""
        return self.mode == Mode.HOMING

    @property
    def certain(self) -> bool:
        """Whether the feedback surely answers the SYNC before: the first after a gap may not."""
        return self.regular > 1

    @property
    def settled(self) -> bool:
        """Whether feedback has been regular for so long that it may be judged."""
        return self.regular > _SETTLING

    @property
    def follows(self) -> bool:
        """Whether the drive is under power and not busy with homing."""
        return self.state is State.OPERATION_ENABLED and not self.homing

    def on_feedback(self, data: bytes) -> None:
        """Keep a TPDO1 for the next ``end_of_cycle``."""
        if len(data) >= pdo.FEEDBACK.size:
            self._feedback.append(data)

    def on_inputs(self, data: bytes) -> None:
        """Read a TPDO2."""
        if len(data) >= pdo.INPUTS.size:
            self.inputs, self.mode = pdo.INPUTS.unpack_from(data)

    def on_emergency(self, data: bytes) -> None:
        """Read an EMCY; short ones count too."""
        self.emergencies.append(pdo.unpack_emergency(data).code)

    def on_heartbeat(self, data: bytes) -> None:
        """Read a heartbeat or boot-up."""
        state = data[0] & 0x7F if data else _NO_NMT
        self.silence = 0
        if state == pdo.NmtState.BOOT_UP:
            self.boots += 1
        self.nmt = state

    def end_of_cycle(self, cycles: int) -> None:
        """Take the feedback that belongs to the SYNC before the one just sent.

        A second one in the same cycle answers the SYNC just sent (this process was held up) and is
        kept; but after a gap, until all is regular again, it is the late answers that are passed
        over: whoever kept them would be behind by a cycle from then on.
        """
        self.silence += cycles
        queue = self._feedback
        if not queue:
            self._miss()
            return
        if not self.settled or len(queue) > 2:
            while len(queue) > 1:
                queue.popleft()
        statusword, actual = pdo.FEEDBACK.unpack_from(queue.popleft())
        state = _state_of(statusword)
        booting = state is State.NOT_READY_TO_SWITCH_ON and self.state in _STARTED
        if (state is None or booting) and self.garbled < _BRIDGED:
            self.garbled += 1
            self._miss()
            return
        self.gap = self.missing or self.gap
        self.missing = self.alone = self.garbled = 0
        self.regular += 1
        self.statusword, self.actual, self.state = statusword, actual, state
        self.limited = self.limited + 1 if statusword & _LIMIT else 0

    def _miss(self) -> None:
        """Go on with what was heard last."""
        self.missing += 1
        self.regular = 0

    def fill(self, view: AxisView) -> None:
        """Write what the supervisor wants to know; empties the emergencies and boot-ups."""
        view.state, view.statusword, view.actual = self.state, self.statusword, self.actual
        view.missing, view.alone, view.heartbeat = self.missing, self.alone, self.silence
        view.limited = self.limited
        view.nmt = self.nmt if self.nmt != _NO_NMT else pdo.NmtState.OPERATIONAL
        view.booted, self.boots = self.boots > 0, 0
        view.emergency = next((code for code in self.emergencies if code), 0)
        self.emergencies.clear()
