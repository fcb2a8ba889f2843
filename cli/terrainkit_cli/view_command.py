"""The commands that show maps, robots and policies in the browser."""

import importlib.util
import os
import socket
import sys
import threading
import time
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta

from terrainkit.errors import ConfigError, install_command
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.settings.text import expected_names, truncate
from terrainkit_cli import render
from terrainkit_cli.argument_types import (
    Checkpoint,
    Packages,
    RobotName,
    TaskFile,
    TerrainName,
    XacroArguments,
    is_map,
    parse_settings,
)
from terrainkit_cli.parse import Command, option, positional
from terrainkit_cli.plugin_command import PluginCommand
from terrainkit_cli.signals import Terminated
from terrainkit_cli.training_extra import require_training

if TYPE_CHECKING:
    import viser

    from terrainkit_robots.rl.run import PolicySpec

DEMO_POLICY = "quadruped_hard"
"""The bundled policy that the demo shows."""

Kind = Literal["map", "robot", "run"]

OPTION_TYPES: dict[str, Kind] = {
    "terrain": "run",
    "checkpoint": "run",
    "robot": "run",
    "contract": "run",
    "package": "robot",
    "xacro_arg": "robot",
}
"""Options that apply to only one kind of source."""


@dataclass(frozen=True, kw_only=True)
class ViewerCommand(Command):
    """A command that serves a scene to browsers."""

    host: str = "localhost"
    """Name or address that the server listens on; 0.0.0.0 is reachable from other machines, at the
    name and the addresses of this one."""

    port: Annotated[int, Meta(ge=1, le=65535)] = 8080
    """Port that the server listens on; the next free one if it is in use."""

    def serve(
        self, show: "Show", title: str, *, show_first: "Show | None" = None, browser: bool = False
    ) -> int:
        """Serve a scene until the command is interrupted.

        Args:
            show: The function that fills the scene.
            title: What the scene shows, for the message with the address.
            show_first: A function that fills the part of the scene that pages show at once.
            browser: Whether to open the page.
        """
        with render.steps() as steps:
            steps.update("starting the viewer")
            from terrainkit.viewer.viewer_server import viewer_server

            with viewer_server(self.host, self.port) as server:
                if show_first is not None:
                    steps.update("building the ground")
                    show_first(server)
                    self._announce(server, title, browser=browser)
                steps.update(f"loading {title}")
                with suppress(KeyboardInterrupt, Terminated):
                    run = getattr(show(server), "run", wait)
                    steps.stop()
                    if show_first is None:
                        self._announce(server, title, browser=browser)
                    run()
        return 0

    def _announce(self, server: "viser.ViserServer", title: str, *, browser: bool) -> None:
        host = f"[{self.host}]" if ":" in self.host else self.host
        address = f"http://{host}:{server.get_port()}"
        render.result(f"{address} shows {title}; Ctrl+C ends it")
        if browser:
            open_page(address)

    def check_address(self) -> None:
        """Check that the server can listen on the host: viser would wait forever.

        Raises:
            ConfigError: if it cannot.
        """
        try:
            family, kind, *_, address = socket.getaddrinfo(self.host, 0, type=socket.SOCK_STREAM)[0]
            with socket.socket(family, kind) as trial:
                trial.bind(address)
        except OSError as error:
            raise ConfigError(
                f"--host: got {self.host}, which is not an address of this machine "
                f"({error.strerror}); expected localhost or 0.0.0.0"
            ) from None


@dataclass(frozen=True, kw_only=True)
class Demo(ViewerCommand):
    """Walk the bundled quadruped over a course, live in the browser.

    The policy walks in MuJoCo over stairs, gaps and slopes that become harder. Sliders set its
    commands and its level. Without a display, the command prints the address only.
    """

    browser: bool = True
    """Open the page in the browser."""

    def run(self) -> int:
        """Serve the view of the policy until the command is interrupted."""
        require_training("viser", "websockets", extra="demo")
        self.check_address()
        scene = _DemoScene()
        title = "the walking quadruped"
        return self.serve(
            scene.show_robot, title, show_first=scene.show_ground, browser=self.browser
        )


class _DemoScene:
    """The scene of the demo. The ground comes first, since torch takes seconds to import."""

    def show_ground(self, server: "viser.ViserServer") -> None:
        from terrainkit_robots.rl.terrain import load_terrain
        from terrainkit_robots.viewer.ground_scene import DEMO_MAP, show_ground

        self.terrain = str(DEMO_MAP)
        self.ground = show_ground(server, load_terrain(self.terrain))

    def show_robot(self, server: "viser.ViserServer") -> object:
        from terrainkit_robots.rl.run import open_run
        from terrainkit_robots.viewer.show_policy import PolicyView

        return PolicyView(server, open_run(DEMO_POLICY), self.terrain, self.ground)


