"""A drive that brakes in each cycle of a plan, and two that follow it: one loop, compiled.

Times are in cycles here, and velocities in mm/cycle. A row of the table is half a cycle of path
time: the way that the drive's carriage has gone, the two others' places, the speeds of all three,
how far a millimetre of the drive's carriage moves the platform across, and the carriage margin.
"""

from __future__ import annotations

from math import ceil, inf
from typing import Any

from duoglide.kinematics.compiled import compiled, inlined
from duoglide.motion.led_stops import LEAST_STEP, catch_up

PARTS = 2  # rows in a cycle
REACTION = 2  # cycles from a fault to the others' first setpoint, if a message tells it at once
CATCH_UP = 2.0  # times the stop limits: what a fault may ask of the others, for some cycles
TURN = 0.5  # [mm] that the drive stays away from where its plan turns it round: no path beyond
FEWEST = 2.0  # cycles that the drive takes to come to rest; others cannot follow a jolt
EXTRA = 12  # cycles to catch up in, after the drive has come to rest
MOST_OFF = 3.0  # [mm] off the path, above which braking apart is as good
FASTEST = 0.95  # path time per time that following may ask for; behind a drive that brakes no
# harder than the plan nothing can be made up for, as path time is never faster than planned
ROUNDING = 1.1  # by which second differences of samples may be above a limit

_catch_up = inlined(catch_up)


@inlined
def _at(table: Any, column: int, u: float) -> float:
    """Interpolate a column at a path time."""
    place = min(max(u * PARTS, 0.0), len(table) - 1.000001)
    low = int(place)
    share = place - low
    value: float = (1.0 - share) * table[low, column] + share * table[low + 1, column]
    return value


@compiled
def follow(table: Any, end: Any, drive: Any, limits: Any, off: Any) -> None:
    """Let a drive brake in each cycle, and the others follow it as the streamer has them do.

    Args:
        table: See above, (n, 8).
        end: How far its carriage may go in each cycle, until its plan turns it round [mm], (m,).
        drive: Its deceleration [mm/cycle^2]; how far it may be from where it is expected [mm]; how
            long it goes straight on before it brakes, 0 to 1 [cycles].
        limits: What each of the others may be asked for [mm/cycle^2], (2,).
        off: Takes how far off its path the platform gets [mm], (m,); inf above ``MOST_OFF``, and
            where the others cannot follow or links might part.
    """
    d, unsure, late = drive
    last = len(table) - 1
    for k in range(len(off)):
        off[k] = inf
        start = table[k * PARTS, 0]
        v = min(table[min((k + 1) * PARTS, last), 0], end[k]) - start
        if (
            v <= max(FEWEST * d, LEAST_STEP)
            or start + v * late + v * v / (2.0 * d) + unsure + TURN > end[k]
        ):
            continue
        start += v * late
        before, newest = k + REACTION - 1.0, k + REACTION * 1.0
        now1, now2 = _at(table, 1, newest), _at(table, 2, newest)
        old1, old2 = _at(table, 1, before), _at(table, 2, before)
        led1 = led2 = then1 = then2 = 0.0
        row, worst = k * PARTS, 0.0
        for cycle in range(REACTION - 1, ceil(v / d) + REACTION + EXTRA):
            t = min(cycle - late, v / d)
            gone = start + v * t - 0.5 * d * t * t
            while row < last - 1 and table[row + 1, 0] <= gone:
                row += 1
            step = table[row + 1, 0] - table[row, 0]
            share = min((gone - table[row, 0]) / step, 1.0) if step > 0.0 else 1.0
            goal = (row + share) / PARTS
            new1, new2 = _at(table, 1, goal), _at(table, 2, goal)
            if cycle > REACTION:
                speed, fast1, fast2 = (
                    _at(table, 3, goal), _at(table, 4, goal), _at(table, 5, goal)
                )  # fmt: skip
                pace = max(v - d * (cycle - late), 0.0) / max(speed, LEAST_STEP)
                if speed <= LEAST_STEP or pace > FASTEST:
                    break
                bend1, bend2 = abs(new1 - 2.0 * led1 + then1), abs(new2 - 2.0 * led2 + then2)
                least = ROUNDING / CATCH_UP
                if bend1 > least * limits[0] or bend2 > least * limits[1]:
                    break
                most = min(limits[0] / max(fast1, 1e-9), limits[1] / max(fast2, 1e-9))
                way = min(_catch_up(goal - newest, newest - before, pace, most), 1.0)
                before, newest = newest, newest + way
                next1, next2 = _at(table, 1, newest), _at(table, 2, newest)
                bend1, bend2 = abs(next1 - 2.0 * now1 + old1), abs(next2 - 2.0 * now2 + old2)
                if bend1 > ROUNDING * limits[0] or bend2 > ROUNDING * limits[1]:
                    break
                old1, old2, now1, now2 = now1, now2, next1, next2
            then1, then2, led1, led2 = led1, led2, new1, new2
            if cycle >= REACTION:
                behind = abs(gone - _at(table, 0, newest)) + unsure
                worst = max(worst, behind * _at(table, 6, newest))
                if worst > MOST_OFF or behind >= _at(table, 7, newest):
                    break
        else:
            off[k] = worst
