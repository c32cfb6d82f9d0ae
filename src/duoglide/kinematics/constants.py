"""What the formulas need of a geometry: its plane, and the numbers of a mode kept on the geometry.

The kernels take plain tuples and unpack them in one line: a named tuple takes 0.15 us longer to
unpack, and one pose takes 3 us in all.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

from duoglide.errors import InputError
from duoglide.kinematics.modes import AssemblyMode, WorkingMode, number
from duoglide.machine import Geometry

Constants: TypeAlias = tuple[float, ...]

FAINT = 1e-12  # share of the square of a length, below which rounding has to be looked at


class Plane(NamedTuple):
    """Where the mechanism stands in the xz plane, as the platform centre O' sees it [mm].

    Attributes:
        cx: b - d: u = x - cx is 0 where the arm stands upright.
        base: l1 + l4 + l7: h = z - base - A is the rise of the legs.
        xb: d - b: X = x - xb runs from B3 to C3.
        zb: l1 + l8: so does Z = z - zb.
        F1: 2 (b - d): X = u + F1.
        lift: l4 + l7 - l8: F3 = lift + h.
    """

    cx: float
    base: float
    xb: float
    zb: float
    F1: float
    lift: float

    @classmethod
    def of(cls, g: Geometry) -> Plane:
        """Return the plane of a geometry."""
        cx = g.rail_half_spacing - g.platform_half_width
        return cls(
            cx=cx,
            base=g.carriage_height + g.riser_height + g.arm_drop,
            xb=-cx,
            zb=g.carriage_height + g.strut_drop,
            F1=2.0 * cx,
            lift=g.riser_height + g.arm_drop - g.strut_drop,
        )


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
    plane = Plane.of(g)
    constants = (
        plane.cx,
        plane.base,
        g.arm_length,
        g.leg_length,
        0.5 * g.coupler_length,
        plane.xb,
        plane.zb,
        g.strut_length,
        1.0 * mode.v,  # numba wants all of one type
        1.0 * mode.w1,
        1.0 * mode.w2,
        1.0 * mode.w3,
    )
    return _remember(g, "pose_constants", mode, constants)


def _new_carriage_constants(g: Geometry, mode: AssemblyMode) -> Constants:
    _require(g, mode, AssemblyMode)
    _, _, xb, zb, F1, lift = Plane.of(g)
    l2, l6, l9 = g.leg_length, g.arm_length, g.strut_length
    largest = l9 * l9 + l6 * l6 + F1 * F1 + (abs(lift) + l2) ** 2  # of the squares in ``cross``
    constants = (
        l2,
        g.coupler_length,
        F1,
        lift,
        l6,
        l9,
        xb,
        zb,
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
