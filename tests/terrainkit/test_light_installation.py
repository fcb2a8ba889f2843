"""terrainkit with numpy and msgspec alone: other packages cannot be imported here."""

import subprocess
import sys

import pytest

BLOCK = """
import sys, warnings
class Blocker:
    def find_spec(self, name, path=None, target=None):
        package = name.partition(".")[0]
        own = package.startswith("terrainkit")
        if not own and package not in {"numpy", "msgspec", *sys.stdlib_module_names}:
            raise ModuleNotFoundError(f"No module named {package!r}", name=package)
sys.meta_path.insert(0, Blocker())
warnings.simplefilter("ignore")
"""

HEIGHTS = """
import numpy as np
import terrainkit
from terrainkit.perception import HeightScan, RayCaster
terrainkit.generate(terrainkit.MapConfig(rows=2, cols=9, preset="isaaclab")).save("map.npz")
terrain_map = terrainkit.TerrainMap.load("map.npz")
x, y, z = terrain_map.env_origins[1, 3]
assert abs(terrain_map.height([x, y]) - z) < 1e-3
assignment = terrain_map.assign(64)
assert assignment.env_origins.shape == (64, 3)
assert HeightScan(terrain_map).below(assignment.env_origins, np.zeros(64)).shape == (64, 187)
above = [[x, y, z + 0.5]]
assert abs(RayCaster(terrain_map).cast(above, [[0.0, 0.0, -1.0]])[0] - 0.5) < 1e-3
"""

TERRAINS = """
import terrainkit
from terrainkit.terrain.registry import terrain_names
for name in terrain_names():
    terrains = (terrainkit.SubTerrain(terrain=name),)
    try:
        terrainkit.generate(terrainkit.MapConfig(rows=2, cols=1, terrains=terrains))
    except ModuleNotFoundError as error:
        assert error.name == "scipy"
        print(name)
"""

NEED_SCIPY = """
continuous_ramps
crossing_ramps
floating_islands
gutter
imported
road
rocks
side_ramps
sidewalk
spiral_stairs
street
"""
"""Terrains with convex hulls, graphs, or interpolation."""


def run(code, folder):
    command = [sys.executable, "-c", BLOCK + code]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_heights_scans_and_assignment(tmp_path):
    ended = run(HEIGHTS, tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_terrains_without_hulls(tmp_path):
    ended = run(TERRAINS, tmp_path)
    assert ended.stdout == NEED_SCIPY.lstrip()
    assert ended.returncode == 0


@pytest.mark.parametrize(
    ("words", "package"),
    [
        ("preview map.npz -o a.png", "opencv-python-headless"),
        ("export map.npz -o a.sdf", "scipy"),
        ("import map.xml -o b.npz", "lxml"),
        ("feasibility map.npz --robot quadruped", "mujoco"),
        ("completion bash", "argcomplete"),
    ],
)
def test_commands_name_the_missing_package(words, package, tmp_path):
    (tmp_path / "map.xml").write_text("<mujoco/>")
    code = f"""
from terrainkit_cli.main import main
assert main("generate --rows 2 --cols 9 -o map.npz".split()) == 0
sys.exit(main({words.split()}))
"""
    ended = run(code, tmp_path)
    assert ended.returncode == 2
    error = ended.stderr.splitlines()[-1]
    assert error == f"terrainkit: error: missing package: {package}; run: pip install {package}"
    assert {path.name for path in tmp_path.iterdir()} == {"map.npz", "map.xml"}
