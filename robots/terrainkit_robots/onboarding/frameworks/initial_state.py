"""Write the initial state of a robot for Isaac Lab and mjlab."""

from collections.abc import Mapping

from terrainkit_robots.onboarding.frameworks import source
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.patterns import merge_patterns


def initial_state(robot: ConfigRobot, patterns: Mapping[str, str], *, depth: int) -> list[str]:
    """Return the source of the fields of an InitialStateCfg.

    Args:
        robot: The robot.
        patterns: A pattern that matches each joint.
        depth: Indentation of the fields, in steps of four spaces.
    """
    pose = robot.joint_values("default_pose")
    entries = source.dict_entries(merge_patterns(pose, patterns))
    return [
        *robot.provenance_comment("spawn_height", depth=depth, prefix="x, y, z"),
        f"pos=(0.0, 0.0, {source.float_literal(robot.spec.spawn_height or 0.0)}),",
        *robot.provenance_comment("default_pose", depth=depth),
        *source.format_collection("joint_pos=", entries, "{}", depth=depth, suffix=","),
        'joint_vel={".*": 0.0},',
    ]
