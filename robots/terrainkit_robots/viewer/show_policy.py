"""Show a policy that walks live in MuJoCo, with sliders for its commands, in the browser."""

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit.perception.orientation import quat_to_yaw
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.description.load import load_robot
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.policy.load_policy import load_policy, single_torch_thread
from terrainkit_robots.policy.play import demo_commands, make_play_env
from terrainkit_robots.policy.policy_rollout import rollout
from terrainkit_robots.rl.run import PolicySpec
from terrainkit_robots.transforms import FloatArray, wrap_to_pi
from terrainkit_robots.viewer.ground_scene import look_at, show_ground
from terrainkit_robots.viewer.robot_scene import RobotScene

if TYPE_CHECKING:
    import viser

_MAX_SECONDS = 3600.0
"""Time after which the robot is reset [s]."""

_FRAME_TIME = 0.04
"""Least time between two poses that are sent to the browser [s]."""

_POINT_COLOR = (255, 200, 0)

_EDGE = 0.5
"""Distance from the edge of the map at which the robot is reset [m]."""


class PolicyView:
    """A robot that a policy walks on the terrain of its training, in the scene of a server."""

    def __init__(
        self,
        server: "viser.ViserServer",
        run: PolicySpec,
        terrain: str | None = None,
        terrain_node: "viser.SceneNodeHandle | None" = None,
    ) -> None:
        """Load the policy, and add the terrain, the robot and the controls.

        Args:
            server: The server.
            run: The policy, such as a run.
            terrain: Terrain as `load_terrain` takes it; None for the terrain of the training.
            terrain_node: Node of this terrain, if `show_ground` has added it to the scene.

        Raises:
            ConfigError: If the run has no policy, or one of another robot; if the terrain cannot be
                read, or changed after the training.
        """
        config = EvaluationConfig(
            seconds=_MAX_SECONDS, terrain=terrain, num_envs=1, command=(0.0, 0.0, 0.0)
        )
        start = replace(run.task.init_state, yaw=0.0)  # along x, where the levels rise
        run = replace(run, task=replace(run.task, init_state=start))
        self.env, _ = make_play_env(run, config)
        self._policy = load_policy(run, self.env)
        self._server = server
        self.ground = terrain_node or show_ground(server, self.env.terrain)
        self.robot = RobotScene(server, Facts(load_robot(run.robot.mjcf)))
        model = self.env.scene.model
        self._addresses = {
            joint.name: int(model.joint(joint.name).qposadr[0]) for joint in self.robot.facts.joints
        }
        self._add_controls(server.gui)
        self._points = server.scene.add_point_cloud(
            "/height_points", np.zeros((1, 3)), _POINT_COLOR, point_size=0.02, visible=False
        )
        self._reset()
        self._anchor = self.env.sim.qpos[0, :3].copy()  # of the robot in the scene, if followed
        self.update_robot()
        look_at(server, self.robot.base.position)

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
        position = env.sim.qpos[0, :2]
        lower, upper = np.add(env.terrain.lower, _EDGE), np.subtract(env.terrain.upper, _EDGE)
        if self._reset_requested or (position < lower).any() or (position > upper).any():
            self._reset()
        if self.paused.value:
            return
        command = np.array([[slider.value for slider in self.commands]], np.float32)
        for _, fell in rollout(env, self._policy, [self._with_heading(command)]):
            if fell.any():
                self.falls.value = str(int(self.falls.value) + 1)
                self._heading = self._yaw()

    def _reset(self) -> None:
        """Reset the robot to the selected patch."""
        env = self.env
        self._reset_requested = False
        env.curriculum.levels[:] = min(self.level.value, len(env.terrain.terrain_names) - 1)
        env.curriculum.columns[:] = int(self.column.value.partition(":")[0])
        env.reset()
        self.falls.value = "0"
        self._heading = self._yaw()

    def _yaw(self) -> float:
        return float(quat_to_yaw(self.env.sim.qpos[0, 3:7]))

    def _with_heading(self, command: FloatArray) -> FloatArray:
        """Return a command that keeps the heading on a map, unless it turns."""
        if command[0, 2] or self.env.terrain.is_plane:
            self._heading = self._yaw()
        else:
            error = wrap_to_pi(np.array(self._heading - self._yaw()))
            command[0, 2] = self.env.cfg.commands.heading_stiffness * error
        return command

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
