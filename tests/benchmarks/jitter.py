"""How late cycles begin: ``python tests/benchmarks/jitter.py [SECONDS] [PICTURE]``.

Slices of the streamer, on the virtual bus with the drives under power, alternate with slices of a
C loop that only sleeps. Absolute times say more of the computer than of the program; the ratio of
the two in one run is what counts.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import duoglide as dg
from duoglide.control.channel.ring import CycleEntry, EventEntry

SLICES = 4
QUANTILES = (0.5, 0.99, 0.999, 1.0)
HERE = Path(__file__).parent


@dataclass
class Slice:
    """Latenesses of the cycles of one slice [us], and the share of a processor that it took."""

    lateness: list[float] = field(default_factory=list)
    skipped: int = 0
    share: float = 0.0

    def add_cycle(self, entry: CycleEntry) -> None:
        self.lateness.append(entry.lateness * 1e-3)
        self.skipped += entry.skipped

    def add_event(self, event: EventEntry) -> None:
        pass


def compile_peer(folder: Path) -> Path:
    """Compile the C loop."""
    binary = folder / "jitter"
    command = ["cc", "-O2", "-Wall", "-Wextra", "-Werror", str(HERE / "jitter.c"), "-o", binary]
    subprocess.run(command, check=True)
    return binary


def run_peer(binary: Path, rate: float, seconds: float) -> list[float]:
    """Run the C loop and return its latenesses [us]."""
    command = [str(binary), str(round(1e9 / rate)), str(round(seconds * rate))]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return [float(line) * 1e-3 for line in output.split()]


def run_streamer(rate: float, seconds: float, busy: bool) -> Slice:
    """Let the streamer hold the drives for a while."""
    machine = dg.Machine.default()
    machine = replace(machine, drives=replace(machine.drives, cycle=1.0 / rate))
    found = Slice()
    with dg.Robot.connect(machine) as robot, busy_host(busy):
        robot.enable()
        connection = robot._connection
        before, begin = cpu_seconds(connection.process.pid), time.monotonic()
        connection.monitor.attach(found)
        time.sleep(seconds)
        connection.monitor.detach()
        used = cpu_seconds(connection.process.pid) - before
        found.share = used / (time.monotonic() - begin)
    return found


@contextmanager
def busy_host(busy: bool) -> Iterator[None]:
    """Keep a Python thread of this process busy, or do not."""
    done = not busy

    def spin() -> None:
        while not done:
            sum(range(1000))

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        yield
    finally:
        done = True
        thread.join()


def cpu_seconds(pid: int) -> float:
    """Return the processor time of a process so far [s]."""
    words = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def row(name: str, values: np.ndarray, rest: str = "") -> None:
    """Print one line of the table."""
    print(f"{name:<28}" + "".join(f"{v:10.0f}" for v in values) + rest, flush=True)


def draw(results: dict[str, np.ndarray], picture: Path) -> None:
    """Draw the histograms."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    bins = np.geomspace(10.0, max(v.max() for v in results.values()) * 1.1, 80)
    settings = sorted({name.rpartition(": ")[0] for name in results})
    for axes, setting in zip(panels.ravel(), settings, strict=True):
        for who, colour in (("C", "0.55"), ("streamer", "#5e3c99")):
            values = np.maximum(results[f"{setting}: {who}"], bins[0])
            axes.hist(values, bins, histtype="step", color=colour, linewidth=1.4, label=who)
        axes.set_title(setting, fontsize=10)
        axes.set(xscale="log", yscale="log")
        axes.grid(alpha=0.3)
    for axes in panels[1]:
        axes.set_xlabel("lateness [us]")
    for axes in panels[:, 0]:
        axes.set_ylabel("cycles")
    panels[0, 0].legend()
    figure.suptitle("How late cycles begin: the streamer and a C clock_nanosleep loop")
    figure.savefig(picture, dpi=120)


def main(seconds: float = 60.0, picture: Path = Path("jitter.png")) -> None:
    """Measure, print, draw."""
    print(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, {seconds:g} s each")
    print(f"{'lateness [us]':<28}" + "".join(f"{h:>10}" for h in ("p50", "p99", "p99.9", "max")))
    results: dict[str, np.ndarray] = {}
    with tempfile.TemporaryDirectory() as folder:
        binary = compile_peer(Path(folder))
        for rate in (500.0, 1000.0):
            for busy in (False, True):
                ours, theirs = [], []
                for _ in range(SLICES):
                    with busy_host(busy):
                        theirs += run_peer(binary, rate, seconds / SLICES)
                    ours.append(run_streamer(rate, seconds / SLICES, busy))
                name = f"{rate:.0f} Hz, host {'busy' if busy else 'idle'}"
                mine = np.array([late for part in ours for late in part.lateness])
                peer = np.array(theirs)
                a, b = np.quantile(mine, QUANTILES), np.quantile(peer, QUANTILES)
                row(f"{name}: C", b)
                share = 100.0 * float(np.mean([part.share for part in ours]))
                skipped = sum(part.skipped for part in ours)
                row(f"{name}: streamer", a, f"   {share:.1f} % of a core, {skipped} skipped")
                print(f"{'':<28}" + "".join(f"{v:10.2f}" for v in a / b) + "   ratio")
                results[f"{name}: streamer"], results[f"{name}: C"] = mine, peer
    draw(results, picture)
    print(f"picture: {picture}")


if __name__ == "__main__":
    arguments = sys.argv[1:]
    main(*(kind(word) for kind, word in zip((float, Path), arguments, strict=False)))
