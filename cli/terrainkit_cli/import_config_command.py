"""The command import-config: a configuration class of legged_gym becomes settings of a training."""

from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Annotated

from terrainkit.errors import listing
from terrainkit_cli import render
from terrainkit_cli.argument_types import OutputPath, RobotName
from terrainkit_cli.parse import Command, option, positional


@dataclass(frozen=True, kw_only=True)
class ImportConfig(Command):
    """Import a training configuration of legged_gym or LeggedGym-Ex.

    The class LeggedRobotCfg of a robot and its class PPO become task.toml, robot.toml and map.toml.
    The file is read, never executed; parent classes come from the files of its project. Settings
    that have no counterpart are listed with the reason.
    """

    file: Annotated[Path, positional("FILE.py")]
    """Python file with the class."""

    output: OutputPath
    """Folder to write."""

    class_name: Annotated[str, option("NAME", "--class")] = ""
    """Name of the class, if the file has several."""

    robot: RobotName = ""
    """Folder of the robot, written by terrainkit onboard. With it, robot.toml is complete, and
    masses in kg, parts of names of bodies and shares of joint limits are translated."""

    overwrite: bool = False
    """Replace existing files."""

    def run(self) -> int:
        """Import the configuration, and print what is not taken."""
        from terrainkit_robots.rl.import_config import import_config, write_config
        from terrainkit_robots.rl.run import MAP_FILE
        from terrainkit_robots.rl.tasks import get_task
        from terrainkit_robots.spec.robot_arrays import Robot

        robot = Robot.load(get_task(self.robot).folder) if self.robot else None
        imported = import_config(self.file, self.output, self.class_name, robot)
        write_config(imported, self.output, overwrite=self.overwrite)
        counts = [len(imported.taken), len(imported.without_effect), len(imported.listed)]
        render.result(
            f"{imported.name}: {counts[0]} of {sum(counts)} settings taken; {counts[1]} make no "
            f"difference here; {counts[2]} not taken{':' if imported.listed else ''}"
        )
        for reason in dict.fromkeys(imported.listed.values()):
            keys = (key for key, other in imported.listed.items() if other == reason)
            render.result(f"  {', '.join(keys)}: {reason}")
        folder = quote(str(self.output))
        render.result(f"wrote {folder}: {listing(imported.files)}")
        on_plane = imported.taken.get("terrain.mesh_type", ("", "plane"))[1] == "plane"
        has_map = MAP_FILE in imported.files and not on_plane
        terrain = f" --terrain {folder}/{MAP_FILE}" if has_map else ""
        trained = folder if robot else "ROBOT"
        render.result(f"next: terrainkit train {trained} --config {folder}/task.toml{terrain}")
        return 0
