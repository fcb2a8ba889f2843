"""The other description of a robot, and the joints that both have."""

from pathlib import Path

from terrainkit.settings.text import truncate
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.facts import Facts, cached_fact
from terrainkit_robots.description.model import Joint
from terrainkit_robots.lint.compare.robot_pairs import RobotPairs, pair_robots

JointPair = tuple[Joint, Joint]


@cached_fact
def robot_pairs(robot: Facts) -> RobotPairs:
    """Return the matching elements of both descriptions.

    Raises:
        CannotCheckError: If one of them has no links.
    """
    return pair_robots(robot, other_robot(robot))


def joint_pairs(robot: Facts) -> tuple[JointPair, ...]:
    """Return the pairs of joints.

    Raises:
        CannotCheckError: If there is none.
    """
    pairs = robot_pairs(robot)
    if not robot.joints or not other_robot(robot).joints:
        raise CannotCheckError("one of the two has no joints with one degree of freedom")
    if not pairs.joints:
        raise CannotCheckError(f"no joint of {other_name(robot)} has the name of a joint here")
    return pairs.joints


def other_robot(robot: Facts) -> Facts:
    """Return the other description, which rules with `needs=("against",)` have."""
    assert robot.against is not None
    return robot.against


def other_name(robot: Facts) -> str:
    """Return the name of the other file, with its folder if both files have the same name."""
    other = other_robot(robot).model.file
    same = other.name == robot.model.file.name
    return truncate(str(Path(*other.parts[-2:])) if same else other.name)


def joint_name(one: Joint, other: Joint) -> str:
    """Return the name of a joint, with the name in the other file if they differ."""
    return one.name if one.name == other.name else f"{one.name} ({other.name} there)"
