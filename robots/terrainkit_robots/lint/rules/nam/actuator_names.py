"""Rule on the names of actuators."""

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.name_words import MAX_NAME_LENGTH, split_name
from terrainkit_robots.analysis.symmetry.mirror import swap_sides
from terrainkit_robots.lint.rule import Part, Violation, Violations, rule

_SHORT_SIDES = {"left": "l", "right": "r"}

_FILLERS = frozenset(
    {"joint", "motor", "actuator", "act", "servo", "position", "pos", "torque", "ctrl", "drive"}
)
"""Words in the names of joints and actuators that do not identify the joint."""


@rule("NAM005", "actuator-of-another-joint", "warning", certainty="likely")
def actuator_of_another_joint(robot: Facts) -> Violations:
    """An actuator has the name of a joint that it does not drive.

    Its joint was not changed after copying, or two joints were exchanged. Commands are assigned by
    the name or the order of the actuators, so that two legs get each other's torques.

    Fix:
        Exchange the joints of the actuators, or rename the actuators.

    Source:
        MuJoCo does not compare names. Words such as joint and motor, and the words left and l, are
        not distinguished.
    """
    joints: dict[tuple[str, ...], str] = {}
    for joint in robot.joints:
        joints.setdefault(_identity(joint.name), joint.name)
    names_of = {name: key for key, name in joints.items()}
    for actuator in robot.model.actuators:
        own, driven = _identity(actuator.name), names_of.get(actuator.joint)
        if driven is None or own == driven or len(actuator.name) > MAX_NAME_LENGTH:
            continue
        named = joints.get(own)
        if named is None and _identity(swap_sides(actuator.name)) == driven:
            named = swap_sides(actuator.joint)
        if named is not None:
            yield Violation(
                element=Part(actuator.joint, actuator.source),
                message=f"joint of actuator {truncate(actuator.name)}: got {actuator.joint}; "
                f"expected {named}, as its name says",
                measured={"expected": named},
            )


def _identity(name: str) -> tuple[str, ...]:
    """Return the words of a name that identify a joint."""
    words = (word.lower() for word in split_name(name) if word[0].isalnum())
    return tuple(_SHORT_SIDES.get(word, word) for word in words if word not in _FILLERS)
