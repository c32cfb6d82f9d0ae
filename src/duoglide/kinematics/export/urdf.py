"""A URDF of the tree: URDF knows no loops, so the closures are written as a comment."""

from __future__ import annotations

from xml.etree import ElementTree as Xml

import numpy as np
from numpy.typing import ArrayLike

from duoglide.kinematics.export.tree import Body, Motion, Point, build_tree
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.machine import Geometry, Machine

METRE = 1e-3  # URDF's unit, per millimetre
EFFORT, SPEED = "1000", "10"  # URDF asks for limits; the machine's own are not here


def to_urdf(
    machine: Machine | Geometry,
    position: ArrayLike | None = None,
    mode: WorkingMode = WORKING,
) -> str:
    """Export the tree of the mechanism as URDF, in metres.

    URDF describes trees only: the loops are cut, and the points that close them stand in comments.
    A viewer shows the parts at the reference pose; for motion use ``to_mjcf``. Joints read zero at
    the reference pose.

    Args:
        machine: A machine, whose home is the reference pose, or a geometry alone.
        position: Another reference pose [mm], shape (3,).
        mode: Which of the inverse solutions stands there.

    Returns:
        XML text.

    Raises:
        ConfigError: No pose closes the links, or the machine's own home is not allowed.
        InputError: The position is not three finite numbers.
        UnreachableError: The position is beyond reach.
    """
    tree = build_tree(machine, position, mode)
    root = Xml.Element("robot", name="duoglide")
    root.append(Xml.Comment(" URDF has no loops: these points of two links coincide in the robot "))
    for closure in tree.closures:
        point = _text(closure.point)
        root.append(Xml.Comment(f" {closure.first} = {closure.second} at {point} "))
    Xml.SubElement(root, "link", name="base")
    origins: dict[str, Point] = {"base": (0.0, 0.0, 0.0)}
    for body in tree.bodies:
        _add_link(root, body)
        _add_joint(root, body, origins[body.parent], tree.travel)
        origins[body.name] = body.origin
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode")


def _add_link(root: Xml.Element, body: Body) -> None:
    """Add a link with a cylinder for each bar."""
    link = Xml.SubElement(root, "link", name=body.name)
    for bar in body.bars:
        start, end = np.subtract(bar.start, body.origin), np.subtract(bar.end, body.origin)
        run = end - start
        length = float(np.linalg.norm(run))
        if length == 0.0:
            continue
        visual = Xml.SubElement(link, "visual")
        # A cylinder lies along z; roll about x, then pitch about y, brings z onto the bar.
        roll = float(np.arcsin(-run[1] / length))
        pitch = float(np.arctan2(run[0], run[2]))
        middle = ((start + end) / 2.0).tolist()
        Xml.SubElement(visual, "origin", xyz=_text(middle), rpy=f"{roll!r} {pitch!r} 0")
        geometry = Xml.SubElement(visual, "geometry")
        Xml.SubElement(geometry, "cylinder", radius="0.005", length=repr(length * METRE))


def _add_joint(root: Xml.Element, body: Body, parent_origin: Point, travel: float) -> None:
    """Add the joint between a body and its parent."""
    slides = body.motion is Motion.SLIDE
    kind = "prismatic" if slides else "continuous"
    joint = Xml.SubElement(root, "joint", name=f"{body.name}_joint", type=kind)
    Xml.SubElement(joint, "parent", link=body.parent)
    Xml.SubElement(joint, "child", link=body.name)
    offset = np.subtract(body.origin, parent_origin).tolist()
    Xml.SubElement(joint, "origin", xyz=_text(offset), rpy="0 0 0")
    Xml.SubElement(joint, "axis", xyz=" ".join(repr(value) for value in body.axis))
    if slides:
        lower, upper = ((edge - body.value) * METRE for edge in (-travel, travel))
        Xml.SubElement(
            joint, "limit", lower=repr(lower), upper=repr(upper), effort=EFFORT, velocity=SPEED
        )


def _text(lengths: list[float] | Point) -> str:
    """Write lengths [mm] in metres."""
    return " ".join(repr(float(value) * METRE) for value in lengths)
