"""The command suite: fixed maps on which policies are compared."""

import textwrap
from dataclasses import dataclass
from typing import Annotated, Literal

from terrainkit import suites
from terrainkit.errors import ConfigError
from terrainkit.map.map_config import MapConfig
from terrainkit.terrain.parameter import format_value
from terrainkit.terrain.sub_terrain import SubTerrain
from terrainkit_cli import render
from terrainkit_cli.argument_types import OutputPath
from terrainkit_cli.map_text import written
from terrainkit_cli.parse import Command, positional


@dataclass(frozen=True, kw_only=True)
class Suite(Command):
    """List, show or generate suites: fixed maps to compare policies.

    A suite has a version and the SHA-256 of its content, and never changes. Its rows are levels,
    and its columns are tests.
    """

    action: Annotated[Literal["list", "show", "generate"], positional("ACTION")]
    """list: the names of all suites. show: the tests of a suite, their dimensions and the hash.
    generate: write the map, and verify the hash."""

    name: Annotated[str, positional("[NAME]")] = ""
    """Name of the suite, for show and generate."""

    output: OutputPath | None = None
    """For generate: file to write. The suffix selects the format, as in `terrainkit generate`."""

    overwrite: bool = False
    """For generate: replace an existing file."""

    def run(self) -> int:
        """List, show or generate."""
        if self.action != "generate":
            for name, given in (("output", self.output), ("overwrite", self.overwrite)):
                if given:
                    raise ConfigError(f"--{name}: got suite {self.action}; expected suite generate")
        if self.action == "list":
            if self.name:
                expected = "expected no name (suite show NAME)"
                raise ConfigError(f"suite list: got {self.name!r}; {expected}")
            configs = {name: suites.get_suite(name).config for name in suites.suite_names()}
            render.table([(name, _summary(config)) for name, config in configs.items()])
            return 0
        suite = suites.get_suite(self.name)
        if self.action == "show":
            _show(suite)
        else:
            self._generate(suite)
        return 0

    def _generate(self, suite: suites.Suite) -> None:
        from terrainkit import export

        if not self.output:
            raise ConfigError("--output: missing; expected a file, whose suffix selects the format")
        x, y = suite.config.grid.shape
        export.check_export(self.output, x * y, overwrite=self.overwrite)  # before generating
        terrain_map = suites.generate_suite(suite.name, progress=render.progress)
        files = export.export_files(terrain_map, self.output, overwrite=self.overwrite)
        render.result(written(terrain_map, *files))
        render.result(f"verified: SHA-256 {suite.sha256}")


def _summary(config: MapConfig) -> str:
    x, y = config.patch_size
    return f"{config.cols} tests, {config.rows} levels, patches of {x:g} m x {y:g} m"


def _show(suite: suites.Suite) -> None:
    config = suite.config
    render.result(f"{suite.name}: {_summary(config)}, cell {config.cell:g} m, seed {config.seed}")
    render.result(f"SHA-256 {suite.sha256}\n")
    for sub_terrain in config.sub_terrains:
        text = f"{_title(sub_terrain)}: {', '.join(_dimensions(sub_terrain))}"
        render.result(textwrap.fill(text, 88, subsequent_indent="    ", break_on_hyphens=False))
    render.result("\nA range is from the first to the last level.")
    render.result(f"`terrainkit list {config.sub_terrains[0].terrain}` explains the parameters.")


def _title(sub_terrain: SubTerrain) -> str:
    name, terrain = sub_terrain.name, sub_terrain.terrain
    return name if name == terrain else f"{name} ({terrain})"


def _dimensions(sub_terrain: SubTerrain) -> list[str]:
    """Return the parameters at the first and the last level; parameters that change come first."""
    first, last = sub_terrain.at(0.0), sub_terrain.at(1.0)
    ranges: list[str] = []
    values: list[str] = []
    for name in first.requested():
        easy, hard = (format_value(terrain.requested()[name]) for terrain in (first, last))
        (values if easy == hard else ranges).append(
            f"{name} {easy}" if easy == hard else f"{name} {easy} to {hard}"
        )
    return [*ranges, *values]
