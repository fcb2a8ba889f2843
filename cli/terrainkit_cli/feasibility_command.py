"""The command that shows whether a robot can cross the patches of a map."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from terrainkit.errors import ConfigError
from terrainkit.map.layout import column_types
from terrainkit.map.map_config import MapConfig
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.terrain.worker_pool import worker_pool
from terrainkit_cli import render
from terrainkit_cli.argument_types import (
    Jobs,
    Limits,
    MapFile,
    OutputPath,
    RobotName,
    parse_pairs,
    parse_range,
)
from terrainkit_cli.parse import value_of
from terrainkit_cli.plugin_command import PluginCommand

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from terrainkit.feasibility import PatchFeasibility
    from terrainkit_robots.simulation.robot_limits import DerivedLimits

MAX_LISTED = 20
"""Patches that the command lists one by one."""

_DEFAULT_ROBOT = "quadruped"
"""The robot whose limits are used for those that are not given, without a robot."""


@dataclass(frozen=True, kw_only=True)
class Feasibility(PluginCommand):
    """Show whether a robot can cross each patch, and what blocks it.

    The demand of a patch is 0 on level ground and 1 at the limit of the robot. It is the largest
    ratio of a quantity, such as the height of a step, to its limit for the robot. It is computed on
    the least demanding path from the spawn origin through the goals or, without goals, to the far
    edge. The walking demand has the margins that walking policies need.

    Exit code 0: the robot can cross every patch. 1: a patch demands more than 1. 2: the input is
    invalid.
    """

    map: MapFile
    """The map, a file written by terrainkit generate or import."""

    robot: RobotName = ""
    """Name of a bundled robot, or a folder written by terrainkit onboard."""

    limit: Limits = ()
    """Limits that replace the robot's, such as `step_up=0.2 gap=0.4`. Without --robot, the
    limits that are not given come from the bundled quadruped."""

    output: OutputPath | None = None
    """Write PATH.json with all paths, and PATH.png with the paths on the preview."""

    jobs: Jobs = 1
    """Number of processes that assess patches; the results do not depend on it."""

    overwrite: bool = False
    """Replace existing files."""

    def run(self) -> int:
        """Print the limits, the demands and the blocking places; write the report."""
        from terrainkit.feasibility import assess_map
        from terrainkit.feasibility.report import demand_table
        from terrainkit.files.atomic_write import check_target

        derived = robot_limits(self.robot, self.limit)
        terrain_map = TerrainMap.load(self.map)
        target = self.output.with_suffix("") if self.output else None
        if target:
            for suffix in (".json", ".png"):
                check_target(target.with_suffix(suffix), overwrite=self.overwrite)
        with worker_pool(self.jobs) as executor:
            assess = partial(assess_map, terrain_map, progress=render.progress, executor=executor)
            results = assess(derived.limits)
            walking = assess(derived.limits.walking())
        render.result(f"{derived.robot}:")
        values = vars(derived.limits)
        render.table([(f"  {k}", f"{values[k]:.3g}", why) for k, why in derived.reasons.items()])
        render.result(
            "\nlargest demand of each terrain and level (1: limit; inf: over 2, no path):"
        )
        render.table(demand_table(results))
        render.result("\nlargest walking demand, with the margins that walking policies need:")
        render.table(demand_table(walking))
        if target:
            self._write(target, terrain_map, results, walking, derived)
        return print_impassable(results, derived, self.map)

    def _write(
        self,
        target: Path,
        terrain_map: TerrainMap,
        results: "Sequence[PatchFeasibility]",
        walking: "Sequence[PatchFeasibility]",
        derived: "DerivedLimits",
    ) -> None:
        from terrainkit import __version__
        from terrainkit.feasibility.report import routes, to_json
        from terrainkit.files.atomic_write import atomic_write
        from terrainkit.views.preview import write_preview

        about = {
            "tool": {"name": "terrainkit", "version": __version__},
            "map": str(self.map),
            "robot": derived.robot,
            "reasons": dict(derived.reasons),
        }
        path = target.with_suffix(".json")
        with atomic_write(path, overwrite=self.overwrite) as temporary:
            document = json.dumps(to_json(results, walking, derived.limits, **about))
            temporary.write_text(f"{document}\n", encoding="utf-8")
            write_preview(terrain_map, temporary.with_suffix(".png"), routes=routes(results))
        render.result(f"\nwrote {path} and {path.with_suffix('.png')}")


def robot_limits(robot: str, limits: Sequence[str]) -> "DerivedLimits":
    """Return the limits of a robot, overridden by --limit, or the limits that --limit describes.

    Raises:
        ConfigError: if there is neither a robot nor a limit, there is no such robot, it has no
            legs, or a limit is invalid.
    """
    from terrainkit.feasibility.crossing_limits import limit_overrides
    from terrainkit_robots.rl.tasks import get_task
    from terrainkit_robots.simulation.robot_limits import derive_limits

    if not robot and not limits:
        raise ConfigError(
            "--robot: missing; expected a bundled robot or an onboarded folder, such as --robot "
            f"{_DEFAULT_ROBOT}, or --limit, such as --limit step_up=0.2 gap=0.4"
        )
    values = parse_pairs("--limit", limits, "=", "NAME=VALUE, such as step_up=0.2")
    overrides = limit_overrides({name: value_of(text) for name, text in values.items()})
    derived = derive_limits(get_task(robot or _DEFAULT_ROBOT).folder, overrides)
    if robot:
        return derived
    reasons = {
        name: reason if name in overrides else f"not given; {_DEFAULT_ROBOT}: {reason}"
        for name, reason in derived.reasons.items()
    }
    return replace(derived, robot="the robot of --limit", reasons=reasons)


def solve_demand(
    config: MapConfig, robot: str, limits: Sequence[str], demand: str, executor: "Executor | None"
) -> MapConfig:
    """Return a map config whose terrains demand LOW:HIGH of a robot, and print the ranges.

    Raises:
        ConfigError: if the robot, a limit or the demand is invalid.
    """
    from terrainkit.feasibility.report import demand_text
    from terrainkit.feasibility.solve import solve_ranges

    ends = parse_range("--demand", demand, "0.2:0.9")
    derived = robot_limits(robot, limits)
    terrains, columns = config.sub_terrains, column_types(config)
    if config.mode != "randomized":  # sub-terrains of a preset without a column are not solved
        terrains = tuple(terrains[k] for k in dict.fromkeys(columns))
    config = replace(config, terrains=terrains)
    progress = partial(render.progress, of="terrains")
    solved = solve_ranges(config, derived.limits, ends, progress=progress, executor=executor)
    rows = [("terrain", "demand", f"ranges for {derived.robot}")]
    for terrain in solved:
        for indent, part in [("", terrain), *(("  ", element) for element in terrain.elements)]:
            ranges = [f"{name} {easy:g} to {hard:g}" for name, (easy, hard) in part.ranges.items()]
            what = ", ".join(ranges) or ("" if part.elements else "unchanged")
            span = " to ".join(map(demand_text, part.demand))
            rows.append((indent + part.sub_terrain.name, span, what))
    render.table(rows)
    render.result("")
    return replace(config, terrains=tuple(solution.sub_terrain for solution in solved))


def print_impassable(
    results: "Sequence[PatchFeasibility]", derived: "DerivedLimits", path: Path
) -> int:
    """Print how many patches of each terrain the robot can cross, and those that it cannot.

    Returns:
        1 if there are any that it cannot cross, else 0.
    """
    from terrainkit.feasibility.report import blocking_text, crossed_texts, demand_text

    render.result("")
    for text in crossed_texts(results):
        render.result(text)
    blocked = [patch for patch in results if not patch.is_passable]
    if not blocked:
        render.result(f"\n{path}: {derived.robot} can cross {_patches(len(results))}")
        return 0
    render.result("")
    for item in blocked[:MAX_LISTED]:
        render.result(
            f"patch ({item.row}, {item.col}), {item.terrain}: demand {demand_text(item.demand)}, "
            f"{blocking_text(item, derived.limits)}"
        )
    if len(blocked) > MAX_LISTED:
        render.result(f"and {len(blocked) - MAX_LISTED} more")
    count = f"{len(blocked)} of {_patches(len(results))}"
    render.result(f"\n{path}: {derived.robot} cannot cross {count}")
    return 1


def _patches(number: int) -> str:
    return f"{number} patch" if number == 1 else f"{number} patches"
