"""The equations of motion, once: for one pose in floats, for columns in arrays, and compiled.

With the constant mass matrix M and weights g of the seven lengths W (``constants``), G = dW/dp and
J its rows of the carriages, forces F along +y and platform position p obey

    J^T F = G^T (M W'' + g)        and friction, which each carriage adds to its own force.

What the carriages themselves weigh and what accelerates them is theirs alone; the rest is a load on
the platform, which J^T distributes. J^T has a closed inverse. With the slopes (s hx, s) of the
legs' stroke by x and z, s = -h/p, and (qx, qz) of the strut's, loads (X, Y, Z) are in balance with

    F3 = (X - hx Z) / (w3 (qx - hx qz)),   w1 F1 + w2 F2 = (Z - w3 qz F3) / s,   F1 + F2 = Y - F3,

which grows without bound where the legs lie flat (h = 0) and where arm and strut are in line
(X A = Z u, as in ``kinematics.kernels``).
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from duoglide.arrays import FloatArray
from duoglide.kinematics.constants import PoseConstants
from duoglide.kinematics.derivatives import Three, root_rates
from duoglide.kinematics.dynamics.constants import MassConstants
from duoglide.kinematics.kernels import SINGULAR


class Levers(NamedTuple):
    """One pose, as the legend of ``kinematics.kernels`` has it, and its slopes.

    Attributes:
        u: Run of the arm along x, from upright [mm].
        A: Its rise.
        h: Rise of the legs.
        p: Stroke of the legs.
        X: From B3 to C3 along x.
        Z: The same along z.
        q: Stroke of the strut.
        hx: Slope of h by x; that by z is 1.
        s: Slope of p by h.
        qx: Slope of q by x.
        qz: Slope of q by z.
    """

    u: float
    A: float
    h: float
    p: float
    X: float
    Z: float
    q: float
    hx: float
    s: float
    qx: float
    qz: float


class Loads(NamedTuple):
    """What the carriages take of themselves [N], and what the platform passes on to them [N]."""

    a1: float
    a2: float
    a3: float
    x: float
    y: float
    z: float


def levers_pose(x: float, z: float, k: PoseConstants) -> Levers:
    """Return the roots and slopes of one pose."""
    l6, l2, l9 = k.l6, k.l2, k.l9
    u = x - k.cx
    X = x - k.xb
    Z = z - k.zb
    A = k.v * sqrt((l6 - u) * (l6 + u))
    h = z - k.base - A
    p = sqrt((l2 - h) * (l2 + h))
    q = sqrt(l9 * l9 - (X * X + Z * Z))
    return Levers(u, A, h, p, X, Z, q, u / A, -h / p, -X / q, -Z / q)


def sure_pose(at: Levers, k: PoseConstants) -> bool:
    """Whether forces on the platform reach the carriages: no parallel singularity is here."""
    return (abs(at.h) > SINGULAR) & (abs(at.X * at.A - at.Z * at.u) > SINGULAR * k.l6)


def carriage_rates(at: Levers, velocity: Three, k: PoseConstants) -> Three:
    """Return the velocities of the carriages."""
    vx, vy, vz = velocity
    p1 = at.s * (at.hx * vx + vz)
    return vy + k.w1 * p1, vy + k.w2 * p1, vy + k.w3 * (at.qx * vx + at.qz * vz)


def inertia_pose(
    at: Levers,
    velocity: Three,
    acceleration: Three,
    k: PoseConstants,
    m: MassConstants,
) -> Loads:
    """Return M W'', gathered on the carriages and the platform; W'' is exact.

    Args:
        at: The pose.
        velocity: Of the platform, or its first derivative by any parameter.
        acceleration: Of the platform, or its second derivative by the same one.
        k: Of the geometry.
        m: Of the masses.
    """
    vx, _, vz = velocity
    ax, ay, az = acceleration
    none = (0.0, 0.0, 0.0)
    A1, A2 = root_rates(at.A, (at.u, vx, ax), none)
    h1, h2 = vz - A1, az - A2
    _, p2 = root_rates(at.p, (at.h, h1, h2), none)
    _, q2 = root_rates(at.q, (at.X, vx, ax), (at.Z, vz, az))
    y1, y2, y3 = ay + k.w1 * p2, ay + k.w2 * p2, ay + k.w3 * q2
    rise = m.rise * h2 + m.rise_z * az
    out = m.out + m.payload
    return Loads(
        m.a1 * y1 + m.leg_y * ay,
        m.a2 * y2 + m.leg_y * ay,
        m.a3 * y3 + m.strut_y * ay,
        out * ax + at.hx * rise,
        (m.along + m.payload) * ay + m.leg_y * (y1 + y2) + m.strut_y * y3,
        out * az + m.rise_z * h2 + rise,
    )


def weight_pose(at: Levers, m: MassConstants) -> Loads:
    """Return the weights, gathered on the carriages and the platform."""
    return Loads(
        m.w1,
        m.w2,
        m.w3,
        m.wx - m.payload * m.gx + at.hx * m.wh,
        m.wy - m.payload * m.gy,
        m.wz - m.payload * m.gz + m.wh,
    )


def distribute_pose(at: Levers, loads: Loads, k: PoseConstants) -> Three:
    """Return the forces of the carriages that are in balance with loads [N]."""
    own3 = (loads.x - at.hx * loads.z) / (k.w3 * (at.qx - at.hx * at.qz))
    legs = (loads.z - k.w3 * at.qz * own3) / at.s
    both, apart = loads.y - own3, k.w2 - k.w1
    own1 = (k.w2 * both - legs) / apart
    return loads.a1 + own1, loads.a2 + (both - own1), loads.a3 + own3


def friction(speed: float, coulomb: float, viscous: float) -> float:
    """Return the force that moves a carriage against its rail's friction; at rest none [N]."""
    return coulomb * (1.0 * (speed > 0.0) - 1.0 * (speed < 0.0)) + viscous * speed


