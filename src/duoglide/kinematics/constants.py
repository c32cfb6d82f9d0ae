"""What the kernels need of a geometry and a mode, computed once and kept on the geometry."""

from __future__ import annotations

from typing import Any, TypeAlias

from duoglide.errors import InputError
from duoglide.kinematics.modes import AssemblyMode, WorkingMode, number
from duoglide.machine import Geometry

Constants: TypeAlias = tuple[float, ...]

FAINT = 1e-12  # share of the square of a length, below which rounding has to be looked at


def pose_constants(g: Geometry, mode: WorkingMode) -> Constants:
    """Return what ``inverse_pose`` and ``margins_pose`` need, in their order.

    Raises:
        InputError: Not a geometry and a working mode.
    """
    try:
        known: Constants = g.pose_constants[mode.code]
    except (AttributeError, LookupError, TypeError):
        return _new_pose_constants(g, mode)
    return known


def carriage_constants(g: Geometry, mode: AssemblyMode) -> Constants:
    """Return what ``forward_pose`` needs, in its order.

    Raises:
        InputError: Not a geometry and an assembly mode.
    """
    try:
        known: Constants = g.carriage_constants[mode.code]
    except (AttributeError, LookupError, TypeError):
        return _new_carriage_constants(g, mode)
    return known


def _new_pose_constants(g: Geometry, mode: WorkingMode) -> Constants:
    _require(g, mode, WorkingMode)
    shift = g.rail_half_spacing - g.platform_half_width
    constants = (
        shift,
        g.carriage_height + g.riser_height + g.arm_drop,
        g.arm_length,
        g.leg_length,
        0.5 * g.coupler_length,
        -shift,
        g.carriage_height + g.strut_drop,
        g.strut_length,
        1.0 * mode.v,  # numba wants all of one type
        1.0 * mode.w1,
        1.0 * mode.w2,
        1.0 * mode.w3,
    )
    return _remember(g, "pose_constants", mode, constants)


def _new_carriage_constants(g: Geometry, mode: AssemblyMode) -> Constants:
    _require(g, mode, AssemblyMode)
    F1 = 2.0 * (g.rail_half_spacing - g.platform_half_width)
    l2, l6, l9 = g.leg_length, g.arm_length, g.strut_length
    lift = g.riser_height + g.arm_drop - g.strut_drop
    largest = l9 * l9 + l6 * l6 + F1 * F1 + (abs(lift) + l2) ** 2  # of the squares in ``cross``
    constants = (
        l2,
        g.coupler_length,
        F1,
        lift,
        l6,
        l9,
        -0.5 * F1,
        g.carriage_height + g.strut_drop,
        1.0 * mode.m,
        1.0 * mode.n,
        F1 * F1,
        l6 * l6,
        FAINT * l2 * l2,
        FAINT * largest * largest,
    )
    return _remember(g, "carriage_constants", mode, constants)


def _require(g: Any, mode: Any, kind: type[WorkingMode | AssemblyMode]) -> None:
    """Refuse what is no geometry, or not a mode of this kind."""
    if not isinstance(g, Geometry):
        hint = "; a Machine has one, machine.geometry" if hasattr(g, "geometry") else ""
        raise InputError(f"geometry must be a duoglide.Geometry, got {g!r:.80}{hint}")
    if not isinstance(mode, kind):
        raise InputError(f"mode must be a duoglide.{kind.__name__}, such as {kind()}, got {mode!r}")


def _remember(
    g: Geometry, slot: str, mode: WorkingMode | AssemblyMode, constants: Constants
) -> Constants:
    """Keep constants on the geometry, under the number of the mode."""
    if not hasattr(g, slot):
        object.__setattr__(g, slot, {})
    kept: Constants = getattr(g, slot).setdefault(number(mode), constants)
    return kept
