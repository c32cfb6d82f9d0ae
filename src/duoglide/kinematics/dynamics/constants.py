"""The constant mass matrix and weights of the seven lengths W = (x, y, z, yA1, yA2, yA3, h).

Every moving part translates with a point, or is a uniform bar between two points, whose velocities
are components of dW/dt. A uniform bar of mass m with end velocities va and vb has the kinetic
energy m (va va + va vb + vb vb) / 6, whatever its length and however it lies; its spin about its
own axis is left out. So the kinetic energy is quadratic in dW/dt with constant factors. The
matrix couples the carriages with y, and the rise of the legs h with z; all else is diagonal.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from duoglide.machine import Geometry, Machine, Masses

KILOGRAM = 1e-3  # [N s^2/mm], the mass that 1 N makes 1 mm/s^2 quicker: 1000 kg


class MassConstants(NamedTuple):
    """What the formulas need of masses, friction and gravity, all floats: numba wants one type.

    Masses are in N s^2/mm, weights (the potential energy by each of the seven lengths) in N.

    Attributes:
        out: Mass that moves along x and z with the platform, without the payload.
        along: The same along y.
        rise: That of h.
        rise_z: Between h and z.
        a1: That of carriage 1.
        a2: That of carriage 2.
        a3: That of carriage 3.
        leg_y: Between carriage 1 or 2 and y.
        strut_y: Between carriage 3 and y.
        wx: Weight by x, without the payload.
        wy: By y.
        wz: By z.
        w1: By the place of carriage 1.
        w2: By that of carriage 2.
        w3: By that of carriage 3.
        wh: By h.
        gx: Acceleration of free fall, for the payload [mm/s^2].
        gy: The same.
        gz: The same.
        c1: Coulomb friction of rail 1 [N].
        c2: Of carriage 2.
        c3: Of carriage 3.
        d1: Viscous friction of rail 1 [N s/mm].
        d2: Of carriage 2.
        d3: Of carriage 3.
        payload: Mass that the platform carries; of a batch, a column.
    """

    out: float
    along: float
    rise: float
    rise_z: float
    a1: float
    a2: float
    a3: float
    leg_y: float
    strut_y: float
    wx: float
    wy: float
    wz: float
    w1: float
    w2: float
    w3: float
    wh: float
    gx: float
    gy: float
    gz: float
    c1: float
    c2: float
    c3: float
    d1: float
    d2: float
    d3: float
    payload: float


def mass_constants(machine: Machine) -> MassConstants:
    """Return what the formulas need of a machine's masses, with the machine's own payload."""
    return _mass_constants(machine.geometry, machine.masses)


@lru_cache(maxsize=64)
def _mass_constants(geometry: Geometry, given: Masses) -> MassConstants:
    masses = given.complete(geometry)
    parts = (masses.leg, masses.coupler, masses.riser, masses.arm, masses.strut, masses.platform)
    leg, coupler, riser, arm, strut, platform = (KILOGRAM * (part or 0.0) for part in parts)
    slides = [KILOGRAM * mass for mass in masses.carriage]
    moved = [mass + KILOGRAM * drive for mass, drive in zip(slides, masses.drive, strict=True)]
    coupler += riser
    out = platform + (arm + strut) / 3.0
    gx, gy, gz = masses.gravity
    a1, a2, a3 = (mass + bar / 3.0 for mass, bar in zip(moved, (leg, leg, strut), strict=True))
    w1, w2, w3 = (
        -gy * (mass + 0.5 * bar) for mass, bar in zip(slides, (leg, leg, strut), strict=True)
    )
    return MassConstants(
        out=out,
        along=platform + strut / 3.0 + arm + coupler + 2.0 * leg / 3.0,
        rise=coupler + arm / 3.0 + 2.0 * leg / 3.0,
        rise_z=arm / 6.0,
        a1=a1,
        a2=a2,
        a3=a3,
        leg_y=leg / 6.0,
        strut_y=strut / 6.0,
        wx=-gx * (platform + 0.5 * (arm + strut)),
        wy=-gy * (platform + 0.5 * strut + arm + coupler + leg),
        wz=-gz * (platform + 0.5 * (arm + strut)),
        w1=w1,
        w2=w2,
        w3=w3,
        wh=-gz * (coupler + 0.5 * arm + leg),
        gx=gx,
        gy=gy,
        gz=gz,
        **dict(zip(("c1", "c2", "c3"), masses.coulomb_friction, strict=True)),
        **dict(zip(("d1", "d2", "d3"), masses.viscous_friction, strict=True)),
        payload=KILOGRAM * masses.payload,
    )
