"""Time of the feasibility of the default map, relative to generating its heights."""

import warnings
from collections.abc import Iterator
from functools import partial

from clock import ratio

import terrainkit
from terrainkit.feasibility import RobotLimits, assess_map

LIMITS = RobotLimits(
    step_up=0.179,
    step_down=0.224,
    gap=0.314,
    slope=0.577,
    foothold=0.088,
    body_width=0.328,
    standing_height=0.402,
    crouched_height=0.223,
)
"""The limits of the bundled quadruped."""


def run() -> Iterator[tuple[str, float]]:
    warnings.simplefilter("ignore", terrainkit.TerrainkitWarning)  # cliffs, as expected
    config = terrainkit.MapConfig()
    terrain_map = terrainkit.generate(config)
    yield (
        "time_over_heights (at most 150)",
        ratio(
            partial(assess_map, terrain_map, LIMITS),
            partial(terrainkit.generate, config),
            5,
        ),
    )
