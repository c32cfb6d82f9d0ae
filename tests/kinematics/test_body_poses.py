"""Joint values and body poses against MuJoCo, which is given the joints and never a closed form."""

from __future__ import annotations

from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import duoglide as dg
from duoglide.errors import InputError
from duoglide.kinematics.export import body_poses, build_tree, joint_values, to_mjcf, to_urdf
from duoglide.kinematics.export.poses import _angle

mujoco = pytest.importorskip("mujoco")

GEOMETRIES = {
    "Table 1": dg.Geometry(),
    "riser and drops": dg.Geometry(
        riser_height=12.0, arm_drop=8.0, strut_drop=-6.0, arm_length=190
    ),
}


@pytest.fixture(params=GEOMETRIES)
def geometry(request: pytest.FixtureRequest) -> dg.Geometry:
    return GEOMETRIES[request.param]


def poses(geometry: dg.Geometry) -> np.ndarray:
    """Return random poses within reach, for which the reference pose is not special."""
    position = np.random.default_rng(3).uniform((-150, -80, 150), (50, 80, 320), (400, 3))
    return position[dg.reachable(geometry, position)]


def with_masses(urdf: str) -> str:
    """Give every link the mass that MuJoCo wants of a body, and that nothing here depends on."""
    root = Xml.fromstring(urdf)
    for link in root.iter("link"):
        inertial = Xml.SubElement(link, "inertial")
        Xml.SubElement(inertial, "mass", value="1")
        Xml.SubElement(inertial, "inertia", ixx="1", iyy="1", izz="1", ixy="0", ixz="0", iyz="0")
    return Xml.tostring(root, encoding="unicode")


@pytest.mark.parametrize("form", ["mjcf", "urdf"])
def test_mujoco_finds_every_body_where_we_do(geometry: dg.Geometry, form: str) -> None:
    tree = build_tree(geometry)
    xml = to_mjcf(geometry) if form == "mjcf" else with_masses(to_urdf(geometry))
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    position = poses(geometry)
    assert len(position) > 50
    values = joint_values(tree, geometry, position)
    found = body_poses(tree, values)
    for row in range(len(position)):
        for body in tree.bodies:
            scale = 1e-3 if body.name.startswith("carriage") else 1.0
            data.qpos[model.joint(body.name).qposadr[0]] = scale * values[body.name][row]
        mujoco.mj_kinematics(model, data)
        for name, (origin, turn) in found.items():
            assert 1e3 * data.body(name).xpos == pytest.approx(origin[row], abs=1e-9), name
            ours = Rotation.from_quat(turn[row]).as_matrix()
            assert data.body(name).xmat.reshape(3, 3) == pytest.approx(ours, abs=1e-12), name


def test_the_loops_close_and_the_platform_is_where_it_was_asked_to_be(
    geometry: dg.Geometry,
) -> None:
    tree = build_tree(geometry)
    position = poses(geometry)
    found = body_poses(tree, joint_values(tree, geometry, position))
    reference = {body.name: np.array(body.origin) for body in tree.bodies}

    def carried(name: str, point: tuple[float, float, float] | np.ndarray) -> np.ndarray:
        origin, turn = found[name]
        return origin + Rotation.from_quat(turn).apply(np.subtract(point, reference[name]))

    for closure in tree.closures:
        gap = carried(closure.first, closure.point) - carried(closure.second, closure.point)
        assert np.abs(gap).max() < 1e-9, closure
    centre = carried("platform", reference["platform"] + tree.platform_offset)
    assert np.abs(centre - position).max() < 1e-9
    level = Rotation.from_quat(found["platform"][1]).magnitude()
    assert level.max() < 1e-12


def test_the_bars_of_the_urdf_are_those_of_the_tree(geometry: dg.Geometry) -> None:
    tree = build_tree(geometry)
    root = Xml.fromstring(to_urdf(geometry))
    for body in tree.bodies:
        drawn = root.findall(f"link[@name='{body.name}']/visual")
        bars = [bar for bar in body.bars if bar.start != bar.end]
        assert len(drawn) == len(bars)
        for visual, bar in zip(drawn, bars, strict=True):
            place = visual.find("origin").attrib
            turn = Rotation.from_euler("xyz", np.array(place["rpy"].split(), float))
            length = float(visual.find("geometry/cylinder").attrib["length"])
            half = turn.apply((0.0, 0.0, length / 2.0))
            centre = np.array(place["xyz"].split(), float)
            ends = 1e3 * np.array([centre - half, centre + half]) + body.origin
            assert ends == pytest.approx(np.array([bar.start, bar.end]), abs=1e-9)


def test_positions_that_are_no_rows_are_refused() -> None:
    tree = build_tree(dg.Geometry())
    with pytest.raises(InputError, match=r"must have shape \(n, 3\)"):
        joint_values(tree, dg.Geometry(), (-41.0, 0.0, 300.0))


def test_an_angle_is_signed_about_its_axis() -> None:
    z = np.array([0.0, 0.0, 1.0])
    ends = np.array([[0.0, 2.0, 5.0], [0.0, -1.0, 0.0], [-3.0, 0.0, 1.0]])
    angles = _angle(z, np.array([1.0, 0.0, 9.0]), ends)
    assert angles == pytest.approx([np.pi / 2.0, -np.pi / 2.0, np.pi])
