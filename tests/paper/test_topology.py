from __future__ import annotations

from fractions import Fraction
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from duoglide.errors import InputError
from duoglide.paper.topology import (
    Directions,
    Joint,
    JointKind,
    Mechanism,
    Poc,
    analyse,
    crr3,
    decompositions,
    delta,
    duoglide_robot,
    orthoglide,
    poc_between,
    rrc3,
    screw_mobility,
    upu3,
)
from duoglide.paper.topology.poc import chain_poc

X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
TRANSLATIONAL = [duoglide_robot(), delta(), orthoglide(), rrc3(), crr3(), upu3()]
SPACE = Poc(Directions.span(X, Y, Z))

whole = st.integers(-5, 5)
spans = st.lists(st.tuples(whole, whole, whole), max_size=3).map(lambda v: Directions.span(*v))


def revolute(*axis: int) -> Poc:
    return Joint.of(JointKind.REVOLUTE, ("a", "b"), axis).poc


@settings(max_examples=100, derandomize=True, deadline=None)
@given(spans, spans)
def test_union_and_intersection_keep_the_sum_of_dimensions(a: Directions, b: Directions) -> None:
    assert (a | b).dimension + (a & b).dimension == a.dimension + b.dimension
    assert (a & b) <= a <= (a | b)


@settings(max_examples=50, derandomize=True, deadline=None)
@given(spans)
def test_the_perpendicular_of_the_perpendicular_is_the_subspace(a: Directions) -> None:
    assert a.perpendicular().perpendicular() == a
    assert a.dimension + a.perpendicular().dimension == 3


@pytest.mark.parametrize(
    ("chain", "translations", "rotations"),
    [
        ([revolute(*X)], 0, 1),
        ([revolute(*X)] * 2, 1, 1),
        ([revolute(*X)] * 3, 2, 1),
        ([revolute(*X)] * 4, 2, 1),
        ([revolute(*X), revolute(*Y)], 0, 2),
        ([Joint.of(JointKind.SPHERICAL, ("a", "b")).poc] * 2, 2, 3),
        ([Joint.of(JointKind.PRISMATIC, ("a", "b"), Y).poc, *[revolute(*X)] * 2], 2, 1),
        ([Joint.of(JointKind.CYLINDRICAL, ("a", "b"), X).poc, *[revolute(*X)] * 2], 3, 1),
    ],
)
def test_joints_in_series_unite_as_the_theory_says(
    chain: list[Poc], translations: int, rotations: int
) -> None:
    poc = chain_poc(chain)
    assert (poc.translations.dimension, poc.rotations.dimension) == (translations, rotations)


def test_parallel_revolutes_translate_across_their_axis_only() -> None:
    assert chain_poc([revolute(*X)] * 3).translations == Directions.span(Y, Z)


@pytest.mark.parametrize("mechanism", TRANSLATIONAL, ids=lambda m: m.name)
def test_every_translational_mechanism_has_poc_t3_r0_and_three_freedoms(
    mechanism: Mechanism,
) -> None:
    topology = analyse(mechanism)
    assert topology.poc == SPACE
    assert topology.dof == 3
    assert topology.closes


@pytest.mark.parametrize(
    "mechanism", [*TRANSLATIONAL, duoglide_robot(strut_axis=X)], ids=lambda m: m.name
)
@pytest.mark.parametrize("seed", [0, 1])
def test_screws_at_a_random_placement_agree_with_the_algebra(
    mechanism: Mechanism, seed: int
) -> None:
    topology, screws = analyse(mechanism), screw_mobility(mechanism, seed)
    assert screws.dof == topology.dof
    assert screws.platform == topology.poc.dimension
    assert screws.rotations == topology.poc.rotations.dimension


