"""The training frameworks for which a configuration can be written.

Each framework is a module of this package with a flag `LEGGED_ONLY` and a function `config_text`.
"""

import importlib
import pkgutil
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError
from terrainkit.settings.text import expected_names
from terrainkit_robots.onboarding import frameworks
from terrainkit_robots.onboarding.derive_spec.named_bodies import body_name
from terrainkit_robots.onboarding.frameworks.config_robot import ConfigRobot
from terrainkit_robots.onboarding.frameworks.legged_robot import check_legs
from terrainkit_robots.spec.robot_spec import RobotSpec

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts
    from terrainkit_robots.analysis.legs.legs import Leg


@cache
def framework_names() -> tuple[str, ...]:
    """Return the names of the frameworks in alphabetical order."""
    modules = [module.name for module in pkgutil.iter_modules(frameworks.__path__)]
    return tuple(sorted(name for name in modules if hasattr(_get_module(name), "LEGGED_ONLY")))


def config_file_name(name: str) -> str:
    """Return the file name of a configuration.

    Raises:
        ConfigError: if the framework is unknown.
    """
    _check_name(name)
    return f"{name}_config.py"  # a file with the name of the framework would shadow it


def _check_name(name: str) -> None:
    if name not in framework_names():
        expected = expected_names(name, framework_names(), "expected")
        raise ConfigError(f"framework: got {name!r}; {expected}")


def config_text(name: str, robot: ConfigRobot) -> str:
    """Return the configuration of a robot, a Python file for the folder of its robot.toml.

    Raises:
        ConfigError: if the framework is unknown, or does not support the robot.
    """
    _check_name(name)
    module = _get_module(name)
    if module.LEGGED_ONLY:
        others = [other for other in framework_names() if not _get_module(other).LEGGED_ONLY]
        check_legs(robot, name, others)
    text: str = module.config_text(robot)
    return text


def robot_config_text(name: str, facts: "Facts", spec: RobotSpec) -> str:
    """Return the configuration of a robot whose facts are known.

    Args:
        name: The name of a framework.
        facts: Facts of the robot in robot.urdf.
        spec: The spec of the robot.

    Raises:
        ConfigError: if the framework is unknown, or does not support the robot.
    """
    joints = facts.model.joints
    robot = ConfigRobot(
        spec=spec,
        bodies=(*(body_name(body) for body in facts.bodies), *spec.feet),
        limits={joint.name: joint.range for joint in joints if joint.range is not None},
        passive_joints=[j.name for j in joints if j.moves and j.name not in spec.joint_order],
        roles={name: role for leg in facts.legs for name, role in _roles(leg).items()},
    )
    return config_text(name, robot)


def _roles(leg: "Leg") -> dict[str, str]:
    """Return the role of each joint of a leg; those below the knee belong to the ankle."""
    roles: dict[str, str] = {}
    for joint, role in zip(leg.joints, leg.roles, strict=True):
        is_ankle = "knee" in roles.values() and role != "slide"
        roles[joint.name] = "ankle" if is_ankle else role
    return roles


def _get_module(name: str) -> ModuleType:
    return importlib.import_module(f"{frameworks.__name__}.{name}")
