from __future__ import annotations

import sys
import time
from functools import cache

import numpy as np
import pytest

import duoglide as dg
from duoglide.errors import ConfigError
from duoglide.paper.elimination import (
    Dimensions,
    Family,
    Space,
    Surface,
    loop_equations,
    singularities,
    surfaces,
)
from duoglide.paper.elimination.surfaces import surface

TABLE_1 = dg.Geometry()
LIFTED = dg.Geometry(riser_height=13.0, arm_drop=7.25, strut_drop=-5.0, leg_length=170.0)
GEOMETRIES = [TABLE_1, LIFTED]
IDS = ["Table 1", "riser and drops"]


@cache
def all_surfaces(index: int) -> dict[tuple[Family, Space], Surface]:
    return {(s.family, s.space): s for s in surfaces(GEOMETRIES[index])}


def singular_poses(geometry: dg.Geometry, family: Family, count: int = 30) -> np.ndarray:
    """Positions on a surface that the links reach, by the short form of the paper."""
    g, random = geometry, np.random.default_rng(7)
    k = g.rail_half_spacing - g.platform_half_width
    base, foot = g.carriage_height + g.riser_height + g.arm_drop, g.carriage_height + g.strut_drop
    x = k + g.arm_length * random.uniform(-0.99, 0.99, 4000)
    if family is Family.ARM_FLAT:
        x = k + g.arm_length * random.choice([-1.0, 1.0], x.size)
    cos, rise = (k - x) / g.arm_length, random.uniform(-0.9, 0.9, x.size) * g.leg_length
    A, X = g.arm_length * np.sqrt(np.maximum(1 - cos**2, 0.0)), x + k
    inside = np.sqrt(np.maximum(g.strut_length**2 - X**2, 0.0))
    z = {
        Family.LEGS_FLAT: base + A,
        Family.LEGS_VERTICAL: base + A + g.leg_length * random.choice([-1, 1], x.size),
        Family.STRUT: foot + inside,
        Family.ARM_STRUT: foot - X * A / (g.arm_length * cos),
    }.get(family, base + A + rise)
    poses = np.stack([x, random.uniform(-50, 50, x.size), z], axis=1)
    return poses[dg.reachable(g, poses)][:count]


@pytest.mark.parametrize("index", range(2), ids=IDS)
@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize("family", Family)
def test_points_of_a_surface_are_roots_of_its_polynomial(
    index: int, family: Family, space: Space
) -> None:
    found = all_surfaces(index)[family, space]
    geometry = GEOMETRIES[index]
    poses = singular_poses(geometry, family)
    assert len(poses) == 30
    mode = dg.WorkingMode(1, 1, 1, 1) if family is Family.LEGS_PARALLEL else dg.WorkingMode()
    points = poses[:, [0, 2]] if space is Space.WORKSPACE else dg.inverse(geometry, poses, mode)
    if not found.factors:
        assert (family, space) == (Family.LEGS_PARALLEL, Space.WORKSPACE)
        return
    nearest = np.min([np.abs(d) for d in distances(found, points)], axis=0)
    edge = family in (Family.LEGS_VERTICAL, Family.STRUT) and space is Space.CARRIAGES
    assert nearest.max() < (1e-4 if edge else 1e-8)  # on an edge carriages move as a square root


def distances(found: Surface, points: np.ndarray) -> list[np.ndarray]:
    """First-order distance [mm] of the points to each factor's surface."""
    values = found.values(*points.T)
    step = 1e-4
    slopes = [
        [
            (up - down) / (2 * step)
            for up, down in zip(
                found.values(*(points + shift).T), found.values(*(points - shift).T), strict=True
            )
        ]
        for shift in step * np.eye(points.shape[1])
    ]
    return [
        value / np.linalg.norm([np.broadcast_to(s[i], len(points)) for s in slopes], axis=0)
        for i, value in enumerate(values)
    ]


@pytest.mark.parametrize(
    ("family", "space", "plain", "lifted"),
    [
        (Family.ARM_STRUT, Space.WORKSPACE, (4,), (4,)),
        (Family.ARM_STRUT, Space.CARRIAGES, (4,), (8,)),  # l4 + l7 = l8, and not
        (Family.LEGS_FLAT, Space.WORKSPACE, (2,), (2,)),
        (Family.LEGS_FLAT, Space.CARRIAGES, (1, 1), (1, 1)),
        (Family.LEGS_VERTICAL, Space.WORKSPACE, (2, 2), (2, 2)),
        (Family.LEGS_VERTICAL, Space.CARRIAGES, (1,), (1,)),
        (Family.LEGS_PARALLEL, Space.CARRIAGES, (1,), (1,)),
        (Family.STRUT, Space.WORKSPACE, (2,), (2,)),
        (Family.STRUT, Space.CARRIAGES, (1,), (1,)),
        (Family.ARM_FLAT, Space.WORKSPACE, (1, 1), (1, 1)),
        (Family.ARM_FLAT, Space.CARRIAGES, (2, 2), (4, 4)),
    ],
)
def test_degrees_of_the_surfaces(
    family: Family, space: Space, plain: tuple[int, ...], lifted: tuple[int, ...]
) -> None:
    assert all_surfaces(0)[family, space].degrees == plain
    assert all_surfaces(1)[family, space].degrees == lifted


def test_legs_parallel_fill_the_workspace_of_their_modes() -> None:
    assert all_surfaces(0)[Family.LEGS_PARALLEL, Space.WORKSPACE].polynomial == 0


