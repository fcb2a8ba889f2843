import tracemalloc

import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.geometry.mesh import full_mesh, merged_mesh

ROUGH = (SubTerrain(terrain="rough"),)


@pytest.mark.parametrize("build", [full_mesh, merged_mesh])
@pytest.mark.parametrize(
    "terrain",
    [{}, {"terrains": ROUGH}, {"terrains": ROUGH, "slope_threshold": 0.05}],
    ids=["default", "rough", "walls"],
)
def test_node_grid_estimates_the_memory_of_a_mesh(monkeypatch, build, terrain):
    terrain_map = generate(MapConfig(rows=5, cols=10, border=1.0, **terrain))
    estimates = []
    monkeypatch.setattr("terrainkit.geometry.mesh.row_buffer.MAX_GROWTH", 1 << 12)
    monkeypatch.setattr(
        "terrainkit.geometry.mesh.node_grid.check_memory",
        lambda needed, _: estimates.append(tracemalloc.get_traced_memory()[0] + needed),
    )
    tracemalloc.start()
    build(terrain_map.heights, terrain_map.grid, terrain_map.config.wall_threshold)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # Besides, blocks of constant size are built one after the other.
    assert peak - 10e6 <= max(estimates) <= 1.5 * peak
