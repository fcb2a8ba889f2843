"""The command that writes maps and policies for others to read."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from terrainkit.errors import ConfigError, listing
from terrainkit.terrain_map import TerrainMap
from terrainkit_cli import render
from terrainkit_cli.parse import Command
from terrainkit_cli.robot_options import NO_NUMBER, Checkpoint, number_given, plain
from terrainkit_cli.terrain_commands import written

if TYPE_CHECKING:
    from terrainkit_robots.policy.export import Exported


@dataclass(frozen=True, kw_only=True)
class Export(Command):
    """Write a map for others (.xml for MuJoCo, .stl, .ply, .obj, .glb, .png), or a trained policy.

    A map, of a file in .npz, is written in the format that the suffix of --output names.

    A policy is that of a run: a folder that terrainkit train wrote, a checkpoint in one, or the
    name of a robot whose policy is shipped. It is written to a folder as policy.onnx, policy.pt
    for TorchScript, and policy.json, which holds the order and the scales of observations, the
    default pose, gains, limits, and the order of joints. What is written is asked on observations
    of a rollout, and has to answer as the checkpoint does.
    """

    subject: Annotated[
        str,
        tyro.conf.Positional,
        tyro.conf.arg(metavar="MAP.npz|RUN", help_behavior_hint=""),
    ] = ""
    """The map, or the run."""

    output: Annotated[str, plain("PATH", "-o")] = ""
    """Where to write. Of a map, a file, whose suffix names the format. Of a policy, a folder;
    unless given, `exported` in the folder of the run, or ROBOT_policy here for a shipped one."""

    collision: Annotated[
        Literal["auto", "hfield", "boxes"] | None,
        tyro.conf.arg(metavar="{auto,hfield,boxes}", help_behavior_hint="(default: auto)"),
    ] = None
    """For .xml: one heightfield, or boxes with vertical walls where the ground is level. auto takes
    boxes where they hold all of the ground and are few."""

    full: bool = False
    """For meshes: two triangles for every cell, instead of joining coplanar faces."""

    closed: bool = False
    """For meshes: add a skirt and a bottom, for a watertight solid."""

    y_up: bool = False
    """For meshes: turn the map so that y is up, as glTF viewers and game engines expect."""

    checkpoint: Checkpoint = NO_NUMBER
    """Of a run: the checkpoint to take."""

    overwrite: bool = False
    """Replace existing files."""

    def run(self) -> int:
        """Write what the subject is."""
        if not self.subject:
            raise ConfigError("nothing to export; wanted a map (.npz), a run, or a robot's name")
        if is_run(self.subject):
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
        }
        return {name: value for name, value in given.items() if value is not None}

    def _export_map(self) -> None:
        if self.checkpoint != NO_NUMBER:
            raise ConfigError(f"{self.subject} is a map; --checkpoint is for runs")
        terrain_map = TerrainMap.load(self.subject)
        if not self.output:
            raise ConfigError(
                f"{self.subject} is a map; wanted --output FILE, whose suffix names the format"
            )
        output = Path(self.output)
        terrain_map.save(output, overwrite=self.overwrite, **self._map_options())
        render.result(written(terrain_map, output))
        if output.suffix == ".xml" and "<hfield" in output.read_text():
            render.result(
                "on its heightfield, walls lean over one cell; "
                "--collision boxes keeps them vertical where the ground is level"
            )

    def _export_policy(self) -> None:
        if options := self._map_options():
            name = next(iter(options)).replace("_", "-")
            raise ConfigError(f"{self.subject} is no map; --{name} is for maps")
        from terrainkit_cli.training_extra import require_training

        require_training()
        from terrainkit_robots.policy.export import export_policy
        from terrainkit_robots.rl.run import is_shipped, open_run

        run = open_run(self.subject, number_given(self.checkpoint))
        own = Path(f"{run.folder.name}_policy") if is_shipped(run) else run.folder / "exported"
        folder = Path(self.output) if self.output else own
        done = export_policy(run, folder, overwrite=self.overwrite)
        _tell(done, run.checkpoint)


def is_run(subject: str) -> bool:
    """Return whether a subject is a training run, rather than a map.

    Raises:
        ConfigError: if it is neither, saying what exists.
    """
    path = Path(subject)
    try:
        if path.suffix == ".npz":
            return False
        if path.is_dir() or path.suffix == ".pt":
            return True
        if path.exists():
            return False
    except OSError as error:
        raise ConfigError(f"cannot read {subject}: {error.strerror or error}") from error
    from terrainkit_robots.rl import registry

    if subject not in registry.names():
        raise ConfigError(
            f"no map, run or robot {subject}; wanted a map (.npz), a folder that terrainkit train "
            f"wrote, a checkpoint in one, or one of: {listing(registry.names())}"
        )
    return True


def _tell(done: "Exported", checkpoint: Path | None) -> None:
    """Say what was written, and how well it was checked."""
    render.result(
        f"wrote {', '.join(map(str, done.files))}: from {done.observations} observations to "
        f"{done.actions} actions, of {checkpoint.name if checkpoint else 'no checkpoint'}"
    )
    render.result(
        f"checked: policy.pt answers as the checkpoint does, to {done.error:.1e}"
        + ("" if done.onnx_error is None else f"; policy.onnx to {done.onnx_error:.1e}")
    )
    if done.onnx_error is None:
        render.note("policy.onnx was not checked: onnxruntime is not installed")
