"""Which verb comes next once one has failed on a machine: reset, home, park or doctor."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

from duoglide.errors import BusError, DriveError, DriveFault, FollowingError, NotHomedError

_KEPT = ("--bus", "--machine")  # what the next verb has to be told as well
_SIMULATED = "virtual"  # whose drives have ended with the verb


def next_command(
    error: BaseException, facts: Mapping[str, object], words: Sequence[str]
) -> str | None:
    """Return the command that comes next, with the bus and the machine of the one that failed.

    Args:
        error: What has gone wrong.
        facts: What the verb has said of it; a run that has begun says how many cycles it had.
        words: Of the command line that has failed.
    """
    kept = _kept_options(words)
    if kept.get("--bus", _SIMULATED) == _SIMULATED:
        return None
    verb = _next_verb(error, "cycles" in facts)
    return None if verb is None else shlex.join(["duoglide", *verb, *sum(kept.items(), ())])


def _next_verb(error: BaseException, moved: bool) -> tuple[str, ...] | None:
    if isinstance(error, NotHomedError):
        return "home", "--home-here"
    if isinstance(error, DriveFault | FollowingError) or (
        isinstance(error, DriveError) and error.code
    ):
        return ("reset",)
    if isinstance(error, BusError):
        return ("doctor",)
    return ("park",) if moved and isinstance(error, DriveError) else None


def _kept_options(words: Sequence[str]) -> dict[str, str]:
    """Return the options of a command line that say which machine it is about."""
    found = {}
    for i, word in enumerate(words):
        name, equals, value = word.partition("=")
        if name in _KEPT and (equals or i + 1 < len(words)):
            found[name] = value if equals else words[i + 1]
    return found
