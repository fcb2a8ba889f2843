import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.robot_arrays import Robot

LEGGED = {"feet": ("a_foot",), "spawn_height": 0.3, "base_height_target": 0.28}


def test_arrays_are_in_the_order_of_the_joints(spec, tmp_path):
    robot = Robot.from_spec(spec(**LEGGED, joint_order=("b", "a"), effort={"[ab]": 3}), tmp_path)
    for array in (robot.default_pose, robot.velocity, robot.action_scale):
        assert (array.tolist(), array.dtype) == ([2.0, 1.0], np.float32)
    assert robot.effort.tolist() == [3.0, 3.0]
    # A joint without limits is unbounded.
    assert (robot.lower.tolist(), robot.upper.tolist()) == ([-np.inf, -1.0], [np.inf, 1.0])
    assert (robot.mjcf, robot.folder) == (tmp_path / "robot.xml", tmp_path)
    assert (robot.spawn_height, robot.base_height_target, robot.leg_length) == (0.3, 0.28, 0.28)
    assert Robot.from_spec(spec(**LEGGED, leg_length=0.4), tmp_path).leg_length == 0.4


@pytest.mark.parametrize(
    ("stiffness", "damping", "is_wheel"), [(0.0, 1.0, True), (0.0, 0.0, False), (5.0, 1.0, False)]
)
def test_wheels_have_damping_and_no_stiffness(spec, tmp_path, stiffness, damping, is_wheel):
    made = spec(**LEGGED, stiffness={".*": stiffness}, damping={".*": damping})
    assert Robot.from_spec(made, tmp_path).wheels.tolist() == [is_wheel] * 2


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_bundled_robots_have_valid_arrays(name, request):
    robot = request.getfixturevalue(name)
    assert robot.mjcf.is_file()
    assert len(robot.default_pose) == len(robot.spec.joint_order)
    assert (robot.lower < robot.default_pose).all()
    assert (robot.default_pose < robot.upper).all()
    assert (robot.effort > 0).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"floating": False}, "base of robot: got a fixed base"),
        ({"feet": ()}, "feet of robot: got none"),
        ({"spawn_height": None}, "lacks spawn_height or base_height_target"),
        ({"base_height_target": None}, "lacks spawn_height or base_height_target"),
        ({"effort": {"a": 3.0}}, "joint b is matched by no key of effort"),
        ({"default_pose": {".*": 0.0, "ghost": 1.0}}, "ghost"),
    ],
)
def test_from_spec_rejects_incomplete_spec(spec, tmp_path, changes, message):
    with pytest.raises(ConfigError, match=message) as caught:
        Robot.from_spec(spec(**(LEGGED | changes)), tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("folder", [".", "nowhere"])
def test_load_rejects_folder_without_spec(tmp_path, folder):
    with pytest.raises(ConfigError, match=r"cannot read .*robot\.toml"):
        Robot.load(tmp_path / folder)