@pytest.mark.parametrize("mechanism", TRANSLATIONAL, ids=lambda m: m.name)
def test_dof_and_the_number_of_loops_do_not_depend_on_the_decomposition(
    mechanism: Mechanism,
) -> None:
    found = list(decompositions(mechanism))
    assert len(found) == 3  # two loops: each of three cycles, and the ear that is left
    assert {candidate.dof for candidate in found} == {3}
    assert {len(candidate.socs) for candidate in found} == {mechanism.loop_count}


@pytest.mark.parametrize(
    ("mechanism", "deltas", "kappa"),
    [
        (duoglide_robot(), (1, -1), 1),  # the paper, Section 2.2.3
        # What Eqs. 5-7 give; no source at hand states these five.
        (delta(), (1, -1), 1),
        (orthoglide(), (1, -1), 1),
        (rrc3(), (1, -1), 1),
        (crr3(), (1, -1), 1),
        (upu3(), (2, -2), 2),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_coupling_degree_is_least_over_the_decompositions(
    mechanism: Mechanism, deltas: tuple[int, ...], kappa: int
) -> None:
    topology = analyse(mechanism)
    assert topology.decomposition.constraint_degrees == deltas
    assert topology.coupling_degree == kappa
    assert all(kappa <= candidate.kappa for candidate in decompositions(mechanism))


def test_minimising_over_decompositions_matters() -> None:
    # With R32 parallel to R13 one order of the loops couples more than another.
    kappas = {candidate.kappa for candidate in decompositions(duoglide_robot(strut_axis=X))}
    assert len(kappas) == 2


def test_a_bridge_between_two_chains_is_refused_by_the_reduction() -> None:
    joints = [
        Joint.of(JointKind.REVOLUTE, pair, X)
        for pair in (("a", "b"), ("a", "c"), ("b", "c"), ("b", "d"), ("c", "d"))
    ]
    with pytest.raises(InputError, match="series-parallel"):
        poc_between(joints, "a", "d")


def test_links_that_are_not_connected_are_refused() -> None:
    joints = [Joint.of(JointKind.REVOLUTE, ("a", "b"), X)]
    with pytest.raises(InputError, match="'a' and 'd'"):
        poc_between(joints, "a", "d")


@pytest.mark.parametrize(
    ("kind", "axes"),
    [
        (JointKind.REVOLUTE, [(0, 0, 0)]),
        (JointKind.REVOLUTE, []),
        (JointKind.UNIVERSAL, [X, (Fraction(2), 0, 0)]),
        (JointKind.SPHERICAL, [X]),
    ],
)
def test_a_joint_with_wrong_axes_is_refused(
    kind: JointKind, axes: list[tuple[int, int, int]]
) -> None:
    with pytest.raises(InputError, match="axes"):
        Joint.of(kind, ("a", "b"), *axes)


def test_a_mechanism_without_a_platform_is_refused() -> None:
    with pytest.raises(InputError, match="platform"):
        Mechanism("half", (Joint.of(JointKind.REVOLUTE, ("base", "arm"), X),))


def limbs(count: int, steps: list[tuple[JointKind, tuple[tuple[int, int, int], ...]]]) -> Mechanism:
    """Return base and platform joined by ``count`` limbs of the same joints."""
    joints = []
    for limb in range(count):
        names = ["base", *(f"{limb} {k}" for k in range(1, len(steps))), "platform"]
        joints += [
            Joint.of(kind, (names[k], names[k + 1]), *axes) for k, (kind, axes) in enumerate(steps)
        ]
    return Mechanism("limbs", tuple(joints))


@pytest.mark.parametrize("normal", [(1, 1, 1), (0, 0, 1), (1, 2, 4), (1, 5, 25), (3, -7, 11)])
def test_a_planar_mechanism_is_planar_whatever_its_normal(normal: tuple[int, int, int]) -> None:
    planar = limbs(3, [(JointKind.REVOLUTE, (normal,))] * 3)
    found = analyse(planar)
    assert str(found.poc) == "(t2, r1)"
    assert found.dof == screw_mobility(planar).dof == 3


def test_limbs_of_six_freedoms_leave_all_six_whatever_their_axes() -> None:
    draw = Random(5)
    for _ in range(80):
        axes = [tuple(draw.randint(-5, 5) for _ in range(3)) for _ in range(3)]
        if Directions.span(*axes).dimension < 3:
            continue
        steps = [
            (JointKind.UNIVERSAL, (axes[0], axes[1])),
            (JointKind.PRISMATIC, (axes[2],)),
            (JointKind.SPHERICAL, ()),
        ]
        limb = limbs(1, steps)
        assert str(poc_between(limb.joints, "base", "platform")) == "(t3, r3)", axes
        hexapod = limbs(6, steps)
        assert str(poc_between(hexapod.joints, "base", "platform")) == "(t3, r3)", axes


def test_a_serial_arm_is_refused_with_what_would_do() -> None:
    arm = limbs(1, [(JointKind.REVOLUTE, (X,)), (JointKind.REVOLUTE, (Y,))])
    with pytest.raises(InputError, match=r"no loop.*poc_between"):
        analyse(arm)


def joined(
    name: str, *chains: list[tuple[JointKind, tuple[tuple[int, int, int], ...]]]
) -> Mechanism:
    """Return base and platform joined by these chains."""
    joints = []
    for limb, steps in enumerate(chains):
        names = ["base", *(f"{limb} {k}" for k in range(1, len(steps))), "platform"]
        joints += [
            Joint.of(kind, (names[k], names[k + 1]), *axes) for k, (kind, axes) in enumerate(steps)
        ]
    return Mechanism(name, tuple(joints))


R, P, U, S = JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.UNIVERSAL, JointKind.SPHERICAL
AROUND = ((5, 1, 0), (-3, 4, 0), (-2, -6, 0))
KNOWN = {
    "Sarrus": (joined("Sarrus", [(R, (X,))] * 3, [(R, (Y,))] * 3), "(t1, r0)", 1),
    "four-bar": (joined("four-bar", [(R, (Z,))] * 2, [(R, (Z,))] * 2), "(t0, r1)", 1),
    "planar 3-RRR": (joined("planar 3-RRR", *[[(R, (Z,))] * 3] * 3), "(t2, r1)", 3),
    "planar 4-RRR": (joined("planar 4-RRR", *[[(R, (Z,))] * 3] * 4), "(t2, r1)", 3),
    "Tricept": (
        joined(
            "Tricept",
            [(U, (X, Y)), (P, (Z,))],
            *[[(U, (a, Y)), (P, ((a[0], a[1], 7),)), (S, ())] for a in AROUND],
        ),
        "(t1, r2)",
        3,
    ),
}
REFUSED = {
    "3-RPS": joined("3-RPS", *[[(R, (a,)), (P, (Z,)), (S, ())] for a in AROUND]),
    "3-PRS": joined("3-PRS", *[[(P, (Z,)), (R, (a,)), (S, ())] for a in AROUND]),
    "3-RRS": joined("3-RRS", *[[(R, (a,)), (R, (a,)), (S, ())] for a in AROUND]),
    "spherical 3-RRR": joined(
        "spherical 3-RRR",
        *[[(R, (a,)), (R, ((a[1], 3, a[0]),)), (R, (Z,))] for a in AROUND],
    ),
    "Bennett": joined(
        "Bennett", [(R, (X,)), (R, ((1, 2, 0),))], [(R, ((1, 2, 3),)), (R, ((4, 0, 1),))]
    ),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_mechanisms_have_their_mobility(name: str) -> None:
    mechanism, poc, dof = KNOWN[name]
    found = analyse(mechanism)
    assert (str(found.poc), found.dof) == (poc, dof)


@pytest.mark.parametrize("name", REFUSED)
def test_what_pairs_of_subspaces_cannot_say_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="cannot represent this mechanism"):
        analyse(REFUSED[name])