def forces_pose(
    pose: Three,
    velocity: Three,
    acceleration: Three,
    k: PoseConstants,
    m: MassConstants,
) -> tuple[float, float, float, bool]:
    """Return the forces of the carriages at one pose [N], and whether they are sure."""
    x, _, z = pose
    at = levers_pose(x, z, k)
    moved = inertia_pose(at, velocity, acceleration, k, m)
    held = weight_pose(at, m)
    loads = Loads(
        moved.a1 + held.a1,
        moved.a2 + held.a2,
        moved.a3 + held.a3,
        moved.x + held.x,
        moved.y + held.y,
        moved.z + held.z,
    )
    f1, f2, f3 = distribute_pose(at, loads, k)
    v1, v2, v3 = carriage_rates(at, velocity, k)
    return (
        f1 + friction(v1, m.c1, m.d1),
        f2 + friction(v2, m.c2, m.d2),
        f3 + friction(v3, m.c3, m.d3),
        sure_pose(at, k),
    )


def matrix_pose(
    at: Levers, k: PoseConstants, m: MassConstants
) -> tuple[float, float, float, float, float, float]:
    """Return G^T M G, the mass matrix in (x, y, z): xx, yy, zz, xy, xz, yz [N s^2/mm]."""
    out = m.out + m.payload
    legs = (m.a1 + m.a2) * at.s * at.s  # w1 and w2 are signs
    pull = ((m.a1 + m.leg_y) * k.w1 + (m.a2 + m.leg_y) * k.w2) * at.s
    turn = (m.a3 + m.strut_y) * k.w3
    bend = at.hx * (m.rise + legs)
    return (
        out + at.hx * bend + m.a3 * at.qx * at.qx,
        m.along + m.payload + m.a1 + m.a2 + m.a3 + 4.0 * m.leg_y + 2.0 * m.strut_y,
        out + m.rise + 2.0 * m.rise_z + legs + m.a3 * at.qz * at.qz,
        pull * at.hx + turn * at.qx,
        bend + at.hx * m.rise_z + m.a3 * at.qx * at.qz,
        pull + turn * at.qz,
    )


