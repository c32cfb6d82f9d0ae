"""A MuJoCo model with every loop closed: a witness that knows nothing of the closed forms."""

from __future__ import annotations

from xml.etree import ElementTree as Xml

import numpy as np
from numpy.typing import ArrayLike

from duoglide.kinematics.export.tree import Body, Motion, Point, Tree, build_tree
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.machine import Geometry, Machine

METRE = 1e-3  # MuJoCo's unit, per millimetre
RADIUS = 5e-3  # [m], of the bars as they are drawn
STIFF = "0.0005 1"  # time constant and damping ratio of closures and friction
TIMESTEP = "0.00025"  # [s]
STIFFNESS = "2e7"  # [N/m], of the actuators; where the mechanism yields most, softer ones give way
DAMPING = "4e3"  # [N s/m]; over the stiffness it is the time by which a carriage trails
LIGHTEST = 1e-9  # [kg]: a body without any mass cannot be simulated
SPIN = 1e-7  # [m^2], of a slender bar: its moment of inertia about its own axis, per mass
BLUNT = 4e-4  # [m^2], of a body that never turns: its moments of inertia, per mass


def to_mjcf(
    machine: Machine | Geometry,
    position: ArrayLike | None = None,
    mode: WorkingMode = WORKING,
) -> str:
    """Export the mechanism as a MuJoCo model (MJCF), in metres and kilograms.

    Seventeen joints in closed loops: thirteen in a tree and four closed by five common points, all
    on the body ``base``. The joints ``carriage_1`` to ``carriage_3`` read the carriage positions,
    each has a position actuator of the same name, and the site ``platform`` is O'. Masses, friction
    and gravity are those of ``machine.masses``: bars are slender, and motors are armature.

    Args:
        machine: A machine, whose home is the reference pose, or a geometry alone.
        position: Another reference pose [mm], shape (3,).
        mode: Which of the inverse solutions stands there.

    Returns:
        XML text for ``mujoco.MjModel.from_xml_string``.

    Raises:
        ConfigError: No pose closes the links, or the machine's own home is not allowed.
        InputError: The position is not three finite numbers.
        UnreachableError: The position is beyond reach.
    """
    tree = build_tree(machine, position, mode)
    root = Xml.Element("mujoco", model="duoglide")
    Xml.SubElement(root, "compiler", angle="radian", autolimits="true")
    Xml.SubElement(
        root,
        "option",
        timestep=TIMESTEP,
        integrator="implicitfast",
        jacobian="dense",
        gravity=_text(tree.masses.gravity),
    )
    defaults = Xml.SubElement(root, "default")
    Xml.SubElement(defaults, "geom", contype="0", conaffinity="0", mass="0")
    Xml.SubElement(defaults, "equality", solref=STIFF, solimp="0.99 0.999 0.001")
    world = Xml.SubElement(root, "worldbody")
    Xml.SubElement(world, "light", pos="0 0 1.5", dir="0 0 -1")
    _add_bodies(Xml.SubElement(world, "body", name="base"), tree)
    _add_closures(root, tree)
    actuators = Xml.SubElement(root, "actuator")
    for body in tree.bodies:
        if body.motion is Motion.SLIDE:
            limits = _text((-tree.travel, tree.travel))
            Xml.SubElement(
                actuators,
                "position",
                name=body.name,
                joint=body.name,
                kp=STIFFNESS,
                kv=DAMPING,
                ctrlrange=limits,
            )
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode")


def _add_bodies(base: Xml.Element, tree: Tree) -> None:
    """Nest the bodies, each with its joint, its mass and its bars."""
    elements: dict[str, Xml.Element] = {"base": base}
    origins: dict[str, Point] = {"base": (0.0, 0.0, 0.0)}
    for body in tree.bodies:
        offset = np.subtract(body.origin, origins[body.parent])
        element = Xml.SubElement(
            elements[body.parent], "body", name=body.name, pos=_text(offset.tolist())
        )
        _add_joint(element, body, tree)
        _add_mass(element, body)
        for bar in body.bars:
            start = np.subtract(bar.start, body.origin)
            end = np.subtract(bar.end, body.origin)
            if np.linalg.norm(end - start) > 0.0:
                ends = _text([*start.tolist(), *end.tolist()])
                Xml.SubElement(element, "geom", type="capsule", size=str(RADIUS), fromto=ends)
        if body.name == "platform":
            Xml.SubElement(
                element, "site", name="platform", pos=_text(tree.platform_offset), size="0.006"
            )
        elements[body.name], origins[body.name] = element, body.origin


def _add_joint(element: Xml.Element, body: Body, tree: Tree) -> None:
    """Give a body its joint; a slide reads the carriage's position, and has motor and friction."""
    axis = " ".join(repr(value) for value in body.axis)
    joint = Xml.SubElement(element, "joint", name=body.name, type=body.motion.value, axis=axis)
    if body.motion is Motion.SLIDE:
        masses, travel = tree.masses, tree.travel
        number = int(body.name.rpartition("_")[2]) - 1
        joint.set("ref", _text((body.value,)))
        joint.set("range", _text((-travel, travel)))
        joint.set("armature", repr(masses.drive[number]))
        joint.set("frictionloss", repr(masses.coulomb_friction[number]))
        joint.set("solreffriction", STIFF)
        joint.set("damping", repr(masses.viscous_friction[number] / METRE))
        if not -travel <= body.value <= travel:  # a geometry alone may stand beyond its rails
            del joint.attrib["range"]


def _add_mass(element: Xml.Element, body: Body) -> None:
    """Give a body its mass: along its bar, or, if it never turns, wherever it is."""
    mass = max(body.mass, LIGHTEST)
    inertia = mass * BLUNT * np.eye(3)
    if body.slender:
        bar = METRE * np.subtract(body.bars[0].end, body.bars[0].start)
        square = float(bar @ bar)
        along = np.outer(bar, bar) / square
        inertia = mass * (square / 12.0 * (np.eye(3) - along) + SPIN * along)
    elif body.name.endswith("_bar"):  # it turns about its own axis, y, alone
        inertia[1, 1] = mass * SPIN
    rows, columns = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
    Xml.SubElement(
        element,
        "inertial",
        pos=_text(np.subtract(body.centre, body.origin).tolist()),
        mass=repr(mass),
        fullinertia=" ".join(repr(value) for value in inertia[rows, columns].tolist()),
    )


def _add_closures(root: Xml.Element, tree: Tree) -> None:
    """Connect bodies at common points, given in the first body's frame."""
    origins = {body.name: body.origin for body in tree.bodies}
    equality = Xml.SubElement(root, "equality")
    for closure in tree.closures:
        anchor = np.subtract(closure.point, origins[closure.first])
        Xml.SubElement(
            equality,
            "connect",
            body1=closure.first,
            body2=closure.second,
            anchor=_text(anchor.tolist()),
        )


def _text(lengths: list[float] | Point | tuple[float, ...]) -> str:
    """Write lengths [mm] in metres, without losing digits."""
    return " ".join(repr(float(value) * METRE) for value in lengths)
