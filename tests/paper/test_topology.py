from __future__ import annotations

from fractions import Fraction

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
