"""What the streamer tells, in the words of a log."""

from __future__ import annotations

from collections.abc import Callable

from duoglide.control.channel.events import Condition, Happening, Reaction, Refusal, Trip
from duoglide.control.channel.orders import Command, Power
from duoglide.control.channel.ring import EventEntry
from duoglide.drives.cia402 import emergency_words
from duoglide.storage.records import EventKind, EventRecord, Phase

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


def describe_event(event: EventEntry) -> EventRecord:
    """Say what happened, as a log keeps it."""
    kind, text = _WRITERS[Happening(event.kind)](event)
    code = event.code if kind in _WITH_CODES else 0
    return EventRecord(kind, text, event.axis, code)


def _describe_order(event: EventEntry) -> tuple[EventKind, str]:
    command = Command(event.detail)
    amount = f" {100.0 * event.value:g} %" if command is Command.OVERRIDE else ""
    return _ORDERS.get(command, EventKind.NOTE), command.name.lower().replace("_", " ") + amount


def _describe_refusal(event: EventEntry) -> tuple[EventKind, str]:
    order = Command(event.detail).name.lower()
    where = f"axis {event.axis}: " if event.axis else ""
    return EventKind.NOTE, f"{order} was refused: {where}{Refusal(event.code).words}"


def _describe_trip(event: EventEntry) -> tuple[EventKind, str]:
    trip = Trip.from_event(event)
    kind = EventKind.BUS if trip.condition.concerns_bus else EventKind.FAULT
    if trip.condition is Condition.PRESSED:
        kind = EventKind.QUICK_STOP
    return kind, f"{trip.words}; {_REACTIONS[trip.reaction]}"


def _describe_emergency(event: EventEntry) -> tuple[EventKind, str]:
    return (
        EventKind.EMERGENCY,
        f"axis {event.axis}: emergency 0x{event.code:04X}: {emergency_words(event.code)}",
    )


def _describe_power(event: EventEntry) -> tuple[EventKind, str]:
    reached = ", reached" if event.value else ""
    return EventKind.NOTE, f"power {Power(event.detail).name.lower()}{reached}"


def describe_stop(on_approach: bool, quick: bool, path_time: float) -> str:
    """Say where a run has stopped: the same words and the same number wherever it is told.

    Args:
        on_approach: Whether it was on its way to the start.
        quick: Whether the drives have stopped by themselves, off the path.
        path_time: Along the approach, or along the trajectory [s].
    """
    where = "on the approach at" if on_approach else "at" if quick else "on the path at"
    return f"{'quick stop' if quick else 'stopped'} {where} path time {path_time:.4f} s"


def _describe_finish(event: EventEntry) -> tuple[EventKind, str]:
    phase = Phase(event.detail).name.lower()
    return EventKind.FINISHED, f"{phase} finished at path time {event.value:.4f} s"


def _describe_stop(event: EventEntry) -> tuple[EventKind, str]:
    on_approach = event.detail == Phase.APPROACH
    return EventKind.STOP, describe_stop(on_approach, bool(event.code), event.value)


def _describe_wait(outcome: str) -> Callable[[EventEntry], str]:
    return lambda e: f"axis {e.axis} input {e.detail} {outcome} after {e.value:.3f} s"


_WRITERS: dict[Happening, Callable[[EventEntry], tuple[EventKind, str]]] = {
    Happening.READY: lambda e: (EventKind.NOTE, "streamer is ready"),
    Happening.POWER: _describe_power,
    Happening.STARTED: lambda e: (EventKind.STARTED, f"{Phase(e.detail).name.lower()} started"),
    Happening.FINISHED: _describe_finish,
    Happening.STOPPED: _describe_stop,
    Happening.ORDER: _describe_order,
    Happening.REFUSED: _describe_refusal,
    Happening.TRIP: _describe_trip,
    Happening.EMERGENCY: _describe_emergency,
    Happening.OUTPUT: lambda e: (EventKind.OUTPUT, f"axis {e.axis} outputs 0x{e.code:08X}"),
    Happening.INPUT: lambda e: (EventKind.INPUT, _describe_wait("came")(e)),
    Happening.INPUT_TIMEOUT: lambda e: (EventKind.TIMEOUT, _describe_wait("did not come")(e)),
    Happening.LOST: lambda e: (
        EventKind.LOST,
        f"axis {e.axis}: {e.code} setpoints did not act: {e.value:.3f} mm off where they lead",
    ),
    Happening.PART: lambda e: (
        EventKind.NOTE,
        f"the next part has taken over {'in motion' if e.code else 'at rest'}",
    ),
    Happening.AWAITED: lambda e: (EventKind.NOTE, f"waited {e.value:.3f} s for the next part"),
    Happening.FOREIGN: lambda e: (EventKind.BUS, "another host is on the bus"),
    Happening.LATE: lambda e: (EventKind.LATE, f"{e.value:.0f} cycles skipped to the schedule"),
}
