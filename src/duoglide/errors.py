"""Every error that Duoglide raises on purpose.

A message says what, where, by how much, in which unit, and where it can, the nearest thing that
would work. Attributes carry the same facts for programs. All of them survive pickling, because a
streamer in another process has to be able to report one.
"""

from __future__ import annotations

from collections.abc import Sequence


def printable(text: str) -> str:
    r"""Return a text with what is no letter of any script written as an escape, but line ends.

    Texts of files, drives and frames are quoted where people read them; on a terminal, control
    characters would move its cursor, change its colours, or worse.

    Example:
        >>> printable("a drive called \x1b[31mred")
        'a drive called \\x1b[31mred'
    """
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() or letter == "\n" else ascii(letter)[1:-1] for letter in text
    )


class DuoglideError(Exception):
    """Base of everything that Duoglide raises on purpose; its message can be shown anywhere."""

    def __str__(self) -> str:
        """Return its message, of printable letters."""
        return printable(super().__str__())


class DuoglideWarning(UserWarning):
    """Base of everything that Duoglide warns of."""


class InputError(DuoglideError, ValueError):
    """A value that no robot could accept: NaN, infinity, text for a number, a wrong shape."""


class ConfigError(DuoglideError, ValueError):
    """A machine description that breaks a rule; names the key, the value and the rule."""


class UnreachableError(DuoglideError):
    """A pose or a set of carriages for which the links do not close.

    Attributes:
        index: Which row of the batch fails first; () for a single pose.
        link: Name of the link that is too short.
        shortfall: By how much it is too short [mm].
    """

    def __init__(
        self,
        message: str,
        *,
        index: tuple[int, ...] = (),
        link: str = "",
        shortfall: float = float("nan"),
    ) -> None:
        super().__init__(message)
        self.index = index
        self.link = link
        self.shortfall = shortfall


class SingularityError(DuoglideError):
    """A pose at which the mechanism loses or gains a freedom, so that an answer is indeterminate.

    Attributes:
        index: Which row of the batch fails first; () for a single pose.
        family: Name of the singularity family, a field of ``Margins``.
    """

    def __init__(self, message: str, *, index: tuple[int, ...] = (), family: str = "") -> None:
        super().__init__(message)
        self.index = index
        self.family = family


class PathError(DuoglideError):
    """A path that the machine cannot follow.

    Attributes:
        arc_length: Distance along the path where it first fails [mm].
        position: Platform position there [mm], three values.
        quantity: What fails: a singularity family, ``"reach"``, ``"travel"``, ...
        amount: By how much it fails [mm].
    """

    def __init__(
        self,
        message: str,
        *,
        arc_length: float = float("nan"),
        position: Sequence[float] = (),
        quantity: str = "",
        amount: float = float("nan"),
    ) -> None:
        super().__init__(message)
        self.arc_length = arc_length
        self.position = tuple(position)
        self.quantity = quantity
        self.amount = amount


class LimitError(DuoglideError):
    """A motion that would break a velocity, acceleration or jerk limit."""


class BusError(DuoglideError):
    """The CAN bus cannot be opened, or has failed."""


class DriveError(DuoglideError):
    """A drive refuses, or is not what the machine file says.

    Attributes:
        axis: Which carriage, 1 to 3; 0 where the error concerns all of them.
        code: The CiA 301 emergency error code, 0 where there is none.
    """

    def __init__(self, message: str, *, axis: int = 0, code: int = 0) -> None:
        super().__init__(message)
        self.axis = axis
        self.code = code


class DriveFault(DriveError):
    """A drive has reported a fault (EMCY or statusword bit 3)."""


class DriveTimeout(DriveError):
    """A drive has not answered in time."""


class FollowingError(DriveError):
    """A carriage has left its setpoint by more than its window."""


class NotHomedError(DriveError):
    """A motion was asked of a machine whose position reference is not known."""


class LogError(DuoglideError):
    """A log that cannot be read, or does not hold what is asked of it."""
