"""Whether a path is made of picks: only then does it make sense to count them by the minute."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from duoglide.motion.path.segments import COINCIDENT, Line, Segment

if TYPE_CHECKING:
    from duoglide.motion.path.path import Path

_PICKS = re.compile("(u+ad+)+")  # up, across, down


def count_picks(path: Path) -> int:
    """Return how many moves straight up, across and straight down a path is made of.

    Args:
        path: Any; 0 comes back where any part of it is something else.
    """
    letters = "".join(map(_letter, path.segments))
    return letters.count("a") if _PICKS.fullmatch(letters) else 0


def _letter(segment: Segment) -> str:
    if not isinstance(segment, Line):
        return "?"
    x, y, z = (b - a for a, b in zip(segment.start, segment.end, strict=True))
    if abs(z) < COINCIDENT:
        return "a"
    if max(abs(x), abs(y)) >= COINCIDENT:
        return "?"
    return "u" if z > 0.0 else "d"
