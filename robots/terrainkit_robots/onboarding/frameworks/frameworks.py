"""Frameworks: which there are, and the configuration of a robot for each.

A framework is a module of this package that says what it takes, `LEGGED_ONLY`, and writes the file,
`config_text`.
"""

import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.onboarding import frameworks
from terrainkit_robots.onboarding.derive_spec.named_bodies import body_name
from terrainkit_robots.onboarding.frameworks.legged_robot import check_legs
from terrainkit_robots.onboarding.frameworks.robot import ConfiguredRobot
from terrainkit_robots.spec.robot_spec import RobotSpec

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts


@cache
def names() -> tuple[str, ...]:
    """Return what `--config` takes, by the alphabet."""
    found = [module.name for module in pkgutil.iter_modules(frameworks.__path__)]
    return tuple(sorted(name for name in found if hasattr(_module(name), "LEGGED_ONLY")))


def file_name(framework: str) -> str:
    """Return what to call the file; not as the framework, which it would hide from Python."""
    _check(framework)
    return f"{framework}_config.py"


def config_text(
    framework: str,
    spec: RobotSpec,
    *,
    bodies: Sequence[str] = (),
    ranges: Mapping[str, tuple[float, float]] | None = None,
    undriven: Sequence[str] = (),
) -> str:
    """Return the configuration of a robot, a Python file that lies beside its `robot.toml`.

    Args:
        framework: One of `names()`.
        spec: The robot.
        bodies: Every body there is once fixed joints are merged; legged_gym finds bodies by
            substrings, which must not hit others. If empty, those that the spec names.
        ranges: Lower and upper limit of each joint, as the URDF has them; without them the
            share that soft limits leave is the usual one.
        undriven: Joints of the URDF that move and have no motor.

    Raises:
        ConfigError: if there is no such framework, or it cannot have such a robot.
    """
    _check(framework)
    robot = ConfiguredRobot(spec=spec, bodies=bodies, ranges=ranges, undriven=undriven)
    module = _module(framework)
    if module.LEGGED_ONLY:
        others = [name for name in names() if not _module(name).LEGGED_ONLY]
        check_legs(robot, framework, others)
    write: Callable[[ConfiguredRobot], str] = module.config_text
    return write(robot)


def config_of(framework: str, facts: "Facts", spec: RobotSpec) -> str:
    """Return the configuration of a robot of which the facts are at hand, too.

    Args:
        framework: One of `names()`.
        facts: The robot as its `robot.urdf` is written.
        spec: The robot.

    Raises:
        ConfigError: if there is no such framework, or it cannot have such a robot.
    """
    bodies = (*(body_name(body) for body in facts.bodies), *spec.feet)
    ranges = {joint.name: joint.range for joint in facts.model.joints if joint.range is not None}
    moving = [joint.name for joint in facts.model.joints if joint.moves]
    undriven = [name for name in moving if name not in spec.joint_order]
    return config_text(framework, spec, bodies=bodies, ranges=ranges, undriven=undriven)


def _check(framework: str) -> None:
    if framework not in names():
        raise ConfigError(f"no framework {framework!r}; there are: {listing(names())}")


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"{frameworks.__name__}.{name}")
