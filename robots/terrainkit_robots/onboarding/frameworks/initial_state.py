"""The initial state: where a robot starts, as Isaac Lab and mjlab both want it."""

from collections.abc import Mapping

from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.source import number, spread, table


def initial_state(robot: ConfigRobot, patterns: Mapping[str, str], *, depth: int) -> list[str]:
    """Return the fields of an InitialStateCfg.

    Args:
        robot: The robot.
        patterns: What matches each joint.
        depth: How far they will be indented, in steps of four.
    """
    pose = robot.of_every_joint("default_pose")
    entries = table({patterns[joint]: angle for joint, angle in pose.items()})
    return [
        *robot.origin("spawn_height", depth=depth, what="x, y, z"),
        f"pos=(0.0, 0.0, {number(robot.spec.spawn_height or 0.0)}),",
        *robot.origin("default_pose", depth=depth),
        *spread("joint_pos=", entries, "{}", depth=depth, tail=","),
        'joint_vel={".*": 0.0},',
    ]
