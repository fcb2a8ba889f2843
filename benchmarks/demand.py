"""Rank correlation of a policy's success with the demand of patches, and with other measures.

The map has every terrain at five levels. The success of a patch is the fraction of the robots that
cross it, as in `terrainkit evaluate --suite`. Values are Spearman's correlations with the share of
failures, so that 1 is best.
"""

from collections.abc import Iterator

import numpy as np
from scipy.stats import spearmanr

import terrainkit
from terrainkit.feasibility import assess_map
from terrainkit.geometry.measured_difficulty import measured_difficulty
from terrainkit.terrain.presets import get_preset
from terrainkit_robots.policy.evaluate import EvaluationConfig
from terrainkit_robots.report_card.card import measure
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.simulation.robot_limits import derive_limits

_POLICIES, _ROWS, _REPETITIONS = ("quadruped", "quadruped_map"), 5, 4


def run() -> Iterator[tuple[str, float]]:
    cols = len(get_preset("all"))
    config = terrainkit.MapConfig(preset="all", rows=_ROWS, cols=cols, border=1.0)
    terrain_map = terrainkit.generate(config)
    limits = derive_limits(get_task("quadruped").folder).limits
    patches = [terrain_map.patch(*place) for place in np.ndindex(terrain_map.difficulty.shape)]
    measures = {
        "demand": [result.demand for result in assess_map(terrain_map, limits)],
        "difficulty": terrain_map.difficulty.ravel(),
        "measured_difficulty": [
            measured_difficulty(patch.heights, config.cell, float(patch.origin[2]))
            for patch in patches
        ],
    }
    yield "patches (at least 200)", len(patches)
    for policy in _POLICIES:
        card = measure(open_run(policy), terrain_map, "all", _REPETITIONS, EvaluationConfig())
        success = np.array([[level.success for level in test.levels] for test in card.tests]).T
        yield f"{policy}_success", success.mean()
        for name, values in measures.items():
            yield f"{policy}_{name}", spearmanr(values, 1 - success.ravel()).statistic
