import math
from collections import deque

import mujoco
import numpy as np
import pytest

from terrainkit.perception.orientation import quat_to_yaw
from terrainkit_robots.policy.play import demo_commands
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.viewer.ground_scene import DEMO_MAP
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


def test_controls_and_camera(server, shown, view):
    commands, names = view.env.cfg.commands, ("forward [m/s]", "left [m/s]", "yaw [rad/s]")
    ranges = commands.lin_vel_x, commands.lin_vel_y, commands.ang_vel_yaw
    for name, (low, high), initial in zip(names, ranges, demo_commands(commands)[0], strict=True):
        slider = shown[name]
        assert (slider.min, slider.max, slider.step) == (min(low, 0), max(high, 0), 0.01)
        assert slider.value == pytest.approx(initial)
    assert shown["level"].max == 1
    assert not shown["level"].visible | shown["terrain"].visible
    camera = server.initial_camera
    np.testing.assert_allclose(camera.look_at, view.robot.base.position)
    offset = np.subtract(camera.position, camera.look_at)
    np.testing.assert_allclose(offset, [-1.5, -2.5, 1.5])


def test_falls_are_counted_until_a_reset(view):
    view.step()
    for count in ("1", "2"):
        view.env.sim.qpos[0, 3:7] = (0, 1, 0, 0)
        view.step()
        assert view.falls.value == count
    view.request_reset()
    view.step()
    assert view.falls.value == "0"


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
    assert (shown["level"].max, shown["level"].visible) == (levels - 1, True)
    assert shown["terrain"].value.startswith(f"{columns // 2}: ")
    shown["level"].value = levels - 1
    shown["terrain"].value = shown["terrain"].options[-1]
    shown["pause"].value = True
    view.step()
    origin = terrain.env_origins[levels - 1, columns - 1]
    size = view.env.terrain.terrain_map.config.patch_size
    assert (np.abs(view.env.sim.qpos[0, :2] - origin[:2]) < np.array(size) / 2).all()


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


@pytest.fixture
def demo(server):
    return PolicyView(server, open_run("quadruped_hard"), terrain=str(DEMO_MAP))


def test_demo_crosses_the_first_level_along_x_without_a_fall(demo):
    (start, *_), (end, *_) = demo.env.terrain.env_origins[:2, 0]
    for _ in range(1000):  # 20 s
        demo.step()
    assert end > start + 9
    assert demo.env.sim.qpos[0, 0] > end
    assert demo.falls.value == "0"


def test_robot_keeps_the_heading_that_the_user_turns_it_to(shown, demo):
    shown["yaw [rad/s]"].value = 0.5
    for _ in range(100):  # 2 s
        demo.step()
    heading = quat_to_yaw(demo.env.sim.qpos[0, 3:7])
    assert 0.6 < heading < 1.4
    shown["yaw [rad/s]"].value = 0.0
    shown["forward [m/s]"].value = 0.4
    for _ in range(50):  # 1 s
        demo.step()
    assert quat_to_yaw(demo.env.sim.qpos[0, 3:7]) == pytest.approx(heading, abs=0.15)


def test_robot_is_reset_at_the_edge_of_the_map_and_has_not_fallen(demo):
    demo.step()
    demo.env.sim.qpos[0, 0] = demo.env.terrain.upper[0] - 0.4
    demo.step()
    assert demo.env.sim.qpos[0, 0] < 2.0
    assert demo.falls.value == "0"
