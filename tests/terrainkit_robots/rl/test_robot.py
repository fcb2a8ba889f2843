from dataclasses import replace

import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.scene import Robot


class TestArrays:
    def test_are_in_the_order_of_the_spec(self, cart):
        np.testing.assert_allclose(cart.default_pose, [0.0, -0.2, 0.3], rtol=1e-6)
        np.testing.assert_allclose(cart.effort, [3.0, 5.0, 6.0])
        np.testing.assert_allclose(cart.velocity, [30.0, 10.0, 10.0])
        assert cart.default_pose.dtype == np.float32

    def test_a_joint_without_limits_turns_for_ever(self, cart):
        np.testing.assert_allclose(cart.lower, [-np.inf, -0.9, -0.9], rtol=1e-6)
        np.testing.assert_allclose(cart.upper, [np.inf, 0.9, 0.9], rtol=1e-6)

    @pytest.mark.parametrize(
        ("stiffness", "damping", "wheel"), [(0.0, 1.0, True), (0.0, 0.0, False), (5.0, 1.0, False)]
    )
    def test_wheels_have_damping_and_no_stiffness(
        self, cart_spec, tmp_path, stiffness, damping, wheel
    ):
        spec = replace(cart_spec, stiffness={".*": stiffness}, damping={".*": damping})
        assert Robot.from_spec(spec, tmp_path).wheels.tolist() == [wheel] * len(spec.joint_order)

    def test_the_mjcf_lies_beside_the_spec(self, cart):
        assert cart.mjcf.name == "cart.xml"
        assert cart.mjcf.is_file()

    @pytest.mark.parametrize("name", ["quadruped", "biped"])
    def test_bundled_robots_can_be_trained(self, name, request):
        robot = request.getfixturevalue(name)
        assert len(robot.default_pose) == len(robot.spec.joint_order)
        assert (robot.lower < robot.default_pose).all()
        assert (robot.default_pose < robot.upper).all()
        assert (robot.effort > 0).all()


class TestRefused:
    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"floating": False}, "cart has a fixed base"),
            ({"feet": ()}, "cart has no feet"),
            ({"spawn_height": None}, "lacks spawn_height or base_height_target"),
            ({"base_height_target": None}, "lacks spawn_height or base_height_target"),
            ({"effort": {"wheel_axle": 3.0}}, "effort"),
            ({"default_pose": {".*": 0.0, "ghost": 1.0}}, "ghost"),
        ],
    )
    def test_what_training_needs_is_asked_for(self, cart_spec, tmp_path, changes, message):
        with pytest.raises(ConfigError, match=message) as caught:
            Robot.from_spec(replace(cart_spec, **changes), tmp_path)
        assert "\n" not in str(caught.value)

    def test_a_folder_without_a_spec(self, tmp_path):
        with pytest.raises(ConfigError, match=r"has no robot\.toml; wanted a folder that terrain"):
            Robot.load(tmp_path)

    def test_a_folder_that_is_not_there(self, tmp_path):
        with pytest.raises(ConfigError, match=r"has no robot\.toml"):
            Robot.load(tmp_path / "nowhere")
