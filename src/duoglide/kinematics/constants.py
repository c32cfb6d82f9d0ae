"""What the formulas need of a geometry: its plane, and its numbers in one mode."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

from duoglide.errors import InputError
from duoglide.kinematics.modes import AssemblyMode, WorkingMode, number
from duoglide.machine import Geometry

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


class PoseConstants(NamedTuple):
    """What the formulas that begin with the platform need, all floats: numba wants one type.

    Attributes:
        cx: As in ``Plane`` [mm], and so are ``base``, ``xb`` and ``zb``.
        base: See there.
        l6: Arm length [mm].
        l2: Leg length [mm].
        half_l3: Half the length of the coupler [mm].
        xb: See ``Plane``.
        zb: The same.
        l9: Strut length [mm].
        v: Sign of sin(beta).
        w1: Sign of the first leg's stroke along y.
        w2: Sign of the second leg's.
        w3: Sign of the strut's.
    """

    cx: float
    base: float
    l6: float
    l2: float
    half_l3: float
    xb: float
    zb: float
    l9: float
    v: float
    w1: float
    w2: float
    w3: float


class CarriageConstants(NamedTuple):
    """What the formulas that begin with the carriages need, all floats.

    Attributes:
        l2: Leg length [mm].
        l3: Coupler length [mm].
        F1: As in ``Plane`` [mm], and so are ``lift``, ``xb`` and ``zb``.
        lift: See there.
        l6: Arm length [mm].
        l9: Strut length [mm].
        xb: See ``Plane``.
        zb: The same.
        m: Sign of the rise of the legs.
        n: Which intersection of the arm's and the strut's circle.
        F1F1: Square of F1 [mm^2].
        l6l6: Square of l6 [mm^2].
        faint_rise: Square of the rise, below which rounding has to be looked at [mm^2].
        faint_cross: The same of the square that arm and strut span [mm^4].
    """

    l2: float
    l3: float
    F1: float
    lift: float
    l6: float
    l9: float
    xb: float
    zb: float
    m: float
    n: float
    F1F1: float
    l6l6: float
    faint_rise: float
    faint_cross: float


_Constants = TypeVar("_Constants", PoseConstants, CarriageConstants)


def pose_constants(g: Geometry, mode: WorkingMode) -> PoseConstants:
    """Return what the formulas that begin with the platform need.

    Raises:
        InputError: Not a geometry and a working mode.
    """
    try:
        known: PoseConstants = g.pose_constants[mode.code]
    except (AttributeError, LookupError, TypeError):
        return _new_pose_constants(g, mode)
    return known


def carriage_constants(g: Geometry, mode: AssemblyMode) -> CarriageConstants:
    """Return what the formulas that begin with the carriages need.

    Raises:
        InputError: Not a geometry and an assembly mode.
    """
    try:
        known: CarriageConstants = g.carriage_constants[mode.code]
    except (AttributeError, LookupError, TypeError):
        return _new_carriage_constants(g, mode)
    return known


def _new_pose_constants(g: Geometry, mode: WorkingMode) -> PoseConstants:
    _require(g, mode, WorkingMode)
    plane = Plane.of(g)
    constants = PoseConstants(
        cx=plane.cx,
        base=plane.base,
        l6=g.arm_length,
        l2=g.leg_length,
        half_l3=0.5 * g.coupler_length,
        xb=plane.xb,
        zb=plane.zb,
        l9=g.strut_length,
        v=float(mode.v),
        w1=float(mode.w1),
        w2=float(mode.w2),
        w3=float(mode.w3),
    )
    return _remember(g, "pose_constants", mode, constants)


def _new_carriage_constants(g: Geometry, mode: AssemblyMode) -> CarriageConstants:
    _require(g, mode, AssemblyMode)
    plane = Plane.of(g)
    F1, lift = plane.F1, plane.lift
    l2, l6, l9 = g.leg_length, g.arm_length, g.strut_length
    largest = l9 * l9 + l6 * l6 + F1 * F1 + (abs(lift) + l2) ** 2  # of the squares in ``cross``
    constants = CarriageConstants(
        l2=l2,
        l3=g.coupler_length,
        F1=F1,
        lift=lift,
        l6=l6,
        l9=l9,
        xb=plane.xb,
        zb=plane.zb,
        m=float(mode.m),
        n=float(mode.n),
        F1F1=F1 * F1,
        l6l6=l6 * l6,
        faint_rise=FAINT * l2 * l2,
        faint_cross=FAINT * largest * largest,
    )
    return _remember(g, "carriage_constants", mode, constants)


def _require(g: object, mode: object, kind: type[WorkingMode | AssemblyMode]) -> None:
    """Refuse what is no geometry, or not a mode of this kind."""
    if not isinstance(g, Geometry):
        hint = "; a Machine has one, machine.geometry" if hasattr(g, "geometry") else ""
        raise InputError(f"geometry must be a duoglide.Geometry, got {g!r:.80}{hint}")
    if not isinstance(mode, kind):
        raise InputError(f"mode must be a duoglide.{kind.__name__}, such as {kind()}, got {mode!r}")


def _remember(
    g: Geometry, slot: str, mode: WorkingMode | AssemblyMode, constants: _Constants
) -> _Constants:
    """Keep constants on the geometry, under the number of the mode."""
    if not hasattr(g, slot):
        object.__setattr__(g, slot, {})
    kept: _Constants = getattr(g, slot).setdefault(number(mode), constants)
    return kept
