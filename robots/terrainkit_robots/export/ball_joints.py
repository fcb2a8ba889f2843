"""Replace ball joints by three hinges, since URDF has none and a policy has no quaternions."""

from dataclasses import replace

import numpy as np

from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import WORLD, Joint, Link


def with_hinges_for_balls(facts: Facts) -> Facts:
    """Return a robot with three hinges through one point in place of each ball joint.

    They turn about x, y and z of the link, in this order. The motion is the same, except where the
    second angle is 90 degrees. Ball joints of the base are kept.
    """
    model = facts.model
    links: list[Link] = []
    joints: list[Joint] = []
    base = {joint.child for joint in facts.base_joints}
    for joint in model.joints:
        if joint.kind != "ball" or joint.parent == WORLD or joint.child in base:
            joints.append(joint)
            continue
        parent = joint.parent
        for letter, axis in zip("xyz", np.eye(3), strict=True):
            child = joint.child if letter == "z" else f"{joint.child}:{letter}"
            hinge = replace(
                joint,
                name=f"{joint.name}_{letter}",
                kind="continuous",
                parent=parent,
                child=child,
                origin=joint.origin if letter == "x" else np.eye(4),
                axis=axis,
            )
            joints.append(hinge)
            if child != joint.child:
                links.append(Link(name=child, source=joint.source, virtual=True))
            parent = child
    if not links:
        return facts
    return facts.with_model(replace(model, links=(*model.links, *links), joints=tuple(joints)))
