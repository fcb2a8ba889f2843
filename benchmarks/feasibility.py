"""Time of the feasibility of maps, relative to generating their heights."""

from collections.abc import Iterator
from functools import partial

from clock import cpu_ratio

import terrainkit
from terrainkit.feasibility import assess_map
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.simulation.robot_limits import derive_limits

FLAT = (terrainkit.SubTerrain(terrain="flat"),)


def run() -> Iterator[tuple[str, float]]:
    limits = derive_limits(get_task("quadruped").folder).limits
    for name, config, num_runs in (
        ("default (at most 150)", terrainkit.MapConfig(), 3),
        ("buildings (at most 250)", terrainkit.MapConfig(preset="indoor", rows=1, cols=5), 2),
        ("flat (at most 1.5)", terrainkit.MapConfig(terrains=FLAT, rows=60, cols=60), 2),
    ):
        assess = partial(assess_map, terrainkit.generate(config), limits)
        generate = partial(terrainkit.generate, config)
        yield f"{name.replace(' ', '_over_heights ', 1)}", cpu_ratio(assess, generate, num_runs)
