"""Differences that decide nothing, wherever planning compares two numbers, and sizes of its work.

A tolerance that belongs to one method alone stands in the module of that method.
"""

from __future__ import annotations

ROUNDING = 1e-9  # relative: far above rounding in double precision, far below what anybody asks for
ALIKE = 1e-6  # relative; estimates of one time agree to some 1e-8 in long, badly conditioned paths
NANOMETRE = 1e-6  # [mm]: two places on a path that are nearer than this are one
PICOMETRE = 1e-9  # [mm]: no search divides a way further, nor looks again to gain so little
NO_CAP = 1e12  # [mm/s]: stands for no cap on the speed, where infinity could not be interpolated
CHUNK = 4_000  # cells or samples of a motion that are looked at together, to bound the memory
