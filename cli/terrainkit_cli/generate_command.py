"""The command that generates maps."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from shlex import quote
from typing import Annotated, Any

from terrainkit.errors import ConfigError
from terrainkit.export.npz import read_config
from terrainkit.map.map_config import MapConfig
from terrainkit.terrain import registry
from terrainkit.terrain.overlay import Overlay
from terrainkit.terrain.parameter import Parameter, parameters_of
from terrainkit.terrain.sub_terrain import SubTerrain
from terrainkit.terrain.worker_pool import worker_pool
from terrainkit_cli import render
from terrainkit_cli.argument_types import Jobs, Limits, OutputPath, RobotName, is_map
from terrainkit_cli.config_options import ConfigCommand
from terrainkit_cli.map_text import written
from terrainkit_cli.parse import option, value_of
from terrainkit_cli.plugin_command import PluginCommand


@dataclass(frozen=True, kw_only=True)
class Generate(PluginCommand, ConfigCommand):
    """Generate a map of terrain patches and write it to a file.

    Rows of patches are difficulty levels, columns are terrains. --config, --terrain and --preset
    select the terrains; --rows and the options after it override the map config.
    """

    defaults: MapConfig

    output: OutputPath
    """File to write. The suffix selects the format: .npz for a complete map, which the other
    commands read, or one of `terrainkit export`, such as .xml (MuJoCo), for other programs."""

    config: Annotated[str, option("FILE")] = ""
    """Map config (.toml), or a map (.npz) whose config is used; options override it."""

    terrain: Annotated[str, option("NAME")] = ""
    """Use only this terrain, not a preset; `terrainkit list` prints the names."""

    set: Annotated[str, option("NAME=VALUE,...")] = ""
    """Parameters of --terrain: NAME=VALUE, NAME=EASY:HARD for a range over the difficulty, or
    NAME=[X,Y,...] for a tuple."""

    overlay: Annotated[tuple[str, ...], option("[NAME[:PARAMETER=VALUE,...] ...]")] = ()
    """Overlays on all terrains, in their order, such as `noise:amplitude=0:0.05 side_walls`;
    `terrainkit list` prints the names."""

    robot: RobotName = ""
    """With --demand: name of a bundled robot, or a folder written by terrainkit onboard."""

    demand: Annotated[str, option("LOW:HIGH")] = ""
    """Replace the ranges of each terrain, so that they demand LOW to HIGH of --robot: 0 is level
    ground, 1 the limit of the robot; see terrainkit feasibility."""

    limit: Limits = ()
    """Limits that replace the robot's, such as `step_up=0.2 gap=0.4`. Without --robot, the
    limits that are not given come from the bundled quadruped."""

    jobs: Jobs = 1
    """Number of processes that build patches; the map does not depend on it. Processes start in a
    second, and sending a patch takes 0.2 ms: they help on large maps of slower patches."""

    mesh: bool = True
    """For .npz: write the triangle mesh. It is most of a large file, and
    terrainkit.TerrainMap.mesh() builds it when it is needed."""

    overwrite: bool = False
    """Replace an existing file."""

    @classmethod
    def default_config(cls) -> MapConfig:
        """Return the default config."""
        return MapConfig()

    @classmethod
    def load_config(cls, argv: Sequence[str]) -> MapConfig:
        """Return the config in the file of --config, or the default one."""
        path = cls.split(argv)[0].get("config", "")
        if is_map(path):
            return read_config(path)
        return MapConfig.load(path) if path else MapConfig()

    def run(self) -> int:
        """Generate the map, write it, and print the next commands."""
        from terrainkit import export
        from terrainkit.map.generation import generate
        from terrainkit_cli.feasibility_command import solve_demand

        config = self.changed_config()
        options = {} if self.mesh else {"mesh": False}
        if options and not is_map(self.output):
            raise ConfigError(f"--no-mesh: got {self.output}; expected a .npz file")
        samples = config.grid.shape[0] * config.grid.shape[1] if self.mesh else 0
        # Fail before generating.
        export.check_export(self.output, samples, rows=config.rows, overwrite=self.overwrite)
        if bool(self.robot or self.limit) != bool(self.demand):
            raise ConfigError(
                "--robot, --demand, --limit: expected --demand together with --robot or --limit"
            )
        with worker_pool(self.jobs) as executor:
            if self.demand:
                config = solve_demand(config, self.robot, self.limit, self.demand, executor)
            terrain_map = generate(config, progress=render.progress, executor=executor)
        files = export.export_files(terrain_map, self.output, overwrite=self.overwrite, **options)
        render.result(written(terrain_map, *files))
        if is_map(self.output):
            path = quote(str(self.output))
            render.result(
                f"next: terrainkit preview {path} -o preview.png  (render it)\n"
                f"      terrainkit export {path} -o map.xml  (MuJoCo; or .stl, .ply, ...)\n"
                f"      terrainkit.TerrainMap.load({str(self.output)!r})  (Python; or numpy.load)"
            )
        return 0

    def changed_config(self) -> Any:
        """Return the config with the values, terrain and overlays on the command line."""
        values = dict(self.changes)
        if self.terrain and "preset" in values:
            raise ConfigError("--terrain, --preset: got both; expected one of them")
        if self.set and not self.terrain:
            raise ConfigError("--set: got parameters without a terrain; expected --terrain")
        if self.terrain:
            terrain = registry.get_terrain(self.terrain)
            parameters = _parameters("--set", self.set, terrain)
            values["terrains"] = (SubTerrain(terrain=self.terrain, parameters=parameters),)
        elif "preset" in values:
            values["terrains"] = ()
        config = replace(self.defaults, **values)
        overlays = tuple(map(_overlay, self.overlay))
        if not overlays:
            return config
        terrains = (replace(old, overlays=old.overlays + overlays) for old in config.sub_terrains)
        return replace(config, terrains=tuple(terrains))


def _overlay(text: str) -> Overlay:
    """Return the overlay that NAME:PARAMETER=VALUE,... describes."""
    name, _, values = text.partition(":")
    parameters = _parameters("--overlay", values, registry.get_overlay(name))
    return registry.make_overlay(name, parameters)


def _parameters(option: str, text: str, owner: Any) -> dict[str, Any]:
    """Return the values in NAME=VALUE,... of parameters of a terrain or overlay."""
    parameters: dict[str, Any] = {}
    known = parameters_of(owner)
    for word in re.split(r",(?![^\[]*\])", text) if text else []:  # not in [1, 2]
        name, equals, value = word.partition("=")
        name = name.strip()
        if not equals:
            raise ConfigError(f"{option}: got {word!r}; expected name=value or name=easy:hard")
        if name in parameters:
            raise ConfigError(f"{option}: got {name} twice; expected it once")
        parameters[name] = _parameter_value(value, known.get(name))
    return parameters


def _parameter_value(text: str, parameter: Parameter | None) -> Any:
    """Return the value or range that `text` describes."""
    if parameter and (text in parameter.choices or isinstance(parameter.easy, str)):
        return text
    if text.startswith("[") and text.endswith("]"):
        return tuple(value_of(part.strip()) for part in text[1:-1].split(","))
    values = tuple(value_of(part) for part in text.split(":"))
    return values if len(values) > 1 else values[0]
