"""How late cycles begin on this computer: ``python -m duoglide.control.streamer.lateness S HZ``.

Runs the streamer's own clock with nothing to do, with the priority and the memory that the kernel
grants, and beside it the loop that a process would have that asks for neither: relative sleeps in
an ordinary thread of a process of its own. Prints one JSON object.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import asdict

from duoglide.control.streamer.clock import NANOSECONDS, MonotonicClock, run_cycles
from duoglide.control.streamer.realtime import become_realtime

_QUANTILES = {"median": 0.5, "p99": 0.99, "worst": 1.0}


class _Idle:
    """A cycle that only notes how late it is."""

    standstill = 0

    def __init__(self, cycles: int) -> None:
        self.late: list[int] = []
        self.skipped = 0
        self.done = False
        self._cycles = cycles

    def cycle(self, number: int, time: int, lateness: int, skipped: int) -> None:
        """Note it."""
        self.late.append(lateness)
        self.skipped += skipped
        self.done = len(self.late) + self.skipped >= self._cycles


def _summarise(nanoseconds: list[int]) -> dict[str, float]:
    """Return quantiles in microseconds."""
    ranked = sorted(nanoseconds)
    return {
        name: ranked[round(share * (len(ranked) - 1))] * 1e-3 for name, share in _QUANTILES.items()
    }


def _sleep_plainly(seconds: float, period: float) -> dict[str, float]:
    """Return the lateness of relative sleeps."""
    late, due = [], time.monotonic()
    end = due + seconds
    while due < end:
        due += period
        time.sleep(max(0.0, due - time.monotonic()))
        late.append(round((time.monotonic() - due) * NANOSECONDS))
        due = max(due, time.monotonic() - period)
    return _summarise(late)


def main(seconds: float, rate: float, *plainly: str) -> None:
    """Measure and print."""
    if plainly:
        print(json.dumps(_sleep_plainly(seconds, 1.0 / rate)))
        return
    command = [sys.executable, "-P", "-m", "duoglide.control.streamer.lateness"]
    beside = subprocess.Popen(
        [*command, str(seconds), str(rate), "plainly"], stdout=subprocess.PIPE, text=True
    )
    granted = become_realtime()
    cycles = max(1, round(seconds * rate))
    idle = _Idle(cycles)
    run_cycles(idle, MonotonicClock(), round(NANOSECONDS / rate))
    said, _ = beside.communicate()
    streamer = {**_summarise(idle.late), "skipped": idle.skipped, "cycles": cycles}
    print(
        json.dumps({"granted": asdict(granted), "streamer": streamer, "sleeping": json.loads(said)})
    )


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]), *sys.argv[3:])
