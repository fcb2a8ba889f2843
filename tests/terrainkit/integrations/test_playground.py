from unittest.mock import MagicMock

import mujoco
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError

ROBOT = """<mujoco><worldbody><body pos="0 0 {z}"><freejoint/>
  <geom name="foot" type="sphere" size="0.05"/></body></worldbody></mujoco>"""
SCENE = """<mujoco><include file="robot.xml"/>
  <worldbody><geom name="block" type="box" size="1 1 1" pos="0 0 -9"/>{floor}</worldbody>
  <sensor><contact name="found" geom1="foot" geom2="floor" num="1" data="found"/></sensor>
</mujoco>"""


@pytest.mark.parametrize("num_contacts", [5, 8])
def test_playground_scene_has_the_map_as_floor(load_adapter, tmp_path, num_contacts):
    adapter = load_adapter("playground", {"jax": MagicMock(numpy=np)})
    rough = tk.SubTerrain(terrain="rough")
    m = tk.generate(
        tk.MapConfig(rows=1, cols=2, patch_size=(8.0, 6.0), border=1.0, terrains=(rough,))
    )
    scene = tmp_path / "scene.xml"
    scene.write_text(SCENE.format(floor='<geom name="floor" type="plane" size="1 1 1"/>'))
    assets = {"robot.xml": ROBOT.format(z=m.env_origins[0, 0, 2] + 0.04).encode()}
    options = {} if num_contacts == 8 else {"num_contacts": num_contacts}
    path = adapter.write_scene(scene, m, tmp_path / "map.xml", assets=assets, **options)
    model = mujoco.MjModel.from_xml_path(path)
    assert model.geom("floor").type not in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_BOX)
    for name in ("max_contact_points", "max_geom_pairs"):
        assert model.numeric(name).data == num_contacts
    data = mujoco.MjData(model)
    for height, found in ((0.0, True), (0.5, False)):
        data.qpos[:3] = m.env_origins[0, 0] + [0, 0, height + 0.04]
        mujoco.mj_forward(model, data)
        assert (data.sensor("found").data > 0) == found
    np.testing.assert_array_equal(adapter.env_origins(m), m.env_origins)
    scene.write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(ExportError, match="no geom 'floor'"):
        adapter.write_scene(scene, m, tmp_path / "map.xml")
