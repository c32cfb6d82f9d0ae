"""What a run that went wrong raises."""

from __future__ import annotations

from typing import TYPE_CHECKING

from duoglide.control.supervise import Condition
from duoglide.errors import BusError, DriveError, DriveFault, DriveTimeout, FollowingError
from duoglide.storage.records import EventKind

if TYPE_CHECKING:
    from duoglide.control.report import RunReport
    from duoglide.control.supervise import Trip

_FOLLOWING = 0x8611  # emergency code: following error too large
_ERRORS: dict[Condition, type[DriveError]] = {
    Condition.FOLLOWING_ERROR: FollowingError,
    Condition.NOT_FOLLOWING: FollowingError,
    Condition.SILENT: DriveTimeout,
    Condition.HEARTBEAT: DriveTimeout,
    Condition.EMERGENCY: DriveFault,
    Condition.FAULT: DriveFault,
}


def require_success(report: RunReport) -> None:
    """Raise what made a run stop; a run that its operator has stopped is no error.

    Raises:
        DriveError: A drive has failed, or the streamer could not go on; names the axis, the code
            in words, and where the log is.
        BusError: The bus has failed.
    """
    log = f"; log: {report.log}" if report.log else ""
    for trip in report.faults:
        if trip.condition is not Condition.PRESSED:
            raise _error(trip, f"{report.ending}{log}")
    for _, event in report.events:
        if event.kind is EventKind.TIMEOUT:
            raise DriveTimeout(f"{event.text}{log}", axis=event.axis)


def _error(trip: Trip, rest: str) -> DriveError | BusError:
    message = f"{trip.words}; {rest}"
    if trip.condition in (Condition.BUS, Condition.UNSENT, Condition.FOREIGN):
        return BusError(message)
    following = trip.code == _FOLLOWING
    kind = FollowingError if following else _ERRORS.get(trip.condition, DriveError)
    return kind(message, axis=trip.axis, code=trip.code)
