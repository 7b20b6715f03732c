"""Identified bodies into the robot's own URDF: its links, joints, meshes and names stay as they are.

A body of the model is all links that are fixed together; its inertia goes to the link that its joint moves,
and the links fixed to that one lose theirs, since a sum cannot be parted again.
"""

from __future__ import annotations

from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from ident.export.bodies import body, pseudo
from ident.export.consistent import Consistent
from ident.export.urdf import as_text, friction_of, inertial
from modelgen.geometry.urdf import convert


def fill_urdf(data: bytes, source: str, found: Consistent, note: str, exact: bool = False) -> str:
    """The URDF `data` with identified <inertial> and <dynamics>; it is checked by `convert` before, which
    reads it `exact` as the fit did."""
    conversion = convert(data, source, exact)
    top = _as_written(data)
    links = {element.get("name"): element for element in top.iter("link")}
    joints = {element.get("name"): element for element in top.findall("joint")}
    for label, its in zip(conversion.robot.joint_labels, conversion.bodies):
        for name, _ in its.links:
            for old in links[name].findall("inertial"):
                links[name].remove(old)
        T = np.eye(4)
        T[:3, :3] = [[float(v) for v in line] for line in its.frame.R]
        T[:3, 3] = [float(v) for v in its.frame.p]
        P = T @ pseudo(found.bodies()[its.row - 1]) @ T.T  # in the axes of the link that its joint moves
        links[its.link].insert(0, inertial(body(P)))
        damping, friction = friction_of(found, label)
        joint = joints[its.joint]
        for old in joint.findall("dynamics"):
            joint.remove(old)
        ElementTree.SubElement(joint, "dynamics", damping=repr(damping), friction=repr(friction))
    return as_text(top, note)


def _as_written(data: bytes) -> ElementTree.Element:
    """The tree with its comments; names as they stand, since simulators' prefixes are often not declared."""
    tree = ElementTree.TreeBuilder(insert_comments=True)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = tree.start, tree.end
    parser.CharacterDataHandler, parser.CommentHandler = tree.data, tree.comment
    parser.Parse(data, True)
    return tree.close()
