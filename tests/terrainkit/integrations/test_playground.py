import sys
from unittest.mock import MagicMock

import mujoco
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError
from terrainkit.terrain.sub_terrain import SubTerrain

ROBOT = """<mujoco><worldbody><body pos="0 0 {z}"><freejoint/>
  <geom name="foot" type="sphere" size="0.05"/></body></worldbody></mujoco>"""
SCENE = """<mujoco><include file="robot.xml"/>
  <worldbody>{floor}</worldbody>
  <sensor><contact name="found" geom1="foot" geom2="floor" num="1" data="found"/></sensor>
</mujoco>"""


@pytest.fixture
def write_scene(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", MagicMock())
    monkeypatch.delitem(sys.modules, "terrainkit.integrations.playground", raising=False)
    from terrainkit.integrations.playground import write_scene

    yield write_scene
    del sys.modules["terrainkit.integrations.playground"]


def test_write_scene_replaces_floor_and_senses_contact(write_scene, tmp_path):
    m = tk.generate(
        tk.MapConfig(
            rows=1,
            cols=2,
            patch_size=(8.0, 6.0),
            border=1.0,
            terrains=(SubTerrain(terrain="rough"),),
        )
    )
    scene = tmp_path / "scene.xml"
    scene.write_text(SCENE.format(floor='<geom name="floor" type="plane" size="1 1 1"/>'))
    assets = {"robot.xml": ROBOT.format(z=m.env_origins[0, 0, 2] + 0.04).encode()}
    path = write_scene(scene, m, tmp_path / "map.xml", assets=assets, num_contacts=5)
    model = mujoco.MjModel.from_xml_path(path)
    assert model.geom("floor").type != mujoco.mjtGeom.mjGEOM_PLANE
    assert model.numeric("max_contact_points").data == 5
    data = mujoco.MjData(model)
    data.qpos[:2] = m.env_origins[0, 0, :2]
    mujoco.mj_forward(model, data)
    assert data.sensor("found").data > 0
    data.qpos[2] += 0.5
    mujoco.mj_forward(model, data)
    assert data.sensor("found").data == 0


def test_write_scene_rejects_scene_without_floor(write_scene, tmp_path):
    scene = tmp_path / "scene.xml"
    scene.write_text("<mujoco><worldbody/></mujoco>")
    m = tk.generate(
        tk.MapConfig(rows=1, cols=1, border=1.0, terrains=(SubTerrain(terrain="flat"),))
    )
    with pytest.raises(ExportError, match="no geom 'floor'"):
        write_scene(scene, m, tmp_path / "map.xml")
