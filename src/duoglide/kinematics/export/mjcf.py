"""A MuJoCo model with every loop closed: a witness that knows nothing of the closed forms."""

from __future__ import annotations

from xml.etree import ElementTree as Xml

import numpy as np
from numpy.typing import ArrayLike

from duoglide.kinematics.export.tree import Body, Motion, Point, Tree, build_tree
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.machine import Geometry, Machine

METRE = 1e-3  # MuJoCo's unit, per millimetre
RADIUS = 5e-3  # [m], of the bars
STIFF = "0.001 1"  # time constant and damping ratio of the closures


def to_mjcf(
    machine: Machine | Geometry,
    position: ArrayLike | None = None,
    mode: WorkingMode = WORKING,
) -> str:
    """Export the mechanism as a MuJoCo model (MJCF), in metres and kilograms.

    Seventeen joints in closed loops: thirteen in a tree and four closed by five common points. The
    joints ``carriage_1`` to ``carriage_3`` read the carriage positions, each has a position
    actuator of the same name, and the site ``platform`` is O'.

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
    Xml.SubElement(root, "option", timestep="0.0005", integrator="implicitfast", jacobian="dense")
    defaults = Xml.SubElement(root, "default")
    Xml.SubElement(defaults, "geom", contype="0", conaffinity="0", density="2700")
    Xml.SubElement(defaults, "equality", solref=STIFF, solimp="0.99 0.999 0.001")
    world = Xml.SubElement(root, "worldbody")
    Xml.SubElement(world, "light", pos="0 0 1.5", dir="0 0 -1")
    _add_bodies(world, tree)
    _add_closures(root, tree)
    actuators = Xml.SubElement(root, "actuator")
    for body in tree.bodies:
        if body.motion is Motion.SLIDE:
            limits = _text((-tree.travel, tree.travel))
            Xml.SubElement(
                actuators, "position", name=body.name, joint=body.name, kp="1e5", kv="1e3",
                ctrlrange=limits,
            )  # fmt: skip
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode")


def _add_bodies(world: Xml.Element, tree: Tree) -> None:
    """Nest the bodies, each with its joint and its bars."""
    elements: dict[str, Xml.Element] = {"base": world}
    origins: dict[str, Point] = {"base": (0.0, 0.0, 0.0)}
    for body in tree.bodies:
        offset = np.subtract(body.origin, origins[body.parent])
        element = Xml.SubElement(
            elements[body.parent], "body", name=body.name, pos=_text(offset.tolist())
        )
        _add_joint(element, body, tree.travel)
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


def _add_joint(element: Xml.Element, body: Body, travel: float) -> None:
    """Give a body its joint; a slide reads the carriage's position."""
    axis = " ".join(repr(value) for value in body.axis)
    joint = Xml.SubElement(
        element, "joint", name=body.name, type=body.motion.value, axis=axis, armature="1e-6"
    )
    if body.motion is Motion.SLIDE:
        joint.set("ref", _text((body.value,)))
        joint.set("range", _text((-travel, travel)))
        if not -travel <= body.value <= travel:  # a geometry alone may stand beyond its rails
            del joint.attrib["range"]


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
