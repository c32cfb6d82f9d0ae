"""What the streamer tells, in the words of a log."""

from __future__ import annotations

from collections.abc import Callable

from duoglide.control.orders import Command, Happening, Refusal
from duoglide.control.power import Power
from duoglide.control.ring import EventEntry
from duoglide.control.supervise import Condition, Reaction, Trip
from duoglide.drives.cia402 import emergency_words
from duoglide.storage.records import EventKind, EventRecord, Phase

_CONDITIONS = tuple(Condition)
_REACTIONS = {
    Reaction.NONE: "nothing follows",
    Reaction.STOP_ON_PATH: "stopping along the path",
    Reaction.STOP_AND_DISABLE: "stopping along the path, then power off",
    Reaction.QUICK_STOP: "quick stop",
}
_ORDERS = {
    Command.HOLD: EventKind.HOLD,
    Command.RESUME: EventKind.RESUME,
    Command.OVERRIDE: EventKind.OVERRIDE,
    Command.STOP: EventKind.STOP,
    Command.QUICK_STOP: EventKind.QUICK_STOP,
}
_WITH_CODES = (EventKind.FAULT, EventKind.EMERGENCY)
_BUS = (Condition.BUS, Condition.UNSENT, Condition.FOREIGN)


def trip_of(event: EventEntry) -> Trip:
    """Read a trip back from its event."""
    condition, reaction = _CONDITIONS[event.detail], Reaction(int(event.value))
    return Trip(condition, reaction, event.axis, event.code)


def event_record(event: EventEntry) -> EventRecord:
    """Say what happened, as a log keeps it."""
    kind, text = _WRITERS[Happening(event.kind)](event)
    code = event.code if kind in _WITH_CODES else 0
    return EventRecord(kind, text, event.axis, code)


def _order(event: EventEntry) -> tuple[EventKind, str]:
    command = Command(event.detail)
    amount = f" {100.0 * event.value:g} %" if command is Command.OVERRIDE else ""
    return _ORDERS.get(command, EventKind.NOTE), command.name.lower().replace("_", " ") + amount


def _refused(event: EventEntry) -> tuple[EventKind, str]:
    order = Command(event.detail).name.lower()
    where = f"axis {event.axis}: " if event.axis else ""
    return EventKind.NOTE, f"{order} was refused: {where}{Refusal(event.code).words}"


def _trip(event: EventEntry) -> tuple[EventKind, str]:
    trip = trip_of(event)
    kind = EventKind.BUS if trip.condition in _BUS else EventKind.FAULT
    if trip.condition is Condition.PRESSED:
        kind = EventKind.QUICK_STOP
    return kind, f"{trip.words}; {_REACTIONS[trip.reaction]}"


def _emergency(event: EventEntry) -> tuple[EventKind, str]:
    return (
        EventKind.EMERGENCY,
        f"axis {event.axis}: emergency 0x{event.code:04X}: {emergency_words(event.code)}",
    )


def _power(event: EventEntry) -> tuple[EventKind, str]:
    reached = ", reached" if event.value else ""
    return EventKind.NOTE, f"power {Power(event.detail).name.lower()}{reached}"


def stop_words(on_approach: bool, quick: bool, path_time: float) -> str:
    """Say where a motion has stopped: the same words and the same number wherever it is told.

    Args:
        on_approach: Whether it was on its way to the start.
        quick: Whether the drives have braked by themselves, off the path.
        path_time: Along the approach, or along the trajectory [s].
    """
    where = "on the approach at" if on_approach else "at" if quick else "on the path at"
    return f"{'quick stop' if quick else 'stopped'} {where} path time {path_time:.4f} s"


def _finished(event: EventEntry) -> tuple[EventKind, str]:
    motion = Phase(event.detail).name.lower()
    return EventKind.FINISHED, f"{motion} finished at path time {event.value:.4f} s"


def _stopped(event: EventEntry) -> tuple[EventKind, str]:
    on_approach = event.detail == Phase.APPROACH
    return EventKind.STOP, stop_words(on_approach, bool(event.code), event.value)


def _waited(outcome: str) -> Callable[[EventEntry], str]:
    return lambda e: f"axis {e.axis} input {e.detail} {outcome} after {e.value:.3f} s"


_WRITERS: dict[Happening, Callable[[EventEntry], tuple[EventKind, str]]] = {
    Happening.READY: lambda e: (EventKind.NOTE, "streamer is ready"),
    Happening.POWER: _power,
    Happening.STARTED: lambda e: (EventKind.STARTED, f"{Phase(e.detail).name.lower()} started"),
    Happening.FINISHED: _finished,
    Happening.STOPPED: _stopped,
    Happening.ORDER: _order,
    Happening.REFUSED: _refused,
    Happening.TRIP: _trip,
    Happening.EMERGENCY: _emergency,
    Happening.OUTPUT: lambda e: (EventKind.OUTPUT, f"axis {e.axis} outputs 0x{e.code:08X}"),
    Happening.INPUT: lambda e: (EventKind.INPUT, _waited("came")(e)),
    Happening.INPUT_TIMEOUT: lambda e: (EventKind.TIMEOUT, _waited("did not come")(e)),
    Happening.LATE: lambda e: (EventKind.LATE, f"{e.value:.0f} cycles skipped to the schedule"),
}
