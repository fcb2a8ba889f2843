"""The command that exports maps and policies."""

from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Annotated, Literal

from terrainkit.errors import ConfigError
from terrainkit.export import export_files
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.settings.text import expected_names, truncate
from terrainkit_cli import render
from terrainkit_cli.argument_types import (
    Checkpoint,
    OutputPath,
    TaskFile,
    is_map,
    parse_range,
)
from terrainkit_cli.map_text import written
from terrainkit_cli.parse import option, positional
from terrainkit_cli.plugin_command import PluginCommand


@dataclass(frozen=True, kw_only=True)
class Export(PluginCommand):
    """Export a map to other formats, or a policy to ONNX.

    A map (.npz) is written as .xml (MuJoCo), .usd, .sdf (Gazebo), .yaml (ROS), .stl, .ply, .obj,
    .glb, .png or .py (legged_gym, LeggedGym-Ex, Isaac Gym): the suffix of --output selects the
    format. Some formats also write files beside it: .sdf its meshes (.stl), .png its scale (.json),
    .yaml an occupancy image and an image of the heights, and .py its arrays (.npz).

    A policy is exported from a run: a folder written by terrainkit train, a checkpoint in one, or
    the name of a robot with a bundled policy. The output folder contains policy.onnx, policy.pt
    (TorchScript), robot.xml (MJCF) with its meshes, and policy.json. The latter describes the
    observations and their scales, the default pose, gains, limits, and the order of the joints;
    policy.onnx also has it in its metadata, with the keys of mjlab. The exported policies are
    verified against the checkpoint.
    """

    source: Annotated[str, positional("MAP.npz|RUN")] = ""
    """The map or the run."""

    output: OutputPath | None = None
    """For a map: the file to write. For a policy: the folder to write, by default `exported` in
    the folder of the run, or ROBOT_policy for a bundled policy."""

    collision: (
        Annotated[Literal["auto", "hfield", "boxes"], option("{auto,hfield,boxes}")] | None
    ) = None
    """For .xml: export the terrain as one heightfield, or as boxes, whose walls are vertical. auto,
    the default, selects boxes if they cover the whole terrain and are few (see terrainkit info
    --budget)."""

    full: bool = False
    """For meshes: write two triangles per cell instead of merging coplanar faces."""

    closed: bool = False
    """For meshes: add a skirt and a bottom, for a watertight solid."""

    y_up: bool = False
    """For .stl, .ply and .obj: rotate the map so that y is up, as game engines expect; .glb always
    has y up."""

    height_band: Annotated[str, option("LOW:HIGH")] = ""
    """For .yaml: heights above the ground at which walls, furniture and edges make a cell occupied,
    by default 0.2:1.0 [m]: the largest step and the height of the robot."""

    task: TaskFile | None = None
    """For a run: a Python file with a task of your own, which it was
    trained with; it is executed."""

    checkpoint: Checkpoint | None = None
    """For a run: the checkpoint to export; by default, the last one."""

    example: bool = False
    """For a run: also write run_policy.py, a program that runs the policy in plain MuJoCo."""

    deploy_yaml: bool = False
    """For a run: also write deploy.yaml, the description that Unitree's controllers read."""

    overwrite: bool = False
    """Replace existing files."""

    def run(self) -> int:
        """Export the map or the policy."""
        if not self.source:
            raise ConfigError(
                "MAP.npz or RUN: missing; expected a map, a run, or the name of a robot"
            )
        if is_run(self.source):
            self._export_policy()
        else:
            self._export_map()
        return 0

    def _map_options(self) -> dict[str, object]:
        given = {
            "collision": self.collision,
            "full": self.full or None,
            "closed": self.closed or None,
            "y_up": self.y_up or None,
            "height_band": self.height_band
            and parse_range("--height-band", self.height_band, "0.1:1.0"),
        }
        return {name: value for name, value in given.items() if value not in (None, "")}

    def _export_map(self) -> None:
        for name in ("checkpoint", "example", "deploy-yaml"):
            if getattr(self, name.replace("-", "_")) not in (None, False):
                raise ConfigError(f"--{name}: got the map {self.source}; expected a run")
        terrain_map = TerrainMap.load(self.source)
        if not self.output:
            raise ConfigError("--output: missing; expected a file, whose suffix selects the format")
        files = export_files(
            terrain_map, self.output, overwrite=self.overwrite, **self._map_options()
        )
        render.result(written(terrain_map, *files))
        is_auto = self.collision in (None, "auto")
        if self.output.suffix == ".xml" and is_auto and "<hfield" in self.output.read_text():
            render.result(
                "the terrain is a heightfield, whose walls are one cell wide; "
                "with --collision boxes, walls are vertical where the terrain is level"
            )

    def _export_policy(self) -> None:
        if options := self._map_options():
            name = next(iter(options)).replace("_", "-")
            raise ConfigError(f"--{name}: got the run {self.source}; expected a map")
        from terrainkit_cli.training_extra import require_training

        require_training("onnx", "onnxruntime")
        from terrainkit_robots.policy.export import export_policy
        from terrainkit_robots.rl.run import open_run
        from terrainkit_robots.rl.tasks import get_task

        run = open_run(self.source, self.checkpoint, self.task)
        default = run.folder / "exported"
        if run.folder.resolve() == get_task(run.info.robot).trained_run.resolve():
            # The folder of a bundled policy is part of an installed package.
            default = Path(f"{run.folder.name}_policy")
        folder = self.output or default
        result = export_policy(
            run,
            folder,
            example=self.example,
            deploy_yaml=self.deploy_yaml,
            overwrite=self.overwrite,
        )
        render.result(
            f"wrote {', '.join(map(str, result.files))}: {result.num_observations} observations "
            f"to {result.num_actions} actions, from {run.policy_name}"
        )
        errors = zip(result.files, result.errors, strict=False)
        differences = ", ".join(f"{file.name} {error:.1e}" for file, error in errors)
        render.result(f"verified: largest difference from the checkpoint: {differences}")
        for note in result.notes:
            render.result(note)
        if self.example:
            render.result(f"next: python {quote(str(result.files[-1]))} --vx 0.5 --viewer")


def is_run(source: str) -> bool:
    """Return whether a source is a run or a robot, and not a map.

    Raises:
        ConfigError: if it is none of them.
    """
    path = Path(source)
    try:
        if is_map(path):
            return False
        if path.is_dir() or path.suffix == ".pt":
            return True
        if path.exists():
            return False
    except OSError as error:
        raise ConfigError(f"cannot read {source}: {error.strerror or error}") from error
    from terrainkit_robots.rl import tasks

    if source not in tasks.task_names():
        known = expected_names(source, tasks.task_names(), "robots are")
        raise ConfigError(f"no map, run or robot {truncate(source)}; {known}")
    return True
