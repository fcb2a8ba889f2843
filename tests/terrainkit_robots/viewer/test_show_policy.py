import mujoco
import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.viewer.show_policy import PolicyView


@pytest.fixture
def view(server):
    return PolicyView(server, open_run("quadruped"))


def test_policy_walks_with_the_command_of_the_sliders(shown, view):
    for name, value in (("forward [m/s]", 0.5), ("left [m/s]", 0.0), ("yaw [rad/s]", 0.0)):
        shown[name].value = value
    for _ in range(150):  # 3 s
        view.step()
    x, y, _ = view.env.sim.qpos[0, :3]
    assert 0.9 < x < 1.8
    assert abs(y) < 0.3
    assert view.env.commands[0].tolist() == [0.5, 0.0, 0.0]
    assert view.falls.value == "0"


def test_robot_of_scene_has_the_pose_of_the_simulation(view):
    for _ in range(10):
        view.step()
    view.update_robot()
    model, qpos = view.env.scene.model, view.env.sim.qpos[0]
    np.testing.assert_allclose(view.robot.base.position, qpos[:3], atol=1e-6)
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    for frame, body in zip(view.robot.bodies, view.robot.facts.bodies, strict=True):
        expected = data.body(body.top.name).xpos - qpos[:3]
        rotation = data.body("base").xmat.reshape(3, 3)
        np.testing.assert_allclose(rotation @ frame.position, expected, atol=1e-5)


def test_pause_and_reset(shown, view):
    for _ in range(5):
        view.step()
    shown["pause"].value = True
    paused = view.env.sim.qpos.copy()
    view.step()
    np.testing.assert_array_equal(view.env.sim.qpos, paused)
    shown["reset"].value = True
    view.step()
    assert view.env.steps_since_reset[0] == 0
    assert not np.array_equal(view.env.sim.qpos, paused)


def test_map_policy_is_reset_to_the_selected_patch(server, shown):
    view = PolicyView(server, open_run("quadruped_map"))
    assert "/ground" in shown
    terrain = view.env.terrain
    levels, columns = terrain.terrain_names.shape
    shown["level"].value = levels - 1
    shown["terrain"].value = shown["terrain"].options[-1]
    shown["pause"].value = True
    view.step()
    origin = terrain.env_origins[levels - 1, columns - 1]
    size = view.env.terrain.terrain_map.config.patch_size
    assert (np.abs(view.env.sim.qpos[0, :2] - origin[:2]) < np.array(size) / 2).all()


def test_policy_view_rejects_unknown_terrain(server):
    with pytest.raises(ConfigError, match="expected plane"):
        PolicyView(server, open_run("quadruped"), "hills")
