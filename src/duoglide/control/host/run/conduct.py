"""How each drive has followed its setpoints in a run: lag, offset, noise, and what was lost."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from duoglide.drives.trailing import TrailFit, bend_of, step_of

if TYPE_CHECKING:
    from duoglide.control.channel.ring import CycleEntry
    from duoglide.control.channel.scale import IntTriple

_DELAY = 2  # cycles from a setpoint to the SYNC at which it is reached
_TOLD_LATER = 0.5  # cycles of lag beyond what is known, from which on it is remarked ...
_TOLD_BY = 0.1  # ... if it makes so much at the run's usual speed [mm]
_TOLD_NOISE = 0.1  # [mm]
_TOLD_OFFSET = 0.3  # [mm]
_SECOND_DIFFERENCE = 1.95  # its mean size, for noise of standard deviation 1
_FEWEST = 20  # cycles in motion that tell a lag


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveConduct:
    """How one drive has followed its setpoints.

    Attributes:
        lag: By how much it trails at constant speed [s].
        later: How many cycles that is more than the machine file says; more than one where its
            setpoints or its feedback are delayed.
        acceleration_lag: By how many mm it trails for each mm/s^2 [s^2].
        offset: What it is off beside that, on the average of the cycles in motion [mm].
        noise: What its feedback shakes by, a standard deviation [mm].
        lost: Setpoints that did not act, as far as it shows in where the carriage was.
        usual: Root mean square of its speed while it moved [mm/s].
    """

    lag: float = 0.0
    later: float = 0.0
    acceleration_lag: float = 0.0
    offset: float = 0.0
    noise: float = 0.0
    lost: int = 0
    usual: float = 0.0

    def remarks(self, axis: int, cycle: float) -> list[str]:
        """Say what is not as it should be.

        Args:
            axis: Which carriage, 1 to 3.
            cycle: Of the stream [s].
        """
        said = []
        shows = abs(self.later) * cycle * self.usual > _TOLD_BY
        if abs(self.later) >= _TOLD_LATER and shows:
            said.append(
                f"axis {axis}: follows {abs(self.later):.1f} cycles"
                f" {'later' if self.later > 0.0 else 'earlier'} than drives.lag says (lag"
                f" {1e3 * self.lag:.3g} ms): setpoints or feedback are delayed, or the drive's lag"
                " is another: put it into drives.lag"
            )
        if abs(self.offset) > _TOLD_OFFSET:
            said.append(f"axis {axis}: {self.offset:+.3f} mm off on the average")
        if self.noise > _TOLD_NOISE:
            said.append(f"axis {axis}: feedback is noisy, {self.noise:.3f} mm (standard deviation)")
        if self.lost:
            said.append(f"axis {axis}: {self.lost} setpoints lost, or something held the carriage")
        return said

    def to_dict(self) -> dict[str, float]:
        """Return plain values, for a log or JSON."""
        return {
            "lag": self.lag,
            "later_cycles": self.later,
            "acceleration_lag": self.acceleration_lag,
            "offset": self.offset,
            "noise": self.noise,
            "lost": self.lost,
        }


@dataclass(slots=True)
class _AxisTally:
    """Of one axis."""

    fit: TrailFit = field(default_factory=TrailFit)
    shaking: float = 0.0
    shaken: int = 0
    squares: float = 0.0
    lost: int = 0
    last: float = 0.0
    before: float = 0.0


class ConductTally:
    """Collects cycle by cycle how the drives follow."""

    def __init__(self) -> None:
        self._axes = (_AxisTally(), _AxisTally(), _AxisTally())
        self._setpoints: deque[IntTriple] = deque(maxlen=_DELAY + 1)
        self._cycle = self._regular = 0

    def add(self, entry: CycleEntry) -> None:
        """Count a cycle; what comes after a gap is left out, for it may be of another SYNC."""
        whole = entry.cycle == self._cycle + 1 and not entry.missing
        self._regular = self._regular + 1 if whole else 0
        self._cycle = entry.cycle
        if self._regular > 2 * _DELAY + 1:
            before, due, after = self._setpoints
            for index, axis in enumerate(self._axes):
                off = entry.actual[index] - due[index]
                step = step_of(before[index], after[index])
                self._add(axis, off, step, bend_of(before[index], due[index], after[index]))
        self._setpoints.append(entry.setpoint)

    def _add(self, axis: _AxisTally, off: float, step: float, bend: float) -> None:
        axis.shaking += abs(off - 2.0 * axis.last + axis.before)
        axis.shaken += 1
        axis.before, axis.last = axis.last, off
        if step or bend:
            axis.fit.add(off, step, bend)
            axis.squares += step * step

    def lose(self, axis: int, count: int) -> None:
        """Count setpoints of a carriage, 1 to 3, that did not act."""
        self._axes[axis - 1].lost += count

    def conduct(
        self, mm: tuple[float, float, float], lags: tuple[float, float, float], cycle: float
    ) -> tuple[DriveConduct, DriveConduct, DriveConduct]:
        """Sum up.

        Args:
            mm: Size of an increment of each drive, with its sign [mm].
            lags: What is known of each drive [s].
            cycle: Of the stream [s].
        """
        first, second, third = (
            self._of(axis, size, known, cycle)
            for axis, size, known in zip(self._axes, mm, lags, strict=True)
        )
        return first, second, third

    def _of(self, axis: _AxisTally, mm: float, known: float, cycle: float) -> DriveConduct:
        noise = axis.shaking / max(axis.shaken, 1) / _SECOND_DIFFERENCE * abs(mm)
        if axis.fit.cycles < _FEWEST:
            return DriveConduct(lag=known, noise=noise, lost=axis.lost)
        lag, bend, offset = axis.fit.solve()
        return DriveConduct(
            lag=lag * cycle,
            later=lag - known / cycle,
            acceleration_lag=bend * cycle**2,
            offset=offset * mm,
            noise=noise,
            lost=axis.lost,
            usual=(axis.squares / axis.fit.cycles) ** 0.5 * abs(mm) / cycle,
        )
