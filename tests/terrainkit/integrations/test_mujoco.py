import mujoco
import numpy as np
import pytest

import terrainkit as tk
from terrainkit.integrations.mujoco import add_map, make_spec, static_mesh
from tests.rays import cast_rays


@pytest.mark.parametrize("collision", ["boxes", "hfield"])
def test_specs_are_the_saved_model(tmp_path, collision):
    slippery = tk.SubTerrain(terrain="crawl", friction=(0.5, 0.25), proportion=2.0)
    terrains = (slippery, tk.SubTerrain(terrain="rough_slope"), tk.SubTerrain(terrain="rocks"))
    # Without a border, heightfields extend beyond the map.
    for border in (0.0, 1.0):
        size = {"rows": 2, "cols": 4, "patch_size": (8.0, 6.0), "border": border}
        terrain_map = tk.generate(tk.MapConfig(terrains=terrains, static_friction=0.8, **size))
        path = terrain_map.save(tmp_path / "map.xml", collision=collision, overwrite=True)
        saved = mujoco.MjModel.from_xml_path(str(path))
        robot = mujoco.MjSpec.from_string(
            "<mujoco><default><geom contype='0' margin='0.3'/><site group='2'/></default></mujoco>"
        )
        add_map(robot, terrain_map, collision=collision)
        for model in (make_spec(terrain_map, collision=collision).compile(), robot.compile()):
            assert model.nhfield == saved.nhfield > 0
            assert model.nmesh == saved.nmesh > 0 < saved.nsite
            np.testing.assert_array_equal(model.hfield_data, saved.hfield_data)
            for name in dir(saved):
                if name.startswith(("geom_", "site_", "hfield_", "numeric_")):
                    found, expected = getattr(model, name), getattr(saved, name)
                    np.testing.assert_allclose(found, expected, atol=2e-5, err_msg=name)


def test_add_map_supports_ball_on_ground_and_solids(parkour, parkour_path):
    spec = mujoco.MjSpec()
    ball = spec.worldbody.add_body(pos=parkour.env_origins[1, 2] + [0, 0, 0.3])
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0])
    add_map(spec, parkour_path, collision="boxes")
    model = spec.compile()
    assert model.nbody == 2  # all geoms belong to the world body
    assert model.ngeom > len(parkour.solids)
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    x, y, z = data.qpos[:3]
    assert z - 0.1 == pytest.approx(parkour.height([x, y]), abs=2e-3)


def test_static_mesh_is_hit_by_the_rays_of_mujoco(parkour):
    spec = make_spec(parkour, collision="hfield")
    shapes = mujoco.mjtGeom
    for k, kind in enumerate((shapes.mjGEOM_CYLINDER, shapes.mjGEOM_ELLIPSOID, shapes.mjGEOM_BOX)):
        quat = [0.9, 0.3, 0.2, 0.1]
        spec.worldbody.add_geom(type=kind, pos=[4 * k, 2, 1], quat=quat, size=[1, 1.5, 2])
    model = spec.compile()
    x, y = np.random.default_rng(0).uniform((0, 0), (16, 40), (300, 2)).T
    starts = np.column_stack([x, y, np.full(300, 9.0)])
    mesh = static_mesh(model)
    hits, rays, _ = mesh.ray.intersects_location(starts, np.tile([0.0, 0.0, -1.0], (300, 1)))
    highest = np.full(300, -np.inf)
    np.maximum.at(highest, rays, hits[:, 2])
    error = np.abs(highest - cast_rays(model, starts)[0])
    # The curved surfaces have facets, and a cell of a heightfield can be cut along either diagonal.
    assert np.median(error) < 1e-6
    assert np.quantile(error, 0.95) < 0.05


SHAPES = mujoco.mjtGeom


@pytest.mark.parametrize(
    ("kind", "size", "extents"),
    [
        (SHAPES.mjGEOM_BOX, [1, 2, 3], [2, 4, 6]),
        (SHAPES.mjGEOM_SPHERE, [1, 0, 0], [2, 2, 2]),
        (SHAPES.mjGEOM_ELLIPSOID, [1, 2, 3], [2, 4, 6]),
        (SHAPES.mjGEOM_CYLINDER, [1, 2, 0], [2, 2, 4]),
        (SHAPES.mjGEOM_CAPSULE, [1, 2, 0], [2, 2, 6]),
    ],
)
def test_static_mesh_has_the_size_of_a_static_geom(kind, size, extents):
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=kind, size=size, pos=[4, 5, 6])
    moving = spec.worldbody.add_body()
    moving.add_freejoint()
    moving.add_geom(type=SHAPES.mjGEOM_BOX, size=[9, 9, 9])
    mesh = static_mesh(spec.compile())
    np.testing.assert_allclose(mesh.extents, extents, rtol=0.01)
    np.testing.assert_allclose(mesh.bounds.mean(axis=0), [4, 5, 6], atol=0.01)


@pytest.mark.parametrize(
    ("kind", "message"),
    [(SHAPES.mjGEOM_PLANE, "static geom 0: got a plane; expected a"), (None, "geoms: got none")],
)
def test_static_mesh_rejects_models_without_a_surface(kind, message):
    spec = mujoco.MjSpec()
    if kind is not None:
        spec.worldbody.add_geom(type=kind, size=[1, 1, 1])
    with pytest.raises(tk.TerrainkitError, match=message):
        static_mesh(spec.compile())
