from __future__ import annotations

from itertools import product
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.kinematics import batch as _batch
from duoglide.kinematics.constants import pose_constants
from duoglide.kinematics.kernels import in_numpy, inverse_pose
from duoglide.kinematics.model import inverse_derivatives
from duoglide.kinematics.singularity.case2 import curve_of

ALL_MODES = [dg.WorkingMode(*signs) for signs in product((1, -1), repeat=4)]
DEFINITE_MODES = [mode for mode in ALL_MODES if mode.w1 != mode.w2]
TABLE_2 = {
    (1, 1): (-80.3862, 66.7300, 307.2328),
    (1, -1): (194.7183, 66.7300, 78.1662),
    (-1, 1): (194.7183, 66.7300, 61.8338),
    (-1, -1): (-80.3862, 66.7300, -167.2328),
}

lengths = st.floats(60.0, 300.0)
offsets = st.floats(-60.0, 60.0)
unit = st.floats(0.01, 0.99)


@st.composite
def reached(draw: Any) -> tuple[dg.Geometry, dg.WorkingMode, np.ndarray]:
    """Build a pose from its joints outward, so that it closes for whatever dimensions."""
    beta = np.pi * draw(unit) * draw(st.sampled_from([1, -1]))
    alpha = np.pi * draw(unit) * draw(st.sampled_from([1, -1]))
    dimensions = {
        "rail_half_spacing": draw(st.floats(20.0, 150.0)),
        "platform_half_width": draw(st.floats(-30.0, 120.0)),
        "carriage_height": draw(offsets),
        "leg_length": draw(lengths),
        "coupler_length": draw(lengths),
        "riser_height": draw(offsets),
        "arm_length": draw(lengths),
        "arm_drop": draw(offsets),
        "strut_drop": draw(offsets),
    }
    b, d, l1, l2, l4, l6, l7, l8 = (
        dimensions[key]
        for key in (
            "rail_half_spacing",
            "platform_half_width",
            "carriage_height",
            "leg_length",
            "riser_height",
            "arm_length",
            "arm_drop",
            "strut_drop",
        )
    )
    x = b - d - l6 * np.cos(beta)
    z = l1 + l4 + l7 + l2 * np.sin(alpha) + l6 * np.sin(beta)
    projection = np.hypot(x - d + b, z - l8 - l1)
    geometry = dg.Geometry(
        strut_length=float(projection / draw(st.floats(0.05, 0.98))), **dimensions
    )
    w1, w2 = draw(st.sampled_from([(1, -1), (-1, 1)]))
    mode = dg.WorkingMode(int(np.sign(beta)), w1, w2, draw(st.sampled_from([1, -1])))
    return geometry, mode, np.array([x, draw(st.floats(-500.0, 500.0)), z])


def assembly_of(geometry: dg.Geometry, pose: np.ndarray, mode: dg.WorkingMode) -> dg.AssemblyMode:
    sides = dg.margins(geometry, pose, mode)
    return dg.AssemblyMode(m=int(np.sign(sides.legs_flat)), n=int(np.sign(sides.arm_strut)))


@given(reached())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_forward_undoes_inverse_in_every_mode(case: Any) -> None:
    geometry, mode, pose = case
    assume(dg.clearance(geometry, pose, mode) > 1e-2)
    assembly = assembly_of(geometry, pose, mode)
    back = dg.forward(geometry, dg.inverse(geometry, pose, mode), assembly)
    np.testing.assert_allclose(back, pose, rtol=0, atol=1e-7)


@given(reached())
@settings(max_examples=100, deadline=None, derandomize=True)
def test_jacobian_is_the_complex_step_derivative(case: Any) -> None:
    geometry, mode, pose = case
    assume(dg.clearance(geometry, pose, mode) > 1e-2)
    expected = np.empty((3, 3))
    for axis in range(3):
        moved = pose.astype(complex)
        moved[axis] += 1e-30j
        with_step = in_numpy(inverse_pose)(*moved, pose_constants(geometry, mode))
        expected[:, axis] = np.imag(with_step) / 1e-30
    np.testing.assert_allclose(dg.jacobian(geometry, pose, mode), expected, rtol=1e-9, atol=1e-12)


