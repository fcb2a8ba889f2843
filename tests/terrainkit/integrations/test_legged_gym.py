from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError
from terrainkit.integrations.legged_gym import Terrain, edge_mask, padded_goals, top_heights


def make_cfg(**values):
    return SimpleNamespace(
        mesh_type="trimesh", vertical_scale=0.005, max_init_terrain_level=5, **values
    )


@cache
def make_map(preset, centered=False):
    return tk.generate(
        tk.MapConfig(
            rows=3, cols=7, patch_size=(8.0, 6.0), border=2.0, preset=preset, centered=centered
        )
    )


@pytest.mark.parametrize("centered", [False, True])
def test_terrain_starts_at_world_origin_of_legged_gym(centered):
    terrain_map, cfg = make_map("parkour", centered), make_cfg()
    terrain = Terrain(terrain_map, cfg, 16)
    # LeggedRobot shifts the mesh by -border_size, and nothing else.
    vertices = terrain.vertices - [cfg.border_size, cfg.border_size, 0]
    assert vertices[:, :2].min(axis=0) == pytest.approx([-2.0, -2.0], abs=1e-5)
    assert vertices[:, :2].max(axis=0) == pytest.approx([26.0, 44.0], abs=1e-4)
    offset = np.add([*terrain_map.grid.lower, 0.0], [2.0, 2.0, 0.0])
    np.testing.assert_allclose(vertices + offset, terrain_map.mesh().vertices, atol=1e-4)
    np.testing.assert_allclose(terrain.env_origins + offset, terrain_map.env_origins, atol=1e-5)


def test_terrain_samples_are_highest_surface():
    terrain_map, cfg = make_map("parkour"), make_cfg()
    terrain = Terrain(terrain_map, cfg, 16)
    # LeggedRobot reads sample (position + border_size) / horizontal_scale, rounded down.
    xy = np.random.default_rng(0).uniform([0, 0], [24, 42], (200, 2))
    i, j = ((xy + cfg.border_size) / cfg.horizontal_scale).astype(int).T
    x, y = terrain_map.grid.axis(0)[i], terrain_map.grid.axis(1)[j]
    expected = terrain_map.scan(np.column_stack([x, y, np.full(200, 50.0)]))
    np.testing.assert_allclose(terrain.heightsamples[i, j] * 0.005, expected, atol=0.0026)
    assert (top_heights(terrain_map) > terrain_map.heights + 0.1).any()
    assert terrain.heightsamples.shape == (terrain.tot_rows, terrain.tot_cols) == (280, 460)


def test_terrain_sets_layout_and_friction_of_config():
    cfg = make_cfg()
    Terrain(make_map("stairs"), cfg, 16)
    assert (cfg.num_rows, cfg.num_cols, cfg.border_size, cfg.horizontal_scale) == (3, 7, 2.0, 0.1)
    assert (cfg.terrain_length, cfg.terrain_width) == (8.0, 6.0)
    assert cfg.max_init_terrain_level == 2
    assert (cfg.static_friction, cfg.restitution) == (1.0, 0.0)


def test_terrain_has_goals_of_extreme_parkour():
    terrain_map, cfg = make_map("parkour"), make_cfg(num_goals=8)
    terrain = Terrain(terrain_map, cfg, 16)
    assert terrain.goals.shape == (3, 7, cfg.num_goals, 3)
    assert np.isfinite(terrain.goals).all()
    np.testing.assert_allclose(terrain.goals[0, 0, 0], terrain_map.goals[0, 0, 0, :3], atol=1e-5)
    last = terrain_map.patch(0, 0).goals[-1, :3]
    np.testing.assert_allclose(padded_goals(terrain_map)[0, 0, -1], last)


def test_edge_mask_by_hand():
    heights = np.zeros((10, 2))
    heights[5:, 0] = 0.5
    mask = edge_mask(heights, threshold=0.1, width=1)
    assert mask[:, 0].nonzero()[0].tolist() == [3, 4, 5, 6]
    assert not mask[:, 1].any()


def test_terrain_rejects_what_legged_gym_cannot_represent():
    slippery = tk.SubTerrain(terrain="flat", friction=0.2)
    with pytest.raises(ExportError, match="friction"):
        Terrain(tk.generate(tk.MapConfig(rows=1, cols=1, terrains=(slippery,))), make_cfg(), 1)
    with pytest.raises(tk.TerrainkitError, match="expected goals in every patch"):
        Terrain(make_map("stairs"), make_cfg(num_goals=8), 1)
    with pytest.raises(tk.TerrainkitError, match="expected 'trimesh'"):
        Terrain(make_map("parkour"), SimpleNamespace(mesh_type="heightfield"), 1)