def test_planes_and_circles_are_those_of_table_1() -> None:
    sympy = pytest.importorskip("sympy")
    x, z, a1, a2, a3 = sympy.symbols("x z yA1 yA2 yA3")
    expected = {
        (Family.LEGS_FLAT, Space.CARRIAGES): (a2 - a1 - 120 - 320) * (a2 - a1 - 120 + 320),
        (Family.STRUT, Space.CARRIAGES): a1 + a2 - 2 * a3,
        (Family.STRUT, Space.WORKSPACE): (x + 45) ** 2 + (z - 70) ** 2 - 300**2,
        (Family.LEGS_FLAT, Space.WORKSPACE): (x - 45) ** 2 + (z - 70) ** 2 - 180**2,
        (Family.ARM_FLAT, Space.WORKSPACE): (x + 135) * (x - 225),
    }
    for key, polynomial in expected.items():
        found = all_surfaces(0)[key].polynomial
        assert sympy.expand(found - polynomial) == 0 or sympy.expand(found + polynomial) == 0


@pytest.mark.parametrize("index", range(2), ids=IDS)
def test_spurious_factors_are_taken_out_and_named(index: int) -> None:
    sympy = pytest.importorskip("sympy")
    a1, a2 = sympy.symbols("yA1 yA2")
    found = all_surfaces(index)[Family.ARM_STRUT, Space.CARRIAGES]
    plane = next(s for s in found.spurious if s.meaning.startswith("yA2 - yA1 - l3"))
    assert sympy.expand(plane.polynomial - (a2 - a1 - 120)) == 0
    poses = dg.inverse(GEOMETRIES[index], singular_poses(GEOMETRIES[index], Family.ARM_STRUT))
    told = {s.meaning.split(":")[0] for s in found.spurious}
    assert told <= {"yA2 - yA1 - l3 = 0", "F3 = 0", "F1^2 + F3^2 = 0"}
    for spurious in found.spurious:
        values = sympy.lambdify(sympy.symbols("yA1 yA2 yA3"), spurious.polynomial)(*poses.T)
        assert np.abs(values).min() > 1e-3  # no singular pose lies on it


@pytest.fixture(scope="module")
def general() -> dict[tuple[Family, Space], Surface]:
    return {(s.family, s.space): s for s in surfaces()}


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize("family", Family)
def test_symbolic_dimensions_give_the_numeric_polynomials(
    general: dict[tuple[Family, Space], Surface], family: Family, space: Space
) -> None:
    """At rational points both are multiples of each other, exactly, by one number."""
    sympy = pytest.importorskip("sympy")
    symbols, numbers = Dimensions.symbols(), Dimensions.of(LIFTED)
    values = {getattr(symbols, n): getattr(numbers, n) for n in Dimensions.__slots__}
    surface, special = general[family, space], all_surfaces(1)[family, space]
    assert surface.degrees == special.degrees
    random, ratios = np.random.default_rng(3), set()
    for _ in range(4):
        point = random.integers(-400, 400, len(surface.variables)).tolist()
        at = dict(zip(surface.variables, map(sympy.Integer, point), strict=True))
        ratios.add(
            surface.polynomial.subs(values | at) - special.polynomial.subs(at)
            if special.polynomial == 0
            else surface.polynomial.subs(values | at) / special.polynomial.subs(at)
        )
    assert len(ratios) == 1
    assert ratios.pop().is_Rational


def test_symbolic_dimensions_take_seconds(
    general: dict[tuple[Family, Space], Surface],
) -> None:
    start = time.process_time()
    found = surface(loop_equations(Dimensions.symbols()), Family.ARM_STRUT, Space.CARRIAGES)
    used = time.process_time() - start
    print(f"case 2 in the carriages, symbolic: {used:.2f} s of processor time")
    assert found.degrees == general[Family.ARM_STRUT, Space.CARRIAGES].degrees == (8,)
    assert used < 8.0  # about 1 s on a quiet core


@pytest.mark.parametrize("index", range(2), ids=IDS)
def test_factors_are_irreducible_and_of_the_degree_that_they_say(index: int) -> None:
    sympy = pytest.importorskip("sympy")
    for found in all_surfaces(index).values():
        for factor, degree in zip(found.factors, found.degrees, strict=True):
            polynomial = sympy.Poly(factor, *found.variables)
            assert polynomial.total_degree() == degree
            assert polynomial.is_irreducible


def test_the_determinants_hold_the_families_that_the_paper_misses() -> None:
    sympy = pytest.importorskip("sympy")
    loops = loop_equations(Dimensions.symbols())
    g, (x, y, z), (a1, a2, a3) = loops.dimensions, loops.position, loops.carriages
    c, s = loops.cosine, loops.sine
    found = singularities(loops)

    def same(factors: tuple[object, ...], expected: list[object]) -> bool:
        return len(factors) == len(expected) and all(
            any(sympy.expand(f - e) == 0 or sympy.expand(f + e) == 0 for f in factors)
            for e in expected
        )

    h = z - g.l7 - g.l4 - g.l1 - g.l6 * s
    X, Z = x - g.d + g.b, z - g.l8 - g.l1
    assert same(found.parallel, [a2 - a1 - g.l3, h, X * s + Z * c])
    assert same(found.serial, [s, 2 * y - g.l3 - 2 * a1, 2 * y + g.l3 - 2 * a2, y - a3])


def test_without_sympy_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    with pytest.raises(ConfigError, match=r"duoglide\[symbolic\]"):
        surfaces(TABLE_1)
