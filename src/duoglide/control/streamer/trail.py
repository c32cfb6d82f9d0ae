"""Whether a carriage is where its setpoints lead: judged against the model of its drive.

LinuxCNC's rule (FERROR, MIN_FERROR): what is allowed grows with the speed and is tight at rest. It
is applied to the distance from where ``drives.trailing`` expects the carriage, not from the
setpoint. Beside it two things are watched that such a rule lets pass: a distance that stays, and a
departure that begins, which is how setpoints show that were lost on the bus.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from duoglide.drives.trailing import TrailFit, bend_of, step_of

if TYPE_CHECKING:
    from duoglide.control.channel.orders import TrailRule

_CURVE = 5.0  # cycles^2 of acceleration by which a drive may trail that is not known well
_LASTING = 50.0  # cycles over which an offset is averaged
_ENOUGH = 30  # cycles that have been averaged before an offset counts
_MEMORY = 2000.0  # cycles in motion that the lag is learned from
_LEARN = 4  # cycles between two looks at what has been learned
_CALM = 10  # cycles without a departure, after which it is over
_LONGEST = 100  # cycles after which a departure is told although it goes on


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
    """

    __slots__ = (
        "_bend", "_calm", "_cycles", "_departure", "_fit", "_lag", "_last", "_mean", 
        "allowed", "departed", "off", "rule", "worst",
    )  # fmt: skip

    def __init__(self, rule: TrailRule) -> None:
        self.rule = rule
        self._fit = TrailFit(_MEMORY)
        self._lag = self._bend = 0.0  # learned, beyond what is known
        self.reset()

    def reset(self) -> None:
        """Begin anew where the power comes on; what was learned of the drive stays."""
        self._mean = self._last = 0.0
        self._cycles = self._calm = 0
        self.off = self.allowed = self.worst = 0.0
        self.departed = 0

    @property
    def stays(self) -> bool:
        """Whether a distance lasts that is more than it may be."""
        return self._cycles > _ENOUGH and abs(self._mean) > self.rule.lasting

    def see(
        self, actual: int, before: int, due: int, after: int, margin: float, unsure: float
    ) -> None:
        """Take a cycle with feedback.

        Args:
            actual: Position at a SYNC [increments].
            before: Setpoint that was due one cycle earlier.
            due: Setpoint that was due at this SYNC.
            after: Setpoint that is due one cycle later.
            margin: What the plan has left there for a carriage [increments].
            unsure: By how many cycles more or less the feedback may be of another SYNC, because
                frames or cycles were lost just now; 0 where it is sure.
        """
        rule = self.rule
        step, bend = step_of(before, after), bend_of(before, due, after)
        off = actual - due + rule.lag * step + rule.bend * bend
        self.off = abs(off)
        grown = max(rule.at_rest, rule.growth * abs(step)) + _CURVE * abs(bend)
        self.allowed = min(grown, rule.window, margin)
        if unsure:
            self.allowed += unsure * max(abs(after - due), abs(due - before))
            return
        left = off + self._lag * step + self._bend * bend
        self._mean += (left - self._mean) / _LASTING
        self._cycles += 1
        self._watch_departure(abs(left))
        if step or bend:
            self._fit.add(off, step, bend)
            if not self._cycles % _LEARN:
                self._lag, self._bend, _ = self._fit.solve()

    def _watch_departure(self, left: float) -> None:
        """Count cycles in which the carriage gets away from where it was expected."""
        if left > self.rule.departure:
            self.departed += left >= self._last  # what swings back is no other loss
            self.worst, self._calm = max(self.worst, left), 0
        else:
            self._calm += 1
        self._last = left

    @property
    def departure_is_over(self) -> bool:
        """Whether there has been a departure that is to be told."""
        return bool(self.departed) and (self._calm >= _CALM or self.departed >= _LONGEST)

    def forget_departure(self) -> None:
        """It has been told."""
        self.departed, self.worst = 0, 0.0