@given(reached(), st.lists(st.floats(-50.0, 50.0), min_size=9, max_size=9))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_inverse_derivatives_are_those_of_forty_digits(case: Any, rates: list[float]) -> None:
    geometry, mode, pose = case
    assume(dg.clearance(geometry, pose, mode) > 1.0)
    derivatives = np.vstack([pose, np.reshape(rates, (3, 3))])
    kernel = type(inverse_pose)(inverse_pose.__code__, {"sqrt": mpmath.sqrt})
    constants = pose_constants(geometry, mode)
    with mpmath.workdps(40):
        polynomials = [
            [mpmath.mpf(float(value)) / mpmath.factorial(i) for i, value in enumerate(column)][::-1]
            for column in derivatives.T
        ]

        def carriage(number: int) -> Any:
            return lambda t: kernel(*(mpmath.polyval(p, t) for p in polynomials), constants)[number]

        expected = np.array(
            [[float(mpmath.diff(carriage(i), 0, n)) for i in range(3)] for n in range(4)]
        )
    found = inverse_derivatives(geometry, derivatives, mode)
    scale = np.abs(expected).max(axis=1, keepdims=True) + 1.0
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-9)


@pytest.mark.parametrize("order", range(4))
def test_inverse_derivatives_to_a_lower_order_are_the_first_of_a_higher(
    geometry: dg.Geometry, order: int
) -> None:
    jets = np.random.default_rng(0).normal(0.0, 10.0, (5, 4, 3))
    jets[:, 0] += (-41.0, 0.0, 302.0)
    whole = inverse_derivatives(geometry, jets)
    np.testing.assert_array_equal(
        inverse_derivatives(geometry, jets[:, : order + 1]), whole[:, : order + 1]
    )


def test_inverse_derivatives_start_with_the_inverse_and_the_jacobian(geometry: dg.Geometry) -> None:
    pose, rate = np.array([-41.0, 10.0, 302.0]), np.array([3.0, -2.0, 5.0])
    found = inverse_derivatives(geometry, [pose, rate])
    np.testing.assert_allclose(found[0], dg.inverse(geometry, pose), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[1], dg.jacobian(geometry, pose) @ rate, rtol=1e-13)


def test_table_2_comes_out_to_the_printed_digits(geometry: dg.Geometry) -> None:
    for signs, position in TABLE_2.items():
        found = dg.forward(geometry, (-111.24, 244.70, 246.92), dg.AssemblyMode(*signs))
        np.testing.assert_allclose(found, position, rtol=0, atol=0.5001e-4)


