"""Time of building the mesh of the default map, relative to copying its arrays."""

from collections.abc import Iterator

from clock import ratio

import terrainkit


def run() -> Iterator[tuple[str, float]]:
    terrain_map = terrainkit.generate(terrainkit.MapConfig())
    full, merged = terrain_map.mesh(merged=False), terrain_map.mesh()
    yield (
        "full_over_copy (at most 12)",
        ratio(
            lambda: terrain_map.mesh(merged=False),
            lambda: (full.vertices.copy(), full.triangles.copy()),
        ),
    )
    yield (
        "merged_over_full (at most 4)",
        ratio(terrain_map.mesh, lambda: terrain_map.mesh(merged=False)),
    )
    yield "merged_faces_over_full", len(merged.triangles) / len(full.triangles)
