import ast
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

import terrainkit as tk

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs/integrations.md").read_text()
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


def test_blocks_are_counted_and_import_what_the_adapters_define():
    assert len(BLOCKS) == 20, "add a test of the new block, and count it here"
    for text in ("gs.init", "MapJoystick"):  # tests/frameworks runs these two
        assert len(re.findall(r".+", block(text))) <= 25
    imports = re.findall(r"^from (terrainkit\.integrations\.\w+) import (.+)$", PAGE, re.MULTILINE)
    assert len(imports) == 8, "count the import of the new adapter here"
    for module, names in imports:
        path = ROOT / f"{module.replace('.', '/')}.py"
        defined = {getattr(node, "name", "") for node in ast.parse(path.read_text()).body}
        assert set(names.split(", ")) <= defined, module


def run_block(text):
    """Run the block that contains a text, and return its names."""
    names = {}
    exec(block(text), names)
    return names


def test_numpy_block_reads_map(m):
    names = run_block("import numpy")
    assert names["name"] == "stepping_stones"
    assert m.height(names["spawn"][:2]) == pytest.approx(names["spawn"][2], abs=1e-3)
    assert names["x"][0] == pytest.approx(m.first_sample[0])


def test_mujoco_block_drops_ball(m):
    names = run_block("add_freejoint")
    x, y, z = names["data"].qpos[:3]
    assert z - 0.1 == pytest.approx(m.height([x, y]), abs=0.01)  # the ball, 0.1 m, lies on it


def test_isaaclab_page_imports_mesh(m, monkeypatch):
    m.save("scan.stl")
    page = (ROOT / "docs/isaaclab.md").read_text()
    code = re.search(r"```python\n(.*?)```", page, re.DOTALL)[1]
    assert len(code.splitlines()) <= 5
    adapter = SimpleNamespace(terrain_importer_cfg=tk.TerrainMap.load)
    monkeypatch.setitem(sys.modules, "terrainkit.integrations.isaaclab", adapter)
    env_cfg = SimpleNamespace(scene=SimpleNamespace())
    exec(code, {"env_cfg": env_cfg})
    found = env_cfg.scene.terrain
    xy = m.env_origins[:, :, :2].reshape(-1, 2)
    np.testing.assert_allclose(found.height(xy), m.height(xy), atol=1e-3)


@pytest.mark.usefixtures("m")
def test_mujoco_adapter_block_adds_map_to_robot():
    Path("my_robot").mkdir()
    Path("my_robot/robot.xml").write_text("<mujoco><worldbody><body/></worldbody></mujoco>")
    names = run_block("add_map(spec")
    assert names["model"].ngeom > 0


def test_import_block_restores_map(m):
    corner = np.array([*m.grid.center, 0.0])
    mesh = trimesh.Trimesh(m.mesh().vertices - corner, m.mesh().triangles, process=False)
    generator = SimpleNamespace(terrain_mesh=mesh, terrain_origins=m.env_origins - corner)
    cfg = SimpleNamespace(size=m.config.patch_size, border_width=m.config.border)
    exec(block("generator.terrain_mesh"), {"generator": generator, "cfg": cfg})
    found = tk.TerrainMap.load("isaaclab.npz")
    np.testing.assert_allclose(found.heights, m.heights, atol=1e-4)
    assert np.abs(found.env_origins - (m.env_origins - corner)).max() < 0.1


def test_gymnasium_block_runs_map(m):
    names = run_block("import gymnasium\n")
    assert names["env"].env.terrain.terrain_map.grid == m.grid
    assert names["observations"].shape[0] == 16
    assert np.isfinite(names["observations"]).all()


def test_stable_baselines3_block_trains_on_map(m):
    pytest.importorskip("stable_baselines3")  # `make integrations` installs it
    names = run_block("import PPO")
    assert names["env"].env.env.terrain.terrain_map.grid == m.grid
    assert names["model"].num_timesteps == 64 * 24