@dataclass(frozen=True, kw_only=True)
class View(PluginCommand, ViewerCommand):
    """Show a map, a robot or a policy in the browser, in 3D.

    A robot has sliders for its joints and a list of the findings of check-robot. A policy walks
    live in MuJoCo, with sliders for its commands.

    The command prints the address and runs until Ctrl+C. It needs no display: with the default
    host, forward the port of a remote machine (ssh -L 8080:localhost:8080) and open the address.
    Web pages of other sites cannot connect to it.
    """

    source: Annotated[str, positional("MAP.npz|ROBOT|RUN")] = ""
    """A map; a URDF, xacro or MJCF file, an onboarded folder, a bundled robot, or a name of the
    package robot_descriptions, such as go2_description; or a run of terrainkit train, a checkpoint
    in one, or a bundled policy; or with --robot, a policy of any project (.onnx or .pt)."""

    robot: RobotName = ""
    """The robot of a policy of another project: a robot's name, or a folder written by
    terrainkit onboard."""

    contract: Annotated[Path, option("FILE")] | None = None
    """The contract of that policy, if it is not beside it or in its metadata: policy.json, or a
    YAML file in the form of deploy.yaml or unitree_rl_gym's deploy_mujoco."""

    policy: bool = False
    """Show the bundled policy of a robot instead of the robot."""

    terrain: TerrainName = ""
    """For a policy: plane, a map (.npz), or a map config (.toml); by default, the terrain of the
    training."""

    task: TaskFile | None = None
    """For a policy: a Python file with a task of your own, which it was
    trained with; it is executed."""

    checkpoint: Checkpoint | None = None
    """For a policy: the checkpoint to load; by default, the last one."""

    package: Packages = ()
    """For a robot: folder of a ROS package, for package:// and $(find ...)."""

    xacro_arg: XacroArguments = ()
    """For a robot: value of a xacro argument of the file."""

    def run(self) -> int:
        """Serve the view until the command is interrupted."""
        if not self.source:
            raise ConfigError("MAP.npz, ROBOT or RUN: missing; expected a map, a robot or a run")
        if importlib.util.find_spec("viser") is None:
            command = install_command("view")
            raise ConfigError(f"view requires viser; install it with: {command}")
        self.check_address()
        kind = source_kind(self.source, policy=self.policy or bool(self.robot))
        for name, expected in OPTION_TYPES.items():
            if getattr(self, name) != getattr(type(self), name) and kind != expected:
                option = name.replace("_", "-")
                raise ConfigError(
                    f"--{option}: got the {kind} {self.source}; expected a {expected}"
                )
        show = {"map": self._load_map, "robot": self._check_robot, "run": self._open_run}[kind]()
        return self.serve(show, self.source)

    def _load_map(self) -> "Show":
        from terrainkit.viewer.map_scene import show_map

        return partial(show_map, terrain_map=TerrainMap.load(self.source))

    def _check_robot(self) -> "Show":
        from terrainkit_robots.lint.check import check_robot
        from terrainkit_robots.lint.settings import read_settings
        from terrainkit_robots.spec.robot_arrays import SPEC_FILE
        from terrainkit_robots.spec.robot_spec import RobotSpec
        from terrainkit_robots.viewer.show_robot import show_robot

        path = Path(self.source)
        spec = None
        if (path / SPEC_FILE).is_file():
            spec = path / SPEC_FILE
            path = path / RobotSpec.load(spec).urdf
        given = parse_settings([], self.package, self.xacro_arg)
        with render.steps() as steps:
            steps.update("checking the robot")
            report = check_robot(path, given.over(read_settings(path.parent)), spec=spec)
        if not report.facts.bodies:
            raise ConfigError(f"{path} does not describe a robot; see terrainkit check-robot")

        return partial(show_robot, report=report)

    def _open_run(self) -> "Show":
        require_training()
        if self.contract and not self.robot:
            raise ConfigError("--robot: missing; expected the robot of the policy")
        from terrainkit_robots.viewer.show_policy import PolicyView

        run: PolicySpec
        if self.robot:
            from terrainkit_robots.policy.open_policy import open_policy
            from terrainkit_robots.rl.tasks import robot_and_task

            robot, task = robot_and_task(self.robot, self.task)
            run = open_policy(Path(self.source), robot, self.contract, task)
        else:
            from terrainkit_robots.rl.run import open_run

            run = open_run(self.source, self.checkpoint, self.task)
        return partial(PolicyView, run=run, terrain=self.terrain or None)


Show = Callable[["viser.ViserServer"], object]
"""A function that fills the scene. If what it returns has a method `run`, it never returns."""


def open_page(address: str) -> None:
    """Open a page in the browser of the user, if there is a display."""
    names = ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY")
    # Without a display, a browser for the terminal would take the terminal over.
    if sys.platform != "linux" or any(map(os.environ.get, names)):
        # Some browsers return only when they are closed.
        threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()


def wait() -> None:
    """Wait until a signal ends the command."""
    while True:
        time.sleep(1.0)


def source_kind(source: str, *, policy: bool = False) -> Kind:
    """Return what a source is: an existing file or folder, or the name of a robot or policy.

    Raises:
        ConfigError: if it is none of these.
    """
    from terrainkit_robots.description import bundled
    from terrainkit_robots.description.robot_file import is_description
    from terrainkit_robots.rl.run import RUN_FILE
    from terrainkit_robots.rl.tasks import task_names
    from terrainkit_robots.spec.robot_arrays import SPEC_FILE

    path = Path(source)
    try:
        if is_map(path):
            return "map"
        if policy or (path / RUN_FILE).is_file() or path.suffix == ".pt":
            return "run"
        if path.is_file() or (path / SPEC_FILE).is_file():
            return "robot"
        is_folder = path.is_dir()
    except OSError as error:
        raise ConfigError(f"cannot read {truncate(source)}: {error.strerror}") from error
    if is_folder:
        raise ConfigError(f"{source}: got no {SPEC_FILE} or {RUN_FILE} in it; expected either")
    if source in bundled.robot_names() or is_description(source):
        return "robot"
    if source in task_names():
        return "run"
    names = sorted({*bundled.robot_names(), *task_names()})
    known = expected_names(source, names, "bundled are")
    raise ConfigError(f"no map, robot or run {truncate(source)}; {known}")
