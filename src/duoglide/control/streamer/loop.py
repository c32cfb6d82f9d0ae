"""When cycles begin: absolute deadlines, late ones skipped."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from duoglide.control.streamer.clock import Clock


class Cyclic(Protocol):
    """Something that is done once a cycle.

    Attributes:
        done: Whether there is nothing left to do.
        standstill: Up to which lateness the schedule is moved, as simulated drives stand still with
            this computer; 0 on real ones [ns].
    """

    done: bool
    standstill: int

    def cycle(self, number: int, time: int, lateness: int, skipped: int) -> None:
        """Do one cycle.

        Args:
            number: Of this cycle; skipped ones count.
            time: Now [ns].
            lateness: How long after its deadline it begins [ns].
            skipped: How many cycles before it were left out.
        """
        ...


def run_cycles(work: Cyclic, clock: Clock, period: int) -> None:
    """Run cycles on absolute deadlines until the work is done.

    A cycle that begins more than a period late has missed the next ones: they are skipped, and
    the schedule stays what it was. Nothing is ever sent twice to catch up.

    Where the drives are simulated on this computer and it stands still, they stand still too: the
    schedule is moved by what was lost, and no cycle is skipped.

    Args:
        work: What to do.
        clock: Whose deadlines.
        period: Of the cycle [ns].
    """
    deadline, number = clock.now() + period, 0
    while not work.done:
        clock.sleep_until(deadline)
        now = clock.now()
        lateness = now - deadline
        skipped = lateness // period
        if skipped and lateness <= work.standstill:
            skipped, deadline = 0, now
        deadline += (1 + skipped) * period
        number += 1 + skipped
        work.cycle(number, now, lateness, skipped)
