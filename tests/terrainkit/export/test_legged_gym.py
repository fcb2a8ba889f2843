import ast
import importlib.util
import json
import subprocess
import sys
from dataclasses import replace
from functools import cache
from types import ModuleType, SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError
from terrainkit.export.legged_gym import MODULE, corner_heights, x_edges
from tests.frameworks.pythons import find_python

CORNER = np.array([2.0, 2.0, 0.0])
"""Distance of the first patch from the corner of the maps of these tests [m]."""


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

    def run(terrain_map, name="terrain"):
        path = terrain_map.save(tmp_path / f"{name}.py", overwrite=True)
        spec = importlib.util.spec_from_file_location(name, path)
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


def one_friction(terrain_map):
    friction = np.full(len(terrain_map.solids), np.nan, np.float32)
    return replace(terrain_map, solids=replace(terrain_map.solids, friction=friction))


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


@pytest.mark.parametrize("version", ["3.6", "3.8"])
def test_module_runs_with_python_of_isaac_gym(tmp_path, version):
    python = find_python(version, "numpy")
    if python is None:
        pytest.skip(f"no Python {version} with numpy on PATH or in pyenv")
    make_map("parkour").save(tmp_path / "terrain.py")
    code = (
        "import json, terrain, types\n"
        "cfg = types.SimpleNamespace(mesh_type='trimesh', vertical_scale=0.005,\n"
        "                            max_init_terrain_level=5, num_goals=1)\n"
        "found = terrain.Terrain(cfg, 16)\n"
        "sums = [int(found.heightsamples.sum()), int(found.x_edge_mask.sum()),\n"
        "        float(found.env_origins.sum()), float(found.goals.sum())]\n"
        "print(json.dumps([found.vertices.shape, found.heightsamples.shape, sums]))"
    )
    run = subprocess.run([python, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert not run.stderr
    vertices, samples, sums = json.loads(run.stdout)
    sys.path.insert(0, str(tmp_path))
    try:
        expected = importlib.import_module("terrain").Terrain(make_cfg(num_goals=1))
    finally:
        sys.path.remove(str(tmp_path))
        del sys.modules["terrain"]
    assert tuple(vertices) == expected.vertices.shape
    assert tuple(samples) == expected.heightsamples.shape
    assert sums == pytest.approx(
        [
            getattr(expected, name).sum(dtype=float)
            for name in ("heightsamples", "x_edge_mask", "env_origins", "goals")
        ]
    )


@pytest.mark.parametrize("centered", [False, True])
def test_terrain_starts_at_world_origin_of_legged_gym(load, centered):
    terrain_map, cfg = make_map("parkour", centered), make_cfg()
    terrain = load(terrain_map).Terrain(cfg, 16)
    # LeggedRobot shifts the mesh by -border_size, and nothing else.
    vertices = terrain.vertices - [cfg.border_size, cfg.border_size, 0]
    assert vertices[:, :2].min(axis=0) == pytest.approx([-2.0, -2.0], abs=1e-5)
    assert vertices[:, :2].max(axis=0) == pytest.approx([26.0, 44.0], abs=1e-4)
    offset = np.array([*terrain_map.grid.lower, 0.0]) + CORNER
    np.testing.assert_allclose(vertices + offset, terrain_map.mesh().vertices, atol=1e-4)
    np.testing.assert_allclose(terrain.env_origins + offset, terrain_map.env_origins, atol=1e-5)
    assert (terrain.vertices.dtype, terrain.triangles.dtype) == (np.float32, np.uint32)
    assert (terrain.terrain_type == terrain_map.terrain_types).all()


@pytest.mark.parametrize(("preset", "share"), [("stairs", 0.98), ("parkour", 0.98)])
def test_terrain_heights_are_those_of_the_highest_surface(load, preset, share):
    terrain_map = make_map(preset)
    terrain = load(terrain_map).Terrain(make_cfg())
    xy = np.random.default_rng(0).uniform([0, 0], [24, 42], (5000, 2))
    expected = terrain_map.scan(np.column_stack([xy, np.full(len(xy), 50.0)]))
    error = np.abs(measured_heights(terrain, xy) - expected)
    assert (error < 0.02).mean() > share
    assert terrain.heightsamples.shape == (terrain.tot_rows, terrain.tot_cols) == (281, 461)


def test_terrain_mesh_is_aligned_in_leggedgym_ex(load, ray_down):
    """LeggedGym-Ex shifts the mesh by -border_size and by half a cell."""
    terrain_map = make_map("stairs")
    mesh = load(terrain_map).Terrain(make_cfg()).terrain_mesh
    mesh.apply_translation([-2.05, -2.05, 0.0])
    xy = np.random.default_rng(0).uniform([0, 0], [24, 42], (50, 2))
    found = ray_down(mesh.vertices, mesh.faces, xy)
    assert (np.abs(found - terrain_map.height(xy)) < 1e-3).mean() > 0.95


def test_terrain_sets_layout_and_friction_of_config(load):
    cfg = make_cfg("heightfield", horizontal_scale=0.05, num_rows=10)
    terrain = load(make_map("stairs")).Terrain(cfg)
    assert (cfg.num_rows, cfg.num_cols, cfg.border_size, cfg.horizontal_scale) == (3, 7, 2.0, 0.1)
    assert (cfg.terrain_length, cfg.terrain_width, cfg.num_sub_terrains) == (8.0, 6.0, 21)
    assert cfg.max_init_terrain_level == 2
    assert (cfg.static_friction, cfg.restitution) == (1.0, 0.0)
    assert (terrain.length_per_env_pixels, terrain.width_per_env_pixels) == (80, 60)
    assert (terrain.env_length, terrain.env_width, terrain.border) == (8.0, 6.0, 20)


def test_terrain_has_goals_of_extreme_parkour(load):
    terrain_map, cfg = make_map("parkour"), make_cfg(num_goals=8)
    terrain = load(terrain_map).Terrain(cfg, 16)
    assert terrain.goals.shape == (3, 7, cfg.num_goals, 3)
    assert np.isfinite(terrain.goals).all()
    goals = terrain_map.patch(1, 2).goals[:, :3]
    np.testing.assert_allclose(terrain.goals[1, 2, : len(goals)], goals, atol=1e-5)
    np.testing.assert_allclose(terrain.goals[1, 2, -1], goals[-1], atol=1e-5)


def test_corner_heights_by_hand():
    heights = np.array([[0.0, 1.0], [2.0, 3.0]])
    assert corner_heights(heights).tolist() == [[0, 1, 1], [2, 3, 3], [2, 3, 3]]


def test_x_edges_are_widened_along_x(load):
    heights = np.zeros((10, 3))
    heights[5:, 0] = 0.5
    edges = x_edges(heights, 0.1)
    assert np.argwhere(edges).tolist() == [[5, 0], [5, 1]]
    widened = load(make_map("stairs"))._widened(edges, 2)
    assert widened[:, 0].nonzero()[0].tolist() == [3, 4, 5, 6, 7]
    assert not widened[:, 2:].any()


@pytest.mark.usefixtures("gymapi")
def test_add_trimesh_passes_flat_buffers(load):
    gym, terrain_map = MagicMock(), make_map("parkour")
    load(terrain_map).add_trimesh(gym, 0)
    (_, vertices, triangles, params), _ = gym.add_triangle_mesh.call_args
    assert (vertices.dtype, triangles.dtype) == (np.float32, np.uint32)
    assert len(vertices) == 3 * params.nb_vertices == 3 * len(terrain_map.mesh().vertices)
    assert len(triangles) == 3 * params.nb_triangles
    assert (params.static_friction, params.restitution) == (1.0, 0.0)


@pytest.mark.usefixtures("gymapi")
def test_add_heightfield_has_columns_along_x(load):
    gym, terrain_map = MagicMock(), make_map("stairs")
    load(terrain_map).add_heightfield(gym, 0, vertical_scale=0.001)
    (_, buffer, params), _ = gym.add_heightfield.call_args
    # Sample (row, column) is at column * nbRows + row, a corner of up to four cells.
    column, row = np.divmod(np.arange(0, len(buffer), 37), params.nbRows)
    x = params.transform.p.x + column * params.column_scale
    y = params.transform.p.y + row * params.row_scale
    around = [
        np.clip(np.column_stack([x + dx, y + dy]), -1.99, [25.99, 43.99])
        for dx in (-0.05, 0.05)
        for dy in (-0.05, 0.05)
    ]
    expected = np.max([terrain_map.height(xy) for xy in around], axis=0)
    assert buffer[::37] * params.vertical_scale == pytest.approx(expected, abs=0.0006)


@pytest.mark.usefixtures("gymapi")
def test_heightfield_has_no_solids(load):
    module = load(make_map("parkour"))
    with pytest.raises(ValueError, match=r"heightfield with .* solids; expected a triangle mesh"):
        module.add_heightfield(MagicMock(), 0)
    with pytest.raises(ValueError, match=r"heightfield with .* solids; expected a triangle mesh"):
        module.Terrain(make_cfg("heightfield"))


def test_terrain_rejects_config_that_does_not_fit(load):
    module = load(make_map("stairs"))
    with pytest.raises(ValueError, match="got plane; expected trimesh or heightfield"):
        module.Terrain(make_cfg("plane"))
    with pytest.raises(ValueError, match=r"got none in patch \(0, 0\); expected goals in every"):
        module.Terrain(make_cfg(num_goals=8))
    with pytest.raises(ValueError, match=r"vertical_scale: got 1e-05; expected at least "):
        module.int16_heights(np.ones(3), 1e-5)


def test_export_rejects_what_isaac_gym_cannot_represent(solid_map, tmp_path):
    path = tmp_path / "terrain.py"
    with pytest.raises(ExportError, match="several friction coefficients"):
        solid_map.save(path)
    with pytest.raises(ExportError, match="2 solids that only collide or are only visible"):
        one_friction(solid_map).save(path)
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
    terrain_map.save(tmp_path / "terrain.py")
    with pytest.raises(ExportError, match=r"terrain\.py exists"):
        terrain_map.save(tmp_path / "terrain.py")
    terrain_map.save(tmp_path / "terrain.py", overwrite=True)
