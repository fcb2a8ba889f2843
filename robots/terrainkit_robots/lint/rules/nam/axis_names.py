"""Rule on joints that are named after an axis."""

import math

import numpy as np

from terrainkit_robots.analysis.bodies.kinematics import joint_axis
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.name_words import split_name
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule

_MIN_COSINE = 0.5
"""Cosine from which a leg bends about the lateral axis."""

_MAX_COSINE = 0.3
"""Cosine below which a joint does not turn about the axis in its name: more than 72 degrees."""


@rule("NAM004", "wrong-axis-name", "warning", needs=("legs",), certainty="likely")
def wrong_axis_name(robot: Facts) -> Violations:
    """A joint of a leg does not turn about the axis in its name.

    The name says pitch, roll or yaw, but the joint turns about another axis. Default positions,
    gains and symmetries are assigned by name, so the wrong joint gets them.

    Fix:
        Compare the <axis> and the rotation of the <origin> with the joints of the other legs, or
        rename the joint.

    Source:
        The axis at joint positions 0, compared with the axis about which the leg bends (pitch), the
        vertical axis (yaw) and the axis perpendicular to both (roll).
    """
    up = np.array([0.0, 0.0, 1.0])
    lateral = robot.mirror.normal
    bend_laterally = [abs(float(leg.pitch @ lateral)) > _MIN_COSINE for leg in robot.legs]
    reported: set[str] = set()
    for leg, bends_laterally in zip(robot.legs, bend_laterally, strict=True):
        # A wrong axis may outvote the other axes of its leg, but not the axes of the other legs.
        pitch = leg.pitch if bends_laterally or not any(bend_laterally) else lateral
        roll = np.cross(pitch, up)
        expected = {"pitch": pitch, "yaw": up, "roll": roll / np.linalg.norm(roll)}
        for joint in leg.joints:
            stated = {word.lower() for word in split_name(joint.name)} & expected.keys()
            if len(stated) != 1 or joint.kind == "prismatic" or joint.name in reported:
                continue
            (word,) = stated
            body = robot.body_of_joint[joint.name]
            _, axis = joint_axis(body, body.zero_pose)
            cosines = {name: abs(float(axis @ other)) for name, other in expected.items()}
            if cosines[word] < _MAX_COSINE:
                reported.add(joint.name)
                best = max(cosines, key=cosines.__getitem__)
                yield Violation(
                    element=Part(joint.name, joint.axis_source or joint.source),
                    message=f"axis of joint {joint.name}: got {best} "
                    f"({math.degrees(math.acos(cosines[word])):.0f} deg from {word}); "
                    f"expected {word}, as its name says",
                    measured={"cosine": cosines[word]},
                )
