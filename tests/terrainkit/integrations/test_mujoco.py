import mujoco
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.integrations.mujoco import add_map, make_spec


@pytest.fixture(scope="module")
def parkour():
    config = tk.MapConfig(rows=2, cols=7, patch_size=(8.0, 6.0), border=1.0, preset="parkour")
    return tk.generate(config)


def test_make_spec_is_saved_model(parkour, tmp_path):
    path = parkour.save(tmp_path / "map.xml", collision="boxes")
    saved = mujoco.MjModel.from_xml_path(str(path))
    model = make_spec(parkour, collision="boxes").compile()
    np.testing.assert_array_equal(model.geom_pos, saved.geom_pos)
    np.testing.assert_array_equal(model.geom_size, saved.geom_size)


def test_add_map_supports_ball_on_ground_and_solids(parkour, tmp_path):
    path = parkour.save(tmp_path / "map.npz")
    spec = mujoco.MjSpec()
    ball = spec.worldbody.add_body(pos=parkour.env_origins[1, 2] + [0, 0, 0.3])
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0])
    add_map(spec, path, collision="boxes")
    model = spec.compile()
    assert model.nbody == 2  # all geoms belong to the world body
    assert model.ngeom > len(parkour.solids)
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    x, y, z = data.qpos[:3]
    assert z - 0.1 == pytest.approx(parkour.height([x, y]), abs=2e-3)


def test_make_spec_rejects_unknown_collision(parkour):
    with pytest.raises(tk.TerrainkitError, match="collision: got 'mesh'"):
        make_spec(parkour, collision="mesh")