def acceleration_pose(
    pose: Three,
    velocity: Three,
    forces: Three,
    k: PoseConstants,
    m: MassConstants,
) -> Three:
    """Return the acceleration of the platform under forces on the carriages [mm/s^2].

    What is left of the forces once friction, weights and the part of W'' that velocity alone makes
    are taken off, over the mass matrix, which Cholesky's scheme factors.
    """
    x, _, z = pose
    at = levers_pose(x, z, k)
    moved = inertia_pose(at, velocity, (0.0, 0.0, 0.0), k, m)
    held = weight_pose(at, m)
    v1, v2, v3 = carriage_rates(at, velocity, k)
    f1 = forces[0] - friction(v1, m.c1, m.d1) - moved.a1 - held.a1
    f2 = forces[1] - friction(v2, m.c2, m.d2) - moved.a2 - held.a2
    f3 = forces[2] - friction(v3, m.c3, m.d3) - moved.a3 - held.a3
    legs = at.s * (k.w1 * f1 + k.w2 * f2)
    bx = at.hx * legs + k.w3 * at.qx * f3 - moved.x - held.x
    by = f1 + f2 + f3 - moved.y - held.y
    bz = legs + k.w3 * at.qz * f3 - moved.z - held.z
    xx, yy, zz, xy, xz, yz = matrix_pose(at, k, m)
    # L D L^T in the order y, x, z
    lx, lz = xy / yy, yz / yy
    dx = xx - lx * xy
    lxz = (xz - lz * xy) / dx
    dz = zz - lz * yz - lxz * lxz * dx
    bx = bx - lx * by
    az = (bz - lz * by - lxz * bx) / dz
    ax = bx / dx - lxz * az
    return ax, by / yy - lx * ax - lz * az, az


def kinetic_pose(pose: Three, velocity: Three, k: PoseConstants, m: MassConstants) -> float:
    """Return the kinetic energy at one pose [N mm]."""
    x, _, z = pose
    vx, vy, vz = velocity
    xx, yy, zz, xy, xz, yz = matrix_pose(levers_pose(x, z, k), k, m)
    square = xx * vx * vx + yy * vy * vy + zz * vz * vz
    return 0.5 * square + xy * vx * vy + xz * vx * vz + yz * vy * vz


def potential_pose(pose: Three, k: PoseConstants, m: MassConstants) -> float:
    """Return the potential energy at one pose [N mm], but for a constant of the machine."""
    x, y, z = pose
    at = levers_pose(x, z, k)
    own = m.w1 * (y + k.w1 * at.p) + m.w2 * (y + k.w2 * at.p) + m.w3 * (y + k.w3 * at.q)
    carried = m.payload * (m.gx * x + m.gy * y + m.gz * z)
    return m.wx * x + m.wy * y + m.wz * z + m.wh * at.h + own - carried


def forces_loop(
    flat: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    steps: tuple[int, int, int, int],
    out: FloatArray,
    constants: tuple[float, ...],
    masses: tuple[float, ...],
) -> int:
    """Run ``forces_pose`` along a batch; return how many poses it cannot answer.

    Args:
        flat: Position, velocity and acceleration, x, y, z, x, ..., and payload.
        steps: How far apart in each of them two poses are: 0 where one value is for all.
        out: Forces 1, 2, 3, 1, ...
        constants: ``PoseConstants`` as a plain tuple.
        masses: ``MassConstants`` likewise, without the payload.
    """
    k = PoseConstants(*constants)
    position, velocity, acceleration, payload = flat
    i0, i1, i2, i3 = steps
    failed = 0
    for i in range(out.size // 3):
        r, v, a = i * i0, i * i1, i * i2
        f1, f2, f3, sure = forces_pose(
            (position[r], position[r + 1], position[r + 2]),
            (velocity[v], velocity[v + 1], velocity[v + 2]),
            (acceleration[a], acceleration[a + 1], acceleration[a + 2]),
            k,
            MassConstants(*(*masses, payload[i * i3])),
        )
        out[3 * i] = f1
        out[3 * i + 1] = f2
        out[3 * i + 2] = f3
        total = f1 + f2 + f3
        failed += not ((total - total == 0.0) & sure)
    return failed
