"""Boxes of two presets: number, covered share of the ground, and time relative to the heights."""

from collections.abc import Iterator
from functools import partial

from clock import ratio

import terrainkit


def run() -> Iterator[tuple[str, float]]:
    for preset in ("legged_gym", "stairs"):
        config = terrainkit.MapConfig(preset=preset)
        terrain_map = terrainkit.generate(config)
        cover = terrain_map.boxes()
        yield f"{preset}_count", len(cover.centers)
        yield f"{preset}_share_of_ground", float(cover.box_mask.mean())
        yield (
            f"{preset}_time_over_heights (at most 5)",
            ratio(terrain_map.boxes, partial(terrainkit.generate, config)),
        )
