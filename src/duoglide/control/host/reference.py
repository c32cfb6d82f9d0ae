"""Whether it is known where the carriages are, and what takes that knowledge away.

A drive that says by itself whether it has found its reference is believed. Of the others the host
remembers it: over a fault and its reset, over a lost bus, and in a file over the end of the
process. What says otherwise is a drive that was switched on anew, a fault of an encoder, a position
that jumps, and at a new connection a place other than the one where the machine was left.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import AXES
from duoglide.control.channel.events import Condition, Happening, Trip
from duoglide.control.channel.scale import Scales
from duoglide.control.host.state_file import (
    DriveMemory,
    Memory,
    read_memory,
    state_path,
    write_memory,
)
from duoglide.drives.cia402 import emergency_words
from duoglide.errors import DuoglideError, InputError
from duoglide.kinematics.model import forward
from duoglide.machine import Reference

if TYPE_CHECKING:
    from duoglide.control.channel.ring import CycleEntry, EventEntry
    from duoglide.drives.axis.axis import Axis
    from duoglide.machine import Machine

_STANDS = 1.0  # [mm] by which a machine without power may have settled while nobody looked
_FASTEST = 1.5  # times the greatest speed of a stop: no carriage moves like that
_ENCODER = 0x73  # high byte of the error codes of sensors (CiA 402-2): 0x7305, 0x7320, ...


@dataclass(frozen=True, slots=True)
class Sighting:
    """What a drive showed before it was configured.

    Attributes:
        homed: What it says of its reference; None where it cannot say.
        simulated: Whether it carries the signature of Duoglide's own simulation.
        memory: What will be remembered of it, with 0x1017 as it was found.
    """

    homed: bool | None
    simulated: bool
    memory: DriveMemory


def look_at(axis: Axis) -> Sighting:
    """Ask a drive what tells whether its reference is still known; changes nothing."""
    vendor, product, serial = (axis.read_identity(sub) for sub in (1, 2, 4))
    memory = DriveMemory(vendor, product, serial, axis.read(0x1017), axis.read(0x6064))
    return Sighting(axis.read_homed(), axis.simulated, memory)


class PositionReference:
    """The position reference of three drives; listens to every record of the monitor.

    Args:
        machine: Whose drives.
        bus: Name of their bus.
        kept: Whether anybody can meet the same drives again: not those of bus ``virtual``.

    Attributes:
        why: Why the reference is not known; empty while it is.
    """

    def __init__(self, machine: Machine, bus: str, kept: bool) -> None:
        self.why = "nothing has been asked of the drives yet"
        self._machine = machine
        self._scales = Scales.of(machine.drives)
        self._absolute = machine.drives.reference is Reference.ABSOLUTE
        self._path = state_path(machine.drives, bus) if kept else None
        self._sightings: tuple[Sighting, ...] = ()
        self._memory = Memory(False, self.why, True, ())
        self._writing = threading.Lock()  # the monitor's thread loses what another one has found
        fineness = np.array(machine.drives.increments_per_mm)
        speed = _FASTEST * machine.stop_limits.velocity * machine.drives.cycle
        self._steps: list[float] = (fineness * speed).tolist()
        self._slack: list[float] = (fineness * _STANDS).tolist()
        self._last: list[tuple[int, int] | None] = [None] * AXES  # cycle, position [increments]

    @property
    def known(self) -> bool:
        """Whether it is known where the carriages are."""
        return not self.why

    @property
    def simulated(self) -> bool:
        """Whether all drives carry the signature of Duoglide's own simulation."""
        return bool(self._sightings) and all(seen.simulated for seen in self._sightings)

    # What the host does

    def judge(self, sightings: Sequence[Sighting], marks: Sequence[int], heard: bool) -> None:
        """Decide from what the drives showed, and from what is remembered.

        Args:
            sightings: Of the three drives, before they were configured.
            marks: What 0x1017 of each holds since then [ms].
            heard: Whether the host has listened to them ever since it decided before.
        """
        first = not self._sightings
        before = self._recall() if first else self._memory
        lost = "" if first or self._absolute else self.why
        doubts = (self._doubt(i, seen, before, first, heard) for i, seen in enumerate(sightings))
        self._sightings = tuple(
            replace(seen, memory=replace(seen.memory, mark=mark))
            for seen, mark in zip(sightings, marks, strict=True)
        )
        self.why = lost or next(filter(None, doubts), "") or self._find_impossible()
        self._keep(standing=True, positions=[seen.memory.position for seen in sightings])

    def find(self, positions: Sequence[int]) -> None:
        """Take note that homing has ended, at these positions [increments]."""
        self.why = ""
        self._keep(standing=False, positions=positions)

    def lose(self, why: str) -> None:
        """Take note that it is not known any more where the carriages are, and why."""
        if self.known:
            self.why = why
            self._keep(self._memory.standing, [drive.position for drive in self._memory.drives])

    def note_power(self, on: bool, positions: Sequence[int]) -> None:
        """Take note that power comes, or has gone, at these positions [increments]."""
        self._keep(standing=not on, positions=positions)

    # What the drives do

    def begin(self) -> None:
        """Listen to another stream, whose cycles are counted anew."""
        self._last = [None] * AXES

    def add_event(self, event: EventEntry) -> None:
        """Notice what takes the reference away."""
        if event.kind == Happening.EMERGENCY and event.code >> 8 == _ENCODER:
            words = emergency_words(event.code)
            self.lose(f"axis {event.axis}: encoder fault 0x{event.code:04X}, {words}")
        elif event.kind == Happening.TRIP and not self._absolute:
            trip = Trip.from_event(event)
            if trip.condition is Condition.BOOT_UP:
                self.lose(f"axis {trip.axis} has restarted")

    def add_cycle(self, entry: CycleEntry) -> None:
        """Notice a position that is further from the one before than a carriage can move."""
        for i, actual in enumerate(entry.actual):
            if entry.missing >> i & 1:
                continue
            last, self._last[i] = self._last[i], (entry.cycle, actual)
            if last is None or not self.known:
                continue
            reach = (entry.cycle - last[0]) * self._steps[i] + self._slack[i]
            if abs(actual - last[1]) > reach:
                way = self._scales.axes[i].to_mm(actual - last[1])
                self.lose(f"the position of axis {i + 1} has jumped by {way:.3f} mm")

    # Inside

    def _recall(self) -> Memory:
        """Return what the file says, or a memory that says why there is none."""
        why = "nothing is known of it from before"
        try:
            memory = None if self._path is None else read_memory(self._path)
        except InputError as error:
            memory, why = None, f"what was kept of it cannot be used: {error}"
        return memory or Memory(False, why, True, ())

    def _doubt(self, i: int, seen: Sighting, before: Memory, first: bool, heard: bool) -> str:
        """Say why the reference of one drive is not known; empty where nothing speaks against."""
        name, now, to_mm = f"axis {i + 1}", seen.memory, self._scales.axes[i].to_mm
        if seen.homed is not None or self._absolute:
            return f"{name} says that it has no reference" if seen.homed is False else ""
        if not before.homed:
            return before.why or f"{name} was not homed"
        then = before.drives[i]
        if changed := _find_change(then, now):
            return f"{name} {changed}"
        left = first and before.standing  # else it may have moved since, and stopped by itself
        away = abs(now.position - then.position) > self._slack[i]
        if left and away:
            return (
                f"{name} says {to_mm(now.position):.3f} mm, and was left at"
                f" {to_mm(then.position):.3f} mm"
            )
        if not left and not heard and abs(now.position) <= self._slack[i]:
            return (
                f"{name} says {to_mm(now.position):.3f} mm, as if it had been switched on there"
                " while nobody listened"
            )
        return ""

    def _find_impossible(self) -> str:
        """Say why the carriages cannot stand where drives that cannot say of themselves do."""
        if all(seen.homed is not None for seen in self._sightings):
            return ""
        first, second, third = (seen.memory.position for seen in self._sightings)
        carriages = np.array(self._scales.mm((first, second, third)))
        window = self._machine.drives.following_error_window
        most = self._machine.geometry.rail_half_length + window
        worst = int(np.argmax(np.abs(carriages)))
        if abs(carriages[worst]) > most:
            return (
                f"axis {worst + 1} says {carriages[worst]:.3f} mm, and its rail ends at"
                f" {self._machine.geometry.rail_half_length:g} mm"
            )
        try:
            forward(self._machine.geometry, carriages)
        except DuoglideError as error:
            return f"the carriages cannot stand where their drives say: {error}"
        return ""

    def _keep(self, standing: bool, positions: Sequence[int]) -> None:
        """Remember, and write it down where the drives cannot say by themselves."""
        with self._writing:
            drives = tuple(
                replace(seen.memory, position=position)
                for seen, position in zip(self._sightings, positions, strict=False)
            )
            self._memory = Memory(self.known, self.why, standing, drives)
            all_say = all(seen.homed is not None for seen in self._sightings)
            if self._path is None or self._absolute or all_say:
                return
            try:
                write_memory(self._path, self._memory)
            except InputError as error:
                print(f"the reference will not be known next time: {error}", file=sys.stderr)


def _find_change(then: DriveMemory, now: DriveMemory) -> str:
    """Say what shows that a drive is another one, or has been switched on anew; else empty."""
    if (now.vendor, now.product, now.serial) != (then.vendor, then.product, then.serial):
        return "is another drive than the one that was homed"
    if not now.mark or now.mark != then.mark:
        return (
            f"has restarted, or another host has configured it: its 0x1017 is {now.mark} ms, and"
            f" was left at {then.mark} ms"
        )
    return ""