def test_every_link_keeps_its_length_at_a_hundred_thousand_poses(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    checked = 0
    for geometry, mode in product(geometries, ALL_MODES):
        position = poses(geometry, mode, 320)
        carriages = dg.inverse(geometry, position, mode)
        checked += len(position)
        assert worst_residual(geometry, position, carriages) < 1e-9
    assert checked >= 100_000


def worst_residual(geometry: dg.Geometry, position: np.ndarray, carriages: np.ndarray) -> float:
    """Build the joints as Section 2.3 does and measure the links [mm].

    E2 and C3 hang on the platform, D2 stands over C1 and C2 on the riser; the arm's pivot lies in
    the plane of rail I. Of the two heights of D2 that the arm allows, one must fit the legs.
    """
    g = geometry
    b, d = g.rail_half_spacing, g.platform_half_width
    x, y, z = position.T
    across = b - (x + d)
    residuals = []
    for v in (1, -1):
        rise = v * np.sqrt(g.arm_length**2 - across**2)
        height = z - g.arm_drop - rise - g.riser_height - g.carriage_height
        legs = [
            np.hypot(y + side * g.coupler_length / 2 - carriages[:, i], height) - g.leg_length
            for i, side in ((0, -1), (1, 1))
        ]
        residuals.append(np.abs(legs).max(axis=0))
    strut = np.sqrt(
        (x - d + b) ** 2 + (y - carriages[:, 2]) ** 2 + (z - g.strut_drop - g.carriage_height) ** 2
    )
    loops = np.minimum(*residuals)
    return float(max(loops.max(), np.abs(strut - g.strut_length).max()))


def test_jacobian_and_reach_of_one_pose_are_those_of_many(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    for geometry, mode in product(geometries[:4], DEFINITE_MODES):
        position = poses(geometry, mode, 20)
        position = position[dg.clearance(geometry, position, mode) > 1e-3]
        alone = [dg.jacobian(geometry, tuple(pose), mode) for pose in position.tolist()]
        np.testing.assert_array_equal(
            np.reshape(alone, (-1, 3, 3)), dg.jacobian(geometry, position, mode)
        )
        around = position + np.array([0.0, 0.0, 150.0])
        reached = [dg.reachable(geometry, tuple(pose), mode) for pose in around.tolist()]
        np.testing.assert_array_equal(reached, dg.reachable(geometry, around, mode))


def test_y_depends_on_carriages_1_and_2_alone(geometry: dg.Geometry) -> None:
    carriages = np.tile(dg.inverse(geometry, (-41.0, 12.0, 302.0)), (50, 1))
    carriages[:, 2] += np.linspace(-20.0, 20.0, 50)
    found = dg.forward(geometry, carriages)
    assert np.ptp(found[:, 1]) == 0.0
    assert np.ptp(found[:, 0]) > 1.0
    np.testing.assert_allclose(found[:, 1], carriages[:, :2].mean(axis=1), rtol=0, atol=1e-12)


def test_all_three_carriages_together_move_y_alone_and_one_to_one(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    for geometry in geometries:
        mode = dg.WorkingMode()
        for pose in poses(geometry, mode, 5):
            if dg.clearance(geometry, pose, mode) < 0.1:
                continue
            carriages = dg.inverse(geometry, pose, mode)
            assembly = assembly_of(geometry, pose, mode)
            moved = dg.forward(geometry, carriages + 37.5, assembly)
            np.testing.assert_allclose(moved - pose, (0.0, 37.5, 0.0), rtol=0, atol=1e-8)
            np.testing.assert_allclose(dg.jacobian(geometry, pose, mode)[:, 1], 1.0, rtol=0, atol=0)


@pytest.mark.parametrize(
    ("position", "link", "shortfall"),
    [
        ((226.5, 0.0, 150.0), "arm", 1.5),
        ((-41.0, 0.0, 380.0), "strut", np.hypot(4.0, 310.0) - 300.0),
        ((45.0, 0.0, 80.0), "legs", 10.0),
        ((400.0, 0.0, 2000.0), "arm", 175.0),
    ],
)
def test_a_pose_beyond_reach_names_the_link_and_what_it_lacks(
    geometry: dg.Geometry, position: tuple[float, ...], link: str, shortfall: float
) -> None:
    for value in (position, np.array(position), [list(position)]):
        with pytest.raises(dg.UnreachableError, match=f"{link}.*too short") as caught:
            dg.inverse(geometry, value)
        assert caught.value.link == link
        assert caught.value.shortfall == pytest.approx(shortfall, abs=1e-9)
    assert caught.value.index == (0,)
    assert not dg.reachable(geometry, position)


def test_the_first_row_that_fails_is_named(geometry: dg.Geometry) -> None:
    position = np.tile([-41.0, 0.0, 302.0], (3, 4, 1))
    position[1, 2, 2] = position[2, 0, 2] = 900.0
    for function in (dg.inverse, dg.jacobian, dg.margins, dg.clearance):
        with pytest.raises(dg.UnreachableError, match=r"position\[1, 2\]") as caught:
            function(geometry, position)
        assert caught.value.index == (1, 2)
    np.testing.assert_array_equal(np.argwhere(~dg.reachable(geometry, position)), [[1, 2], [2, 0]])


def test_a_pose_on_the_edge_up_to_rounding_is_reached(geometries: list[dg.Geometry]) -> None:
    on_edge = 0
    for geometry, mode, x_share in product(geometries, ALL_MODES, (-1.0, -0.7, 0.2, 1.0)):
        cx = geometry.rail_half_spacing - geometry.platform_half_width
        u = geometry.arm_length * x_share
        base = geometry.carriage_height + geometry.riser_height + geometry.arm_drop
        height = base + mode.v * np.sqrt(max(geometry.arm_length**2 - u**2, 0.0))
        for z in (height - geometry.leg_length, height + geometry.leg_length):
            X, Z = u + 2.0 * cx, z - geometry.carriage_height - geometry.strut_drop
            if np.hypot(X, Z) < geometry.strut_length:
                pose = (cx + u, 3.0, z)
                assert dg.reachable(geometry, pose, mode)
                sides = dg.margins(geometry, pose, mode)
                assert 0.0 <= sides.legs_vertical < 1e-5
                assert sides.legs_parallel >= 0.0
                carriages = dg.inverse(geometry, pose, mode)
                half = 0.5 * geometry.coupler_length
                atol = 1e-4 if abs(x_share) < 1.0 else 0.1  # at a corner of reach: a root of a root
                np.testing.assert_allclose(carriages[:2], [3.0 - half, 3.0 + half], atol=atol)
                on_edge += 1
    assert on_edge > 500


def test_the_edge_has_no_derivative(geometry: dg.Geometry) -> None:
    for position, family in (
        ((225.0, 0.0, 150.0), "arm_flat"),
        ((45.0, 0.0, 90.0), "legs_vertical"),
        ((-45.0, 0.0, 370.0), "strut"),
    ):
        with pytest.raises(dg.SingularityError) as caught:
            dg.jacobian(geometry, position)
        assert caught.value.family == family
        with pytest.raises(dg.SingularityError):
            inverse_derivatives(geometry, [position, (1.0, 0.0, 0.0)])
        np.testing.assert_allclose(
            inverse_derivatives(geometry, [position])[0], dg.inverse(geometry, position)
        )


@pytest.mark.parametrize("third", [-300.0, 0.0, 60.0, 1e4])
def test_forward_refuses_parallel_legs(geometry: dg.Geometry, third: float) -> None:
    for carriages in ([124.6992, 244.6992, third], [[0.0, 120.0 + 5e-10, third]]):
        with pytest.raises(dg.SingularityError, match="parallel") as caught:
            dg.forward(geometry, carriages)
        assert caught.value.family == "legs_parallel"


def test_forward_refuses_flat_legs(geometry: dg.Geometry) -> None:
    for assembly in (dg.AssemblyMode(1, 1), dg.AssemblyMode(-1, 1)):
        with pytest.raises(dg.SingularityError, match="flat") as caught:
            dg.forward(geometry, (-220.0, 220.0, 240.0), assembly)
        assert caught.value.family == "legs_flat"


def test_forward_refuses_legs_that_rounding_alone_lifts(geometries: list[dg.Geometry]) -> None:
    refused = 0
    for geometry, v, share in product(geometries, (1, -1), np.linspace(-0.95, 0.95, 20)):
        u = geometry.arm_length * share
        x = geometry.rail_half_spacing - geometry.platform_half_width + u
        lift = geometry.carriage_height + geometry.riser_height + geometry.arm_drop
        z = lift + v * np.sqrt(geometry.arm_length**2 - u**2)
        pose, mode = (x, 71.3 * share, z), dg.WorkingMode(v=v)
        if not dg.reachable(geometry, pose, mode):
            continue
        side = int(np.sign(dg.margins(geometry, pose, mode).arm_strut))
        with pytest.raises(dg.SingularityError, match="flat") as caught:
            dg.forward(geometry, dg.inverse(geometry, pose, mode), dg.AssemblyMode(n=side))
        assert caught.value.family == "legs_flat"
        refused += 1
    assert refused > 300


def test_forward_refuses_every_point_of_case_2(geometries: list[dg.Geometry]) -> None:
    rng = np.random.default_rng(5)
    refused = 0
    for geometry, v in product(geometries, (1, -1)):
        curve = curve_of(geometry, v)
        for piece in curve.pieces:
            delta = rng.uniform(piece.delta[1], piece.delta[-2], 10)
            X, Z = curve.point(delta)[:2]
            x = X + geometry.platform_half_width - geometry.rail_half_spacing
            z = Z + geometry.carriage_height + geometry.strut_drop
            for pose in np.stack([x, rng.uniform(-200, 200, 10), z], axis=-1):
                mode = dg.WorkingMode(v=v)
                side = int(np.sign(dg.margins(geometry, pose, mode).legs_flat))
                with pytest.raises(dg.SingularityError, match="in line") as caught:
                    dg.forward(
                        geometry, dg.inverse(geometry, pose, mode), dg.AssemblyMode(m=side or 1)
                    )
                assert caught.value.family == "arm_strut"
                refused += 1
    assert refused > 200


@pytest.mark.parametrize(
    ("carriages", "link", "shortfall"),
    [
        ((-230.0, 220.0, 0.0), "legs", 5.0),
        ((-200.0, 200.0, 310.0), "strut", 10.0),
        ((-60.1, 60.1, 0.0), "arm", None),
        ((-1e200, 1e200, 0.0), "legs", None),
        ((1e10, 1e10 + 300.0, -1e10), "strut", None),
    ],
)
def test_forward_says_which_link_is_too_short(
    geometry: dg.Geometry, carriages: tuple[float, ...], link: str, shortfall: float | None
) -> None:
    if link == "arm":
        geometry = dg.Geometry(arm_length=40.0)
    with pytest.raises(dg.UnreachableError, match=f"{link}.*too short") as caught:
        dg.forward(geometry, carriages, dg.AssemblyMode(m=-1 if link == "strut" else 1))
    assert caught.value.link == link
    if shortfall is not None:
        assert caught.value.shortfall == pytest.approx(shortfall)


def test_beta_of_half_a_turn_is_a_pose_like_any_other(geometry: dg.Geometry) -> None:
    """Eq. 11 divides by G3 - G2 = 0 there; the pose lies where the branches v meet."""
    pose = np.array([225.0, 10.0, 60.0])
    for n in (1, -1):
        carriages = dg.inverse(geometry, pose)
        assembly = dg.AssemblyMode(m=-1, n=n)
        if assembly == assembly_of(geometry, pose, dg.WorkingMode()):
            np.testing.assert_allclose(
                dg.forward(geometry, carriages, assembly), pose, rtol=0, atol=1e-9
            )
            break
    else:
        pytest.fail("the pose is in neither assembly mode")


def test_forward_follows_the_arm_below_its_pivot(geometry: dg.Geometry) -> None:
    """Some 15 % of random carriages with a real (+1, +1) solution land at sin(beta) < 0."""
    rng = np.random.default_rng(8)
    below = found = 0
    for carriages in rng.uniform(-360.0, 360.0, (1500, 3)):
        try:
            pose = dg.forward(geometry, carriages)
        except (dg.UnreachableError, dg.SingularityError):
            continue
        found += 1
        spread = int(np.sign(carriages[0] - pose[1] + 60.0)), int(np.sign(carriages[2] - pose[1]))
        for v in (1, -1):
            mode = dg.WorkingMode(v, spread[0], -spread[0], spread[1])
            if dg.reachable(geometry, pose, mode) and np.allclose(
                dg.inverse(geometry, pose, mode), carriages, atol=1e-6
            ):
                below += v < 0
                break
        else:
            pytest.fail(f"no inverse solution returns {carriages}")
    assert found > 50
    assert 0.05 < below / found < 0.3


@pytest.mark.parametrize("shape", [(3,), (1, 3), (4, 3), (2, 5, 3), (0, 3), (2, 0, 3)])
def test_leading_axes_are_a_batch(geometry: dg.Geometry, shape: tuple[int, ...]) -> None:
    position = np.broadcast_to([-41.0, 7.0, 302.0], shape)
    carriages = dg.inverse(geometry, position)
    assert carriages.shape == shape
    assert dg.forward(geometry, carriages).shape == shape
    assert dg.jacobian(geometry, position).shape == (*shape, 3)
    assert dg.reachable(geometry, position).shape == shape[:-1]
    assert dg.margins(geometry, position).legs_parallel.shape == shape[:-1]
    assert dg.clearance(geometry, position).shape == shape[:-1]
    assert inverse_derivatives(geometry, position[..., None, :]).shape == (*shape[:-1], 1, 3)


@pytest.mark.parametrize(
    "value",
    [
        (0.0, 0.0),
        0.0,
        (0.0, float("nan"), 300.0),
        (float("inf"), 0.0, 300.0),
        (0.0, float("-inf"), 300.0),
        ("0", "0", "300"),
        (True, False, True),
        (0.0, 0.0, 300.0 + 0.0j),
        None,
        [[0.0, 0.0, 300.0], [0.0, float("nan"), 300.0]],
    ],
)
def test_what_is_no_position_is_refused(geometry: dg.Geometry, value: Any) -> None:
    for function in (
        dg.inverse,
        dg.forward,
        dg.jacobian,
        dg.reachable,
        dg.margins,
        dg.clearance,
        inverse_derivatives,
    ):
        with pytest.raises(dg.InputError):
            function(geometry, value)


def test_integers_lists_and_strided_arrays_are_positions_too(geometry: dg.Geometry) -> None:
    expected = dg.inverse(geometry, (-41.0, 0.0, 302.0))
    turned = np.asfortranarray(np.tile([-41.0, 0.0, 302.0], (4, 1)))
    for value in ([-41, 0, 302], np.array([-41, 0, 302]), np.float32([-41, 0, 302])):
        np.testing.assert_array_equal(dg.inverse(geometry, value), expected)
    np.testing.assert_array_equal(dg.inverse(geometry, turned)[2], expected)


def test_one_pose_some_and_very_many_agree_to_the_last_bit(
    geometries: list[dg.Geometry], poses: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    for geometry, mode in product(geometries[:4], DEFINITE_MODES):
        position = poses(geometry, mode, 40)
        sides = dg.margins(geometry, position, mode)
        chosen = (sides.legs_flat > 0.1) & (sides.arm_strut > 0.1) & (sides.legs_parallel > 0.1)
        position, results = position[chosen], []
        for threshold in (10**9, 0):
            monkeypatch.setattr(_batch, "WORTH_LOADING", threshold)
            monkeypatch.setattr(_batch, "WORTH_CALLING", threshold)
            carriages = dg.inverse(geometry, position, mode)
            sides = dg.margins(geometry, position, mode)
            results.append(
                (carriages, dg.forward(geometry, carriages), *sides.by_family().values())
            )
        one = [dg.inverse(geometry, pose, mode) for pose in position]
        alone = [dg.margins(geometry, pose, mode).by_family().values() for pose in position]
        results.append(
            (
                np.reshape(one, (-1, 3)),
                np.reshape([dg.forward(geometry, row) for row in one], (-1, 3)),
                *np.reshape([list(row) for row in alone], (-1, 6)).T,
            )
        )
        for other in results[1:]:
            for first, second in zip(results[0], other, strict=True):
                np.testing.assert_array_equal(first, second)


def test_the_compiled_loops_refuse_what_the_others_refuse(
    geometry: dg.Geometry, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_batch, "WORTH_LOADING", 0)
    monkeypatch.setattr(_batch, "WORTH_CALLING", 0)
    good = np.tile([-41.0, 0.0, 302.0], (5, 1))
    for column, value, error in (
        (1, np.nan, dg.InputError),
        (1, np.inf, dg.InputError),
        (0, np.nan, dg.InputError),
        (2, 900.0, dg.UnreachableError),
    ):
        position = good.copy()
        position[3, column] = value
        for function in (dg.inverse, dg.margins):
            with pytest.raises(error, match=r"\[3"):
                function(geometry, position)
    carriages = dg.inverse(geometry, good)
    for row, error in (
        ((0.0, 120.0, 0.0), dg.SingularityError),
        ((0.0, np.nan, 0.0), dg.InputError),
        ((0.0, 900.0, 0.0), dg.UnreachableError),
    ):
        carriages[3] = row
        with pytest.raises(error, match=r"carriages\[3"):
            dg.forward(geometry, carriages)


def test_results_belong_to_the_caller(geometry: dg.Geometry) -> None:
    position = np.array([[-41.0, 0.0, 302.0]])
    position.flags.writeable = False
    carriages = dg.inverse(geometry, position)
    carriages += 1.0
    assert dg.inverse(geometry, position)[0, 0] == carriages[0, 0] - 1.0
