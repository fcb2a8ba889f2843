"""Boxes of the default map: number, covered share of the ground, and relative time."""

from collections.abc import Iterator

from clock import ratio

import terrainkit


def run() -> Iterator[tuple[str, float]]:
    config = terrainkit.MapConfig()
    terrain_map = terrainkit.generate(config)
    cover = terrain_map.boxes()
    yield "count", len(cover.centers)
    yield "share_of_ground", float(cover.covered.mean())
    yield "time_over_heights", ratio(terrain_map.boxes, lambda: terrainkit.generate(config), 3)
