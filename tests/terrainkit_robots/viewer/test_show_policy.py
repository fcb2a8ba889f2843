import math
from collections import deque

import mujoco
import numpy as np
import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.viewer.show_policy import PolicyView
from tests.viewer_client import CAMERA, connect_to, send, update, wait_for


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
    position = view.robot.base.position - view.ground.position
    np.testing.assert_allclose(position, qpos[:3], atol=1e-6)
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
    assert "/map/ground" in shown
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


def test_invalid_messages_of_a_browser_do_not_end_the_view(server, view):
    forward, *_ = view.commands
    with connect_to(server) as client:
        for value in (math.nan, math.inf, 1e9, "fast"):
            send(client, update(forward, value))
        send(client, update(view.falls, "many"))
        send(client, update(view.column, "west"))
        send(client, CAMERA | {"look_at": CAMERA["position"]})
        send(client, CAMERA)
        wait_for(server.get_clients)
        send(client, update(forward, forward.max))
        wait_for(lambda: forward.value == forward.max)
        for _ in range(5):
            view.step()
            view.update_robot()
    assert view.falls.value == "0"
    assert np.isfinite(view.env.sim.qpos).all()


def test_robot_stays_in_view_of_a_page_that_reports_its_camera_late(server, view):
    view.commands[0].value = 1.0
    with connect_to(server) as client:
        send(client, CAMERA)
        wait_for(server.get_clients)
        (page,) = server.get_clients().values()
        reports = deque(maxlen=10)
        for _ in range(100):  # 2 s
            view.step()
            view.update_robot()
            camera = {"position": page.camera.position, "look_at": page.camera.look_at}
            reports.append(CAMERA | {name: each.tolist() for name, each in camera.items()})
            send(client, reports[0])
        assert view.env.sim.qpos[0, 0] > 1.0
        distance = np.linalg.norm(page.camera.position - view.robot.base.position)
        assert distance == pytest.approx(math.hypot(3.0, 1.5), abs=0.3)


def test_page_keeps_the_camera_that_its_user_chose(server, view):
    with connect_to(server) as client:
        send(client, CAMERA)
        wait_for(server.get_clients)
        (page,) = server.get_clients().values()
        for x in (4.0, 5.0, 6.0):
            send(client, CAMERA | {"position": (x, 1.0, 1.0)})
            wait_for(lambda x=x: page.camera.position[0] == x)
            for _ in range(10):
                view.step()
                view.update_robot()
            assert page.camera.position.tolist() == [x, 1.0, 1.0]


def test_ground_moves_under_the_robot_only_while_it_is_followed(server, shown, view):
    view.commands[0].value = 1.0

    def walk():
        for _ in range(50):
            view.step()
        view.update_robot()
        scene, simulation = view.robot.base.position, view.env.sim.qpos[0, :3]
        np.testing.assert_allclose(scene - view.ground.position, simulation, atol=1e-5)
        return scene.copy()

    start = view.robot.base.position.copy()
    np.testing.assert_allclose(walk(), start, atol=1e-6)
    shown["follow the robot"].value = False
    assert walk()[0] > start[0] + 0.5
    with connect_to(server) as client:
        send(client, CAMERA)
        wait_for(server.get_clients)
        send(client, update(shown["follow the robot"], True))
        wait_for(lambda: view.follow.value)
        wait_for(lambda: np.allclose(walk(), CAMERA["look_at"]))
