"""Whether a carriage is where its setpoints lead: judged against the model of its drive.

LinuxCNC's rule (FERROR, MIN_FERROR): what is allowed grows with the speed and is tight at rest. It
is applied to the distance from where ``drives.trailing`` expects the carriage, not from the
setpoint. Beside it two things are watched that such a rule lets pass: a distance that stays, and a
departure that begins, which is how setpoints show that were lost on the bus.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

from duoglide.drives.trailing import TrailFit, bend_of, step_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from duoglide.control.channel.orders import TrailRule

_CURVE = 5.0  # cycles^2 of acceleration by which a drive may trail that is not known well
_LASTING = 50.0  # cycles over which an offset is averaged
_ENOUGH = 30  # cycles that have been averaged before an offset counts
_MEMORY = 2000.0  # cycles in motion that the lag is learned from
_LEARN = 4  # cycles between two looks at what has been learned
_MOST_LAG = 0.25  # cycles of lag that are taken as a drive's own without being told ...
_MOST_BEND = 20.0  # ... and cycles^2; more is for ``drives.lag`` to say
_MORE = 3.0  # times the usual distance, from which on it is a departure
_BRIDGED = 2  # cycles in a row in which a carriage gets away
_FAR = 10.0  # times a departure; few setpoints lost in a row do not come to that
_CALM = 10  # cycles without a departure, after which it is over
_LONGEST = 100  # cycles after which a departure is told although it goes on
_REMEMBERED = 16  # cycles


class Trodden(NamedTuple):
    """Where a carriage was in a cycle [increments].

    Attributes:
        due: The setpoint that was due there.
        actual: Where it was.
    """

    due: int
    actual: int


class AxisTrail:
    """What one carriage does about its setpoints.

    Args:
        rule: What is known of its drive, and what is allowed.

    Attributes:
        rule: As given.
        off: Distance from where the model expects it [increments]; 0 where it is not known.
        allowed: What it may be at this speed [increments].
        departed: Cycles of the departure under way, or of the one that is over.
        worst: Its greatest distance [increments].
        steps: The newest cycles in a row whose feedback is sure, the newest last.
    """

    __slots__ = (
        "_bend", "_calm", "_cycles", "_fit", "_lag", "_last", "_mean", "_row", "_usual",
        "allowed", "departed", "off", "rule", "steps", "worst",
    )  # fmt: skip

    def __init__(self, rule: TrailRule) -> None:
        self.rule = rule
        self._fit = TrailFit(_MEMORY)
        self._lag = self._bend = 0.0  # learned, beyond what is known
        self.steps: deque[Trodden] = deque(maxlen=_REMEMBERED)
        self.reset()

    def reset(self) -> None:
        """Begin anew where the power comes on; what was learned of the drive stays."""
        self._mean = self._last = self._usual = 0.0
        self._cycles = self._calm = self._row = 0
        self.steps.clear()
        self.off = self.allowed = self.worst = 0.0
        self.departed = 0

    @property
    def stays(self) -> bool:
        """Whether a distance lasts that is more than it may be."""
        return self._cycles > _ENOUGH and abs(self._mean) > self.rule.lasting

    def see(self, actual: int, due: Sequence[int], margin: float, unsure: float) -> None:
        """Take a cycle with feedback.

        Args:
            actual: Position at a SYNC [increments].
            due: Setpoints in the order in which they were due; the last but one was due at this
                SYNC, the last is due one cycle later.
            margin: What the plan has left there for a carriage [increments].
            unsure: By how many cycles more or less the feedback may be of another SYNC, because
                frames or cycles were lost just now; 0 where it is sure.
        """
        rule = self.rule
        before, here, after = due[-3:]
        step, bend = step_of(before, after), bend_of(before, here, after)
        off = actual - here + rule.lag * step + rule.bend * bend
        self.off = abs(off)
        grown = max(rule.at_rest, rule.growth * abs(step)) + _CURVE * abs(bend)
        self.allowed = min(grown, rule.window, margin)
        if unsure:
            self.steps.clear()
            self.allowed += unsure * max(abs(after - here), abs(here - before))
            self._row = 0
            return
        self.remember(actual, due)
        left = off + self._lag * step + self._bend * bend
        late = abs(left) > rule.departure and not self._row and self._is_late(actual, due)
        if late:
            left = 0.0
        self._usual += (abs(left) - self._usual) / _LASTING
        self._mean += (left - self._mean) / _LASTING
        self._cycles += 1
        self._watch_departure(left)
        if (step or bend) and not late:
            self._learn(off, step, bend)

    def remember(self, actual: int, due: Sequence[int]) -> None:
        """Keep where it was: takes what ``see`` does. Of a drive that leads, nothing is judged."""
        self.steps.append(Trodden(due[-2], actual))

    @property
    def lag(self) -> float:
        """By how many cycles of speed it trails, as far as is known."""
        return self.rule.lag + self._lag

    @property
    def bend(self) -> float:
        """By how many squared cycles of acceleration, likewise."""
        return self.rule.bend + self._bend

    @property
    def _threshold(self) -> float:
        """What counts as a departure: more than is usual with this drive [increments]."""
        return max(self.rule.departure, _MORE * self._usual)

    def _is_late(self, actual: int, due: Sequence[int]) -> bool:
        """Whether all is as it should be, but by whole cycles later.

        That is a delay of the bus or of the drive, which the report names; it is no loss. One that
        begins in motion passes through other places, and is a departure like any other.
        """
        lag, bend = self.rule.lag, self.rule.bend
        for cycles in range(1, len(due) - 2):
            before, here, after = due[-3 - cycles : len(due) - cycles]
            expected = here - lag * step_of(before, after) - bend * bend_of(before, here, after)
            if abs(actual - expected) <= self._threshold:
                return True
        return False

    def _learn(self, off: float, step: float, bend: float) -> None:
        """Take in how the drive trails, beyond what is known of it, within what is usual."""
        self._fit.add(off, step, bend)
        if not self._cycles % _LEARN:
            lag, bend, _ = self._fit.solve()
            self._lag = min(max(lag, -_MOST_LAG), _MOST_LAG)
            self._bend = min(max(bend, -_MOST_BEND), _MOST_BEND)

    def _watch_departure(self, left: float) -> None:
        """Count cycles in which the carriage gets away from where it was expected."""
        distance = abs(left)
        if distance > self._threshold:
            if distance >= abs(self._last):  # what swings back is no other loss
                self.departed += 1
                self._row += 1
            self.worst, self._calm = max(self.worst, distance), 0
        else:
            self._calm += 1
            self._row = 0
        self._last = left

    @property
    def breaks_away(self) -> bool:
        """Whether the carriage is getting away from its setpoints, too far to be bridged."""
        return self._row >= _BRIDGED and abs(self._last) > self.rule.lasting

    @property
    def is_far(self) -> bool:
        """Whether it gets away so far that its drive does not hear its setpoints any more."""
        return self._row >= _BRIDGED and abs(self._last) > _FAR * self.rule.departure

    @property
    def departure_is_over(self) -> bool:
        """Whether there has been a departure that is to be told."""
        return bool(self.departed) and (self._calm >= _CALM or self.departed >= _LONGEST)

    def forget_departure(self) -> None:
        """It has been told."""
        self.departed, self.worst = 0, 0.0
