"""Specs and robots for the tests of specs."""

from dataclasses import dataclass
from pathlib import Path

import pytest

import terrainkit_robots
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import read_robot
from terrainkit_robots.spec.robot_spec import RobotSpec

BUNDLED = Path(terrainkit_robots.__file__).parent / "description/bundled"


@dataclass(frozen=True)
class Gain:
    """What derive_spec needs of a gain."""

    stiffness: float = 40.0
    damping: float = 1.0
    armature: float = 0.0
    reason: str = "for a test"


@pytest.fixture
def bundled():
    """Return a bundled robot, such as `quadruped.urdf`, with texts replaced."""

    def read(name, *replace, tmp_path=None, spec=None):
        path = BUNDLED / Path(name).stem / name
        if replace:
            text = path.read_text(encoding="utf-8")
            for old, new in replace:
                assert old in text
                text = text.replace(old, new)
            path = tmp_path / name
            path.write_text(text, encoding="utf-8")
        return Facts(read_robot(path), spec=spec)

    return read


@pytest.fixture
def robot(tmp_path):
    """Return the robot of a text."""

    def read(text, spec=None):
        path = tmp_path / ("robot.xml" if "<mujoco" in text else "robot.urdf")
        path.write_text(text, encoding="utf-8")
        return Facts(read_robot(path), spec=spec)

    return read


@pytest.fixture
def gains():
    """Return gains for each actuated joint of a robot."""

    def make(facts, **changed):
        return {joint.name: Gain(**changed) for joint in facts.actuated}

    return make


def values(**changed):
    """Return what a small spec is made from."""
    table = {"a": 1.0, "b": 2.0}
    names = ("default_pose", "stiffness", "damping", "effort", "velocity", "armature")
    return {
        "name": "robot",
        "urdf": "robot.urdf",
        "mjcf": "robot.xml",
        "floating": True,
        "joint_order": ("a", "b"),
        "base": "trunk",
        **dict.fromkeys((*names, "action_scale"), table),
        "soft_limits": {"a": (-1.0, 1.0)},
        **changed,
    }


@pytest.fixture
def spec():
    """Return a small spec, with values changed."""
    return lambda **changed: RobotSpec(**values(**changed))
