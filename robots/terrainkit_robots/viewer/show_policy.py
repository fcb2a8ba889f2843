"""Show a policy that walks live in MuJoCo, with sliders for its commands, in the browser."""

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit.views.viewer import FIELD_OF_VIEW, show_map
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.policy.load import load_policy, single_torch_thread
from terrainkit_robots.policy.play import demo_commands, make_play_env
from terrainkit_robots.policy.rollout import rollout
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.rl.terrain import MapGround
from terrainkit_robots.viewer.robot_scene import RobotScene

if TYPE_CHECKING:
    import viser

_MAX_SECONDS = 3600.0
"""Time after which the robot is reset [s]."""

_FRAME_TIME = 0.04
"""Least time between two poses that are sent to the browser [s]."""

_POINT_COLOR = (255, 200, 0)

_CAMERA_OFFSET = np.array([-1.5, -2.5, 1.5])
"""Position of the camera relative to the robot [m]."""


class PolicyView:
    """A robot that a policy walks on the terrain of its training, in the scene of a server."""

    def __init__(
        self, server: "viser.ViserServer", run: PolicySpec, terrain: str | None = None
    ) -> None:
        """Load the policy, and add the terrain, the robot and the controls.

        Args:
            server: The server.
            run: The policy, such as a run.
            terrain: Terrain as `load_terrain` takes it; None for the terrain of the training.

        Raises:
            ConfigError: If the run has no policy, or one of another robot; if the terrain cannot be
                read, or changed after the training.
        """
        config = EvaluationConfig(
            seconds=_MAX_SECONDS, terrain=terrain, num_envs=1, command=(0.0, 0.0, 0.0)
        )
        self.env, _ = make_play_env(run, config)
        self._policy = load_policy(run, self.env)
        self._server = server
        ground = self.env.terrain
        if isinstance(ground, MapGround):
            self.ground: viser.SceneNodeHandle = show_map(server, ground.terrain_map)
        else:
            server.scene.set_up_direction("+z")
            self.ground = server.scene.add_grid(
                "/map", infinite_grid=True, cell_size=0.5, section_size=5.0
            )
        self.robot = RobotScene(server, Facts(load_robot(run.robot.mjcf)))
        model = self.env.scene.model
        self._addresses = {
            joint.name: int(model.joint(joint.name).qposadr[0]) for joint in self.robot.facts.joints
        }
        self._add_controls(server.gui)
        self._points = server.scene.add_point_cloud(
            "/height_points", np.zeros((1, 3)), _POINT_COLOR, point_size=0.02, visible=False
        )
        self._anchor = self.env.sim.qpos[0, :3].copy()  # of the robot in the scene, if followed
        self.update_robot()
        server.initial_camera.fov = FIELD_OF_VIEW
        server.initial_camera.look_at = self.robot.base.position
        server.initial_camera.position = self.robot.base.position + _CAMERA_OFFSET

    def _add_controls(self, gui: Any) -> None:
        commands, terrain = self.env.cfg.commands, self.env.terrain
        ranges = (commands.lin_vel_x, commands.lin_vel_y, commands.ang_vel_yaw)
        names = ("forward [m/s]", "left [m/s]", "yaw [rad/s]")
        self.commands = [
            gui.add_slider(name, min(low, 0.0), max(high, 0.0), 0.01, float(initial))
            for name, (low, high), initial in zip(
                names, ranges, demo_commands(commands)[0], strict=True
            )
        ]
        """Sliders of the forward and left velocity [m/s] and the yaw velocity [rad/s]."""

        self.paused = gui.add_checkbox("pause", initial_value=False)
        self.follow = gui.add_checkbox("follow the robot", initial_value=True)
        self.follow.on_update(self._move_to_view)
        has_scan = self.env.has_height_scan
        self.height_points = gui.add_checkbox("height points", False, visible=has_scan)
        levels, columns = terrain.terrain_names.shape
        self.level = gui.add_slider("level", 0, max(levels - 1, 1), 1, 0, visible=levels > 1)
        options = [f"{k}: {name}" for k, name in enumerate(terrain.terrain_names[0].tolist())]
        middle = options[columns // 2]  # far from the sides of the map
        self.column = gui.add_dropdown(
            "terrain", options, initial_value=middle, visible=columns > 1
        )
        self.reset_button = gui.add_button("reset")
        self.falls = gui.add_text("falls", "0", disabled=True)
        # Callbacks run in other threads, so they only leave a request for the next step.
        self._reset_requested = True
        for handle in (self.level, self.column):
            handle.on_update(lambda _: self.request_reset())
        self.reset_button.on_click(lambda _: self.request_reset())

    def request_reset(self) -> None:
        """Reset the robot before its next step, to the selected patch."""
        self._reset_requested = True

    def _move_to_view(self, event: "viser.GuiEvent[Any]") -> None:
        """Show the robot from now on where the page looks at that requests to follow it."""
        if event.client is not None:
            self._anchor = event.client.camera.look_at.copy()

    def run(self) -> None:
        """Step in real time, and never return."""
        dt = self.env.cfg.dt
        stride = max(1, round(_FRAME_TIME / dt))
        with single_torch_thread():
            next_time = time.monotonic()
            while True:
                for _ in range(stride):
                    self.step()
                self.update_robot()
                # A machine that is too slow shows slow motion, and does not catch up later.
                next_time = max(next_time + stride * dt, time.monotonic())
                time.sleep(max(0.0, next_time - time.monotonic()))

    def step(self) -> None:
        """Simulate one control step, unless the view is paused; reset first if requested."""
        env = self.env
        if self._reset_requested:
            self._reset_requested = False
            column = self.column.value.partition(":")[0]
            env.curriculum.levels[:] = min(self.level.value, len(env.terrain.terrain_names) - 1)
            env.curriculum.columns[:] = int(column)
            env.reset()
            self.falls.value = "0"
        if self.paused.value:
            return
        command = np.array([[slider.value for slider in self.commands]], np.float32)
        for _, fell in rollout(env, self._policy, [command]):
            if fell.any():
                self.falls.value = str(int(self.falls.value) + 1)

    def update_robot(self) -> None:
        """Send the pose of the robot to the browser.

        While pages follow the robot, the ground moves instead of the cameras. A page reports its
        camera late, so a camera that both the server and the user move would jump back and forth.
        """
        qpos = self.env.sim.qpos[0]
        with self._server.atomic():
            if self.follow.value:
                self.ground.position = self._anchor - qpos[:3]
            self.robot.set_base(qpos[:3] + self.ground.position, qpos[3:7].copy())
            self.robot.set_positions({name: qpos[k] for name, k in self._addresses.items()})
            self._points.visible = self.height_points.value
            if self.height_points.value:
                pose = qpos[None].astype(np.float32)
                points = np.stack(self.env.sensors.scan_points(pose[:, :3], pose[:, 3:7]), -1)[0]
                self._points.points = points + self.ground.position
