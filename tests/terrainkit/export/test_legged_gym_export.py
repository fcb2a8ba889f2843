import ast
import importlib.util
import sys
from dataclasses import replace
from functools import cache
from types import ModuleType, SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError
from terrainkit.export.legged_gym_export import MODULE, heights_at_corners, x_edges
from tests.frameworks.pages import page_block
from tests.tables import read_table


def make_cfg(mesh_type="trimesh", **values):
    return SimpleNamespace(
        mesh_type=mesh_type, vertical_scale=0.005, max_init_terrain_level=5, **values
    )


@cache
def make_map(preset, centered=False):
    return tk.generate(
        tk.MapConfig(
            rows=3, cols=7, patch_size=(8.0, 6.0), border=2.0, preset=preset, centered=centered
        )
    )


@pytest.fixture
def load(tmp_path):
    """Return a function that exports a map and returns the module."""

    def run(terrain_map):
        path = terrain_map.save(tmp_path / "terrain.py", overwrite=True)
        spec = importlib.util.spec_from_file_location("terrain", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return run


@pytest.fixture
def gymapi(monkeypatch):
    """A stand-in for Isaac Gym, which cannot be installed from a package index."""
    package = ModuleType("isaacgym")
    package.gymapi = SimpleNamespace(
        TriangleMeshParams=SimpleNamespace,
        HeightFieldParams=lambda: SimpleNamespace(transform=SimpleNamespace(p=SimpleNamespace())),
    )
    monkeypatch.setitem(sys.modules, "isaacgym", package)


def measured_heights(terrain, xy):
    """Return what `_get_heights` of legged_gym and LeggedGym-Ex reads at some points [m]."""
    cfg, samples = terrain.cfg, terrain.heightsamples
    i, j = ((xy + cfg.border_size) / cfg.horizontal_scale).astype(int).T
    lowest = np.minimum(np.minimum(samples[i, j], samples[i + 1, j]), samples[i, j + 1])
    return lowest * cfg.vertical_scale


def test_module_is_short_and_has_the_syntax_of_python_3_6():
    text = MODULE.read_text()
    ast.parse(text, feature_version=(3, 6))
    assert len(text.splitlines()) <= 150


@pytest.mark.parametrize("centered", [False, True])
def test_terrain_starts_at_world_origin_of_legged_gym(load, centered):
    terrain_map, cfg = make_map("parkour", centered), make_cfg()
    terrain = load(terrain_map).Terrain(cfg, 16)
    # LeggedRobot shifts the mesh by -border_size, and nothing else.
    vertices = terrain.vertices - [cfg.border_size, cfg.border_size, 0]
    assert vertices[:, :2].min(axis=0) == pytest.approx([-2.0, -2.0], abs=1e-5)
    assert vertices[:, :2].max(axis=0) == pytest.approx([26.0, 44.0], abs=1e-4)
    offset = np.add([*terrain_map.grid.lower, 0.0], [2, 2, 0])
    np.testing.assert_allclose(vertices + offset, terrain_map.mesh().vertices, atol=1e-4)
    np.testing.assert_allclose(terrain.env_origins + offset, terrain_map.env_origins, atol=1e-5)
    assert (terrain.vertices.dtype, terrain.triangles.dtype) == (np.float32, np.uint32)
    assert (terrain.terrain_type == terrain_map.terrain_types).all()


@pytest.mark.parametrize("preset", ["stairs", "parkour"])
def test_terrain_heights_are_those_of_the_highest_surface(load, preset):
    terrain_map = make_map(preset)
    terrain = load(terrain_map).Terrain(make_cfg())
    xy = np.random.default_rng(0).uniform([0, 0], [24, 42], (5000, 2))
    expected = terrain_map.scan(np.column_stack([xy, np.full(len(xy), 50.0)]))
    error = np.abs(measured_heights(terrain, xy) - expected)
    assert (error < 0.02).mean() > 0.98
    assert terrain.heightsamples.shape == (terrain.tot_rows, terrain.tot_cols) == (281, 461)


def test_terrain_mesh_is_aligned_in_leggedgym_ex(load):
    """LeggedGym-Ex shifts the mesh by -border_size and by half a cell."""
    terrain = load(make_map("stairs")).Terrain(make_cfg())
    vertices = terrain.terrain_mesh.vertices - [0.05, 0.05, 0]
    np.testing.assert_allclose(vertices, terrain.vertices, atol=1e-5)


def test_terrain_writes_layout_and_friction_into_the_config(load):
    cfg = make_cfg("heightfield", horizontal_scale=0.05, num_rows=10)
    terrain = load(make_map("stairs")).Terrain(cfg)
    assert vars(cfg) == read_table(__file__, "terrain_writes_layout_and_friction_into_the_config")
    assert (terrain.length_per_env_pixels, terrain.width_per_env_pixels) == (80, 60)
    assert (terrain.env_length, terrain.env_width, terrain.border) == (8.0, 6.0, 20)
    assert (terrain.type, terrain.num_robots) == ("heightfield", None)
    for kind in ("plane", "none"):
        plane = make_cfg(kind)
        assert load(make_map("stairs")).Terrain(plane).type == kind
        assert vars(plane) == vars(make_cfg(kind))


def test_terrain_has_goals_of_extreme_parkour(load):
    terrain_map, cfg = make_map("parkour"), make_cfg(num_goals=99)
    terrain = load(terrain_map).Terrain(cfg, 16)
    number = terrain_map.goals.shape[2]
    assert cfg.num_goals == terrain.num_goals == number
    for row, col in np.ndindex(3, 7):
        goals = terrain_map.patch(row, col).goals[:, :3]
        padded = np.concatenate([goals, np.repeat(goals[-1:], number - len(goals), axis=0)])
        np.testing.assert_allclose(terrain.goals[row, col], padded, atol=1e-5)
    assert not hasattr(load(terrain_map).Terrain(make_cfg()), "goals")


def test_heights_at_corners_by_hand():
    heights = np.array([[0.0, 1.0], [2.0, 3.0]])
    assert heights_at_corners(heights).tolist() == [[0, 1, 1], [2, 3, 3], [2, 3, 3]]


def test_x_edges_are_widened_along_x(load):
    heights = np.zeros((10, 3))
    heights[5:, 0] = 0.5
    edges = x_edges(heights, 0.4)
    assert np.argwhere(edges).tolist() == [[5, 0], [5, 1]]
    assert not x_edges(heights, 0.5).any()  # no higher than a wall
    module = load(make_map("stairs"))
    assert np.argwhere(module._dilate(edges, 2)[:, :1])[:, 0].tolist() == [3, 4, 5, 6, 7]
    for cfg, width in ((make_cfg(), 0), (make_cfg(edge_width_thresh=0.2), 2)):
        expected = module._dilate(module.load()["x_edges"], width)
        np.testing.assert_array_equal(module.Terrain(cfg).x_edge_mask, expected)


def test_heights_are_units_that_fit_in_16_bits(load):
    module = load(make_map("stairs"))
    heights = np.array([0.0124, 0.0126, -0.0124, 163.835, -163.835])
    assert module.int16_heights(heights, 0.005).tolist() == [2, 3, -2, 32767, -32767]
    for height in (163.84, -163.84):
        with pytest.raises(ValueError, match=r"vertical_scale: got 0\.005; .* least 0\.00505$"):
            module.int16_heights(np.array([0.0, height]), 0.005)


@pytest.mark.usefixtures("gymapi")
def test_add_trimesh_passes_flat_buffers(load):
    gym, terrain_map = MagicMock(), make_map("parkour")
    load(terrain_map).add_trimesh(gym, "sim")
    (sim, vertices, triangles, params), _ = gym.add_triangle_mesh.call_args
    mesh = terrain_map.mesh()
    assert (sim, vertices.dtype, triangles.dtype) == ("sim", np.float32, np.uint32)
    assert vertices.tolist() == mesh.vertices.ravel().tolist()
    assert triangles.tolist() == mesh.triangles.ravel().tolist()
    assert vars(params) == {
        "nb_vertices": len(mesh.vertices),
        "nb_triangles": len(mesh.triangles),
        "static_friction": 1.0,
        "dynamic_friction": 1.0,
        "restitution": 0.0,
    }


@pytest.mark.usefixtures("gymapi")
def test_block_of_the_page_adds_both_surfaces_to_isaac_gym(load, monkeypatch):
    terrain_map = make_map("stairs")
    monkeypatch.setitem(sys.modules, "terrain", load(terrain_map))
    names = {"gym": MagicMock(), "sim": "sim"}
    exec(page_block("legged_gym.md", "add_trimesh"), names)
    names["gym"].add_triangle_mesh.assert_called_once()
    names["gym"].add_heightfield.assert_called_once()
    np.testing.assert_array_equal(names["origins"], terrain_map.env_origins)


@pytest.mark.usefixtures("gymapi")
def test_add_heightfield_has_columns_along_x(load):
    gym, terrain_map = MagicMock(), make_map("stairs")
    load(terrain_map).add_heightfield(gym, 0, vertical_scale=0.001)
    (_, buffer, params), _ = gym.add_heightfield.call_args
    # The corners of 3 x 80 and 7 x 60 cells and 2 x 20 of the border; y runs fastest.
    assert (params.nbColumns, params.nbRows) == (281, 461)
    assert (params.column_scale, params.row_scale, params.vertical_scale) == (0.1, 0.1, 0.001)
    assert (params.transform.p.x, params.transform.p.y) == (-2.0, -2.0)
    assert params.static_friction == 1.0
    expected = heights_at_corners(terrain_map.heights.astype(float)) / 0.001
    assert buffer.reshape(281, 461) == pytest.approx(expected, abs=0.51)


@pytest.mark.usefixtures("gymapi")
def test_heightfield_has_no_solids(load):
    module = load(make_map("parkour"))
    message = r"heightfield with .* solids; expected a triangle mesh"
    with pytest.raises(ValueError, match=message):
        module.add_heightfield(MagicMock(), 0)
    with pytest.raises(ValueError, match=message):
        module.Terrain(make_cfg("heightfield"))


def test_terrain_rejects_config_that_does_not_fit(load):
    module = load(make_map("stairs"))
    with pytest.raises(ValueError, match="got triangles; expected trimesh or heightfield"):
        module.Terrain(make_cfg("triangles"))
    with pytest.raises(ValueError, match=r"got none in patch \(0, 0\); expected goals in every"):
        module.Terrain(make_cfg(num_goals=8))


def test_export_rejects_what_isaac_gym_cannot_represent(solid_map, tmp_path):
    path, nan = tmp_path / "terrain.py", np.full(4, np.nan, np.float32)
    with pytest.raises(ExportError, match="several friction coefficients"):
        solid_map.save(path)
    with pytest.raises(ExportError, match="2 solids that only collide or are only visible"):
        replace(solid_map, solids=replace(solid_map.solids, friction=nan)).save(path)
    with pytest.raises(ExportError, match="got 'my-terrain'; expected a Python identifier"):
        make_map("stairs").save(tmp_path / "my-terrain.py")
    assert not list(tmp_path.iterdir())


def test_export_does_not_replace_a_map(tmp_path):
    terrain_map = make_map("stairs")
    source = terrain_map.save(tmp_path / "map.npz")
    before = source.read_bytes()
    with pytest.raises(ExportError, match=r"map\.npz is a map; use another name"):
        terrain_map.save(tmp_path / "map.py", overwrite=True)
    assert source.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["map.npz"]
