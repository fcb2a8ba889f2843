"""Rules on joint types."""

from terrainkit.settings.text import closest, truncate
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.model import JOINT_TYPES
from terrainkit_robots.lint.rule import Violation, Violations, rule

_MIN_SIMILARITY = 0.6
"""Share of common letters above which an unknown type is taken for a misspelled one."""

_TYPE_SYNONYMS = {
    "hinge": "revolute",
    "rotary": "revolute",
    "rotational": "revolute",
    "slide": "prismatic",
    "slider": "prismatic",
    "linear": "prismatic",
    "weld": "fixed",
    "rigid": "fixed",
    "static": "fixed",
    "free": "floating",
    "wheel": "continuous",
}


@rule("JNT001", "unknown-joint-type", "error", onboarding="blocks")
def unknown_joint_type(robot: Facts) -> Violations:
    """The type of a joint does not exist.

    MuJoCo and urdfdom reject the file. Other simulators silently treat the joint as fixed.

    Fix:
        Use one of the joint types of the format. Types are lowercase.

    Source:
        MuJoCo 4.0: "invalid joint type in URDF joint definition"; the types are listed in
        http://wiki.ros.org/urdf/XML/joint.
    """
    known = JOINT_TYPES if robot.model.kind == "mjcf" else JOINT_TYPES - {"ball"}
    for joint in robot.model.joints:
        if joint.kind and joint.kind not in known:
            word = joint.kind.strip().lower()
            near = _TYPE_SYNONYMS.get(word) or closest(word, known, _MIN_SIMILARITY)
            yield Violation(
                element=joint,
                message=f"type of joint {joint.name}: got {truncate(joint.kind, 40)!r}"
                f"{f' (did you mean {near}?)' if near else ''}; expected one of "
                f"{', '.join(sorted(known))}",
            )


@rule("JNT002", "prismatic-leg-joint", "warning", needs=("legs",), certainty="likely")
def prismatic_leg_joint(robot: Facts) -> Violations:
    """A joint of a leg is prismatic.

    Few legs have prismatic joints, and training frameworks expect hinges: gains, action scales and
    limits are in radians. The usual cause is a wrong joint type.

    Fix:
        Make the joint revolute. If the leg is telescopic, ignore this rule and check the units.

    Source:
        Of the published legged robots that were tested, none has a prismatic leg joint, except for
        the joints that carry the trunk of planar models.
    """
    for joint in robot.leg_joints:
        if joint.kind == "prismatic":
            yield Violation(
                element=joint,
                message=f"type of leg joint {joint.name}: got prismatic; expected revolute",
            )
