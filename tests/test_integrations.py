import re
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pytest
import trimesh

import terrainkit as tk

PAGE = (Path(__file__).parent.parent / "docs/integrations.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def block(text):
    (found,) = (each for each in BLOCKS if text in each)
    return found


@pytest.fixture
def m(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    terrain_map = tk.generate(tk.MapConfig(rows=4, cols=10, patch_size=(8.0, 6.0), border=1.0))
    terrain_map.save("map.npz")
    terrain_map.save("map.xml")
    return terrain_map


def test_integrations_all_blocks_are_tested():
    assert len(BLOCKS) == 9


def test_numpy_block_reads_map(m):
    names = {}
    exec(block("import numpy"), names)
    assert names["name"] == "stepping_stones"
    assert m.height(names["spawn"][:2]) == pytest.approx(names["spawn"][2], abs=1e-3)
    assert names["x"][0] == pytest.approx(m.first_sample[0])


def test_mujoco_block_drops_ball(m):
    names = {}
    exec(block("import mujoco"), names)
    x, y, z = names["data"].qpos[:3]
    assert z - 0.1 == pytest.approx(m.height([x, y]), abs=0.01)  # the ball, 0.1 m, lies on it


def test_isaac_gym_trimesh_block(m):
    gym, gymapi = MagicMock(), SimpleNamespace(TriangleMeshParams=SimpleNamespace)
    exec(block("TriangleMeshParams"), {"m": m, "gym": gym, "sim": 0, "gymapi": gymapi})
    (_, vertices, triangles, params), _ = gym.add_triangle_mesh.call_args
    assert (vertices.dtype, triangles.dtype) == (np.float32, np.uint32)
    assert (vertices.ndim, triangles.ndim) == (1, 1)
    assert len(vertices) == 3 * params.nb_vertices
    assert len(triangles) == 3 * params.nb_triangles


def test_isaac_gym_heightfield_block(m):
    gym, params = MagicMock(), SimpleNamespace(transform=SimpleNamespace(p=SimpleNamespace()))
    gymapi = SimpleNamespace(HeightFieldParams=lambda: params)
    exec(block("HeightFieldParams"), {"m": m, "gym": gym, "sim": 0, "gymapi": gymapi})
    (_, buffer, params), _ = gym.add_heightfield.call_args
    # "Column-major order", say its docs: sample (row, column) is at column * nbRows + row.
    column, row = np.divmod(np.arange(0, len(buffer), 37), params.nbRows)
    x = params.transform.p.x + column * params.column_scale
    y = params.transform.p.y + row * params.row_scale
    found = buffer[::37] * params.vertical_scale
    assert found == pytest.approx(m.height(np.column_stack([x, y])), abs=0.0026)


def test_isaac_lab_block(m):
    names = {"m": m, "trimesh": trimesh}
    names |= dict.fromkeys(("TerrainGeneratorCfg", "TerrainImporterCfg"), SimpleNamespace)
    exec(block("class FromMap"), names)
    generator = names["terrain"].terrain_generator
    made = generator.class_type(cfg=generator, device="cpu")
    assert made.terrain_mesh.bounds[:, :2] == pytest.approx(np.array([m.grid.lower, m.grid.upper]))
    assert made.terrain_origins.shape == (4, 10, 3)
    assert (generator.num_rows, generator.num_cols, generator.border_width) == (4, 10, 1.0)


def test_genesis_block(m):
    gs, scene = MagicMock(), MagicMock()
    exec(block("gs.morphs.Terrain"), {"m": m, "gs": gs, "scene": scene})
    given = gs.morphs.Terrain.call_args.kwargs
    # Genesis puts height_field[i, j] at pos + (i, j) * horizontal_scale.
    x, y = np.array(given["pos"][:2]) + np.array([5, 9]) * given["horizontal_scale"]
    assert given["height_field"][5, 9] * given["vertical_scale"] == pytest.approx(m.height([x, y]))


# MuJoCo warns that a model attached without a prefix cannot be saved; mjlab does not save it.
@pytest.mark.filterwarnings("ignore:Attaching a spec with an empty prefix")
def test_mjlab_block(m):
    cfg = SimpleNamespace(scene=SimpleNamespace(), events={})
    names = {"m": m, "mujoco": mujoco, "cfg": cfg}
    classes = ("TerrainEntityCfg", "TerrainGeneratorCfg", "EventTermCfg")
    names |= dict.fromkeys(classes, SimpleNamespace)
    exec(block("spec_fn = add_map"), names)
    spec = mujoco.MjSpec()  # mjlab's plane: a body and a geom called terrain
    spec.worldbody.add_body(name="terrain").add_geom(
        name="terrain", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1]
    )
    cfg.scene.spec_fn(spec)
    model = spec.compile()
    assert model.body("terrain").geomnum[0] > 0
    assert mujoco.mjtGeom.mjGEOM_PLANE not in model.geom_type
    env = MagicMock()
    cfg.events["origins"].func(env, None)
    (origins,), _ = env.scene.terrain.configure_env_origins.call_args
    assert origins.shape == (*m.difficulty.shape, 3)
    assert np.shares_memory(origins, m.spawns)
    generator = cfg.scene.terrain.terrain_generator
    assert generator.size == m.config.patch_size
    assert tuple(generator.sub_terrains) == m.terrain_names


def test_legged_gym_block_is_in_world_coordinates(m):
    names = {"m": m, "np": np}
    exec(block("class MapTerrain"), names)
    cfg = SimpleNamespace(mesh_type="trimesh", vertical_scale=0.005)
    terrain = names["MapTerrain"](cfg, 16)
    # LeggedRobot shifts the mesh by -border_size along x and y.
    shifted = terrain.vertices - np.array([cfg.border_size, cfg.border_size, 0])
    np.testing.assert_allclose(shifted, m.mesh().vertices, atol=1e-5)
    assert terrain.heightsamples.shape == (terrain.tot_rows, terrain.tot_cols) == m.heights.shape
    np.testing.assert_allclose(terrain.heightsamples * 0.005, m.heights, atol=0.0026)
    assert (cfg.num_rows, cfg.num_cols) == terrain.env_origins.shape[:2]
