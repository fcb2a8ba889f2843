import mujoco
import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ExportError
from terrainkit.integrations.mujoco import NearGeoms, add_map

_STAIRS = SubTerrain(terrain="pyramid_stairs", parameters={"step_height": 0.1})


@pytest.fixture(scope="module")
def stairs():
    return generate(MapConfig(rows=5, cols=5, patch_size=(6.0, 6.0), terrains=(_STAIRS,)))


def ball_on(terrain_map):
    """Return the specification of a ball above the first patch."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    add_map(spec, terrain_map, collision="boxes")
    ball = spec.worldbody.add_body(name="ball", pos=terrain_map.env_origins[0, 0] + [0, 0, 0.2])
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.15, 0, 0])
    return spec


def rolled(model, update=None):
    """Return the positions of a ball that rolls down the stairs."""
    data, found = mujoco.MjData(model), []
    data.qvel[:2] = 2.0, 0.7
    for _ in range(150):
        if update:
            update(data.qpos[None, :2])
        mujoco.mj_step(model, data, nstep=10)
        found.append(data.qpos[:3].copy())
    return np.array(found)


def test_a_ball_rolls_as_on_all_geoms(stairs):
    spec = ball_on(stairs)
    near = NearGeoms(spec, base="ball")
    model = spec.compile()
    assert near.is_active
    assert near.num_near * 8 <= near.num_geoms
    assert model.ngeom == near.num_near + 2  # the ball, and the plane, which stays
    every = rolled(ball_on(stairs).compile())
    assert np.ptp(every[:, 0]) > 2  # it reached other places
    np.testing.assert_allclose(rolled(model, near.bind(model)), every, atol=1e-9)


def test_one_model_per_robot(stairs):
    spec = ball_on(stairs)
    near = NearGeoms(spec)
    models = [spec.compile() for _ in range(2)]
    update = near.bind(models)
    places = stairs.env_origins[[0, 2], [0, 3], :2]
    update(places)
    first = models[0].geom("near_0").id
    for model, place in zip(models, places, strict=True):
        geoms = near.near(near.square(place))
        assert model.body_geomnum[0] == first + len(geoms)
        np.testing.assert_array_equal(
            model.geom_pos[first : first + len(geoms)], near.shapes["geom_pos"][geoms]
        )
    update(np.array([[500.0, 500.0], places[1]]))  # far outside of the map
    assert models[0].body_geomnum[0] == first


def test_geoms_that_are_added_later_are_named(stairs):
    spec = ball_on(stairs)
    near = NearGeoms(spec)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1, 0, 0])
    with pytest.raises(ExportError, match="expected those of NearGeoms last"):
        near.bind(spec.compile())


def test_a_model_without_a_free_joint_is_named(stairs):
    spec = mujoco.MjSpec()
    add_map(spec, stairs, collision="boxes")
    with pytest.raises(ExportError, match="got no free joint"):
        NearGeoms(spec)


def test_a_few_geoms_stay():
    spec = ball_on(generate(MapConfig(rows=1, cols=1, terrains=(_STAIRS,))))
    near = NearGeoms(spec)
    model = spec.compile()
    assert not near.is_active
    assert model.ngeom == near.num_geoms + 2
    near.bind(model)(np.zeros((1, 2)))
