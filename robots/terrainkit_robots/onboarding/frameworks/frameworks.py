"""The training frameworks for which a configuration can be written.

Each framework is a module of this package with a flag `LEGGED_ONLY` and a function `config_text`,
or `config_files` if there are several files. `train_commands` returns how to train the robot.
Without a flag `READS_MJCF`, a framework reads robot.urdf, which has no closed loops.
"""

import importlib
import pkgutil
from functools import cache
from pathlib import Path
from statistics import fmean
from types import ModuleType

from terrainkit.errors import ConfigError
from terrainkit.settings.text import expected_names
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.export.sites import pose_in_body
from terrainkit_robots.onboarding import frameworks
from terrainkit_robots.onboarding.derive_spec.named_bodies import body_name
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.legged_robot import check_legs
from terrainkit_robots.spec.robot_spec import RobotSpec


@cache
def framework_names() -> tuple[str, ...]:
    """Return the names of the frameworks in alphabetical order."""
    modules = [module.name for module in pkgutil.iter_modules(frameworks.__path__)]
    return tuple(sorted(name for name in modules if hasattr(_get_module(name), "LEGGED_ONLY")))


def check_framework(name: str) -> None:
    """Check the name of a framework.

    Args:
        name: Name such as `isaaclab`.

    Raises:
        ConfigError: if the framework is unknown.
    """
    if name not in framework_names():
        expected = expected_names(name, framework_names(), "expected")
        raise ConfigError(f"framework: got {name!r}; {expected}")


def reads_mjcf(name: str) -> bool:
    """Return whether a framework reads robot.xml instead of robot.urdf."""
    return getattr(_get_module(name), "READS_MJCF", False)


def config_files(name: str, robot: ConfigRobot) -> dict[str, str]:
    """Return the files for a framework.

    Args:
        name: Name of the framework.
        robot: The robot.

    Returns:
        Text of each file by its name in the folder of robot.toml. The first file is the
        configuration.

    Raises:
        ConfigError: if the framework is unknown, or does not support the robot.
        ExportError: if the framework has another robot of that name.
    """
    check_framework(name)
    module = _get_module(name)
    if module.LEGGED_ONLY:
        others = [other for other in framework_names() if not _get_module(other).LEGGED_ONLY]
        check_legs(robot, name, others)
    if hasattr(module, "config_files"):
        return dict(module.config_files(robot))
    # A file with the name of the framework would shadow it.
    return {f"{name}_config.py": module.config_text(robot)}


def train_commands(name: str, spec: RobotSpec, folder: Path) -> tuple[str, list[str]]:
    """Return where to train a robot in a framework, and the commands, if there are any.

    Args:
        name: The name of a framework.
        spec: The spec of the robot.
        folder: The folder of the robot.
    """
    module = _get_module(name)
    if not hasattr(module, "train_commands"):
        return name, []
    place, commands = module.train_commands(spec, folder)
    return place, commands


def robot_config_files(
    name: str, facts: Facts, spec: RobotSpec, *, has_map: bool = False
) -> dict[str, str]:
    """Return the files for a framework of a robot whose facts are known.

    Args:
        name: The name of a framework.
        facts: Facts of the robot in robot.urdf.
        spec: The spec of the robot.
        has_map: Whether the robot is trained on a map, in a framework with `map_files`.

    Raises:
        TerrainkitError: as `config_files`.
    """
    joints = facts.model.joints
    bodies = [body_name(body) for body in facts.bodies]
    links = [link.name for body in facts.bodies for link in body.links]
    robot = ConfigRobot(
        spec=spec,
        bodies=(*bodies, *spec.feet),
        sites=("imu", *spec.feet, *(link for link in links if link not in bodies)),
        limits={joint.name: joint.range for joint in joints if joint.range is not None},
        passive_joints=[j.name for j in joints if j.moves and j.name not in spec.joint_order],
        roles={name: role for leg in facts.legs for name, role in _roles(leg).items()},
        foot_height=_foot_height(facts, spec),
        has_fixed_feet=not set(spec.feet) <= set(bodies),
        has_map=has_map,
    )
    return config_files(name, robot)


def _foot_height(facts: Facts, spec: RobotSpec) -> float:
    """Return the mean height of the frames of the feet on the ground, at the default pose [m]."""
    if facts.stance is None or not spec.feet:
        return 0.0
    poses = body_poses(facts.bodies, facts.default_pose)
    bodies = [facts.body_of[foot] for foot in spec.feet]
    frames = [
        poses[body.index] @ pose_in_body(body, foot)
        for body, foot in zip(bodies, spec.feet, strict=True)
    ]
    return float(facts.stance.height + fmean(frame[2, 3] for frame in frames))


def _roles(leg: Leg) -> dict[str, str]:
    """Return the role of each joint of a leg; joints below the knee belong to the ankle."""
    roles: dict[str, str] = {}
    for joint, role in zip(leg.joints, leg.roles, strict=True):
        is_ankle = "knee" in roles.values() and role not in ("slide", "wheel")
        roles[joint.name] = "ankle" if is_ankle else role
    return roles


def _get_module(name: str) -> ModuleType:
    return importlib.import_module(f"{frameworks.__name__}.{name}")
