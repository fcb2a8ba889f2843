"""Time of the feasibility of the default map, relative to generating its heights."""

from collections.abc import Iterator
from functools import partial

from clock import ratio

import terrainkit
from terrainkit.feasibility import assess_map
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.simulation.robot_limits import derive_limits


def run() -> Iterator[tuple[str, float]]:
    limits = derive_limits(get_task("quadruped").folder).limits
    config = terrainkit.MapConfig()
    terrain_map = terrainkit.generate(config)
    assess = partial(assess_map, terrain_map, limits)
    yield "time_over_heights (at most 150)", ratio(assess, lambda: terrainkit.generate(config), 5)
