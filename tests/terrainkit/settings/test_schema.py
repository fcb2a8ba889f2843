from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit.settings.schema import Config, flatten
from terrainkit.settings.type_hint import UNIQUE, Interval, PositiveFloat, PositiveInt
from tests.tables import read_table


@dataclass(frozen=True, kw_only=True)
class Motor(Config):
    """A motor."""

    effort: PositiveFloat = 1.0
    """Largest torque [N m]."""

    names: Annotated[tuple[str, ...], UNIQUE] = ()
    """Names of the joints."""


@dataclass(frozen=True, kw_only=True)
class Robot(Config):
    """A robot."""

    legs: PositiveInt
    """Number of legs."""

    mass: float | None = None
    """Total mass [kg]."""

    motor: Motor = field(default_factory=Motor)
    """Motor of each joint."""

    limits: Mapping[str, Interval] = field(default_factory=dict)
    """Position limits of each joint [rad]."""

    spares: tuple[Motor, ...] = ()
    """Spare motors."""


def test_config_validates_fields_of_subclasses():
    assert Robot(legs=np.int64(4), limits={"hip": [0, 1]}).limits == {"hip": (0.0, 1.0)}
    with pytest.raises(ConfigError, match=r"effort: got 0; expected a number > 0"):
        Motor(effort=0)
    with pytest.raises(ConfigError, match=r"names: got .*, each one once"):
        Motor(names=("a", "a"))


def test_config_rejects_subclass_without_decorator():
    class Servo(Motor):
        effort: float = 3.0

    with pytest.raises(ConfigError, match=r"Servo lacks @dataclass\(frozen=True, kw_only=True\)"):
        Servo()


def test_from_toml_builds_nested_configs():
    text = "legs = 4\nmass = 'none'\n[motor]\neffort = 2\n[[spares]]\neffort = 3\n[[spares]]\n"
    robot = Robot.from_toml(text)
    assert robot == Robot(legs=4, motor=Motor(effort=2.0), spares=(Motor(effort=3.0), Motor()))
    assert Robot.from_toml(robot.to_toml()) == robot
    assert Robot.from_toml("legs = 2", robot).motor == robot.motor


@pytest.mark.parametrize(("text", "message"), read_table(__file__, "from_toml_error_names_the_key"))
def test_from_toml_error_names_the_key(text, message):
    with pytest.raises(ConfigError, match=message):
        Robot.from_toml(text)


def test_nested_keys_are_flattened_and_suggested():
    assert dict(flatten(Robot(legs=4)))["motor.effort"] == 1.0
    with pytest.raises(ConfigError, match=r"no key 'effort'; did you mean 'motor\.effort'"):
        Robot.from_toml("effort = 1", Robot(legs=4))


def test_to_toml_describes_subclass_without_docstring():
    @dataclass(frozen=True, kw_only=True)
    class Servo(Motor):
        effort: PositiveFloat = 3.0

    assert "\n# A motor.\n[motor]\neffort = 3.0" in Robot(legs=4, motor=Servo()).to_toml()


def test_to_toml_rejects_name_that_is_not_utf8():
    config = Motor(names=("hip", "a\udcff"))
    with pytest.raises(ConfigError, match=r"got .*a\\udcff'; expected a name that is UTF-8"):
        config.to_toml()
