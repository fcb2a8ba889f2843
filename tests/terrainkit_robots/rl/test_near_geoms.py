import mujoco
import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.integrations.near_geoms import reach
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.simulation import Simulation
from terrainkit_robots.rl.terrain import MapGround

_NUM = 12


_STAIRS = tuple(SubTerrain(terrain=name) for name in ("pyramid_stairs", "pit", "pyramid_slope"))
_CONFIGS = {  # with far more geoms than are near a robot
    "stairs": MapConfig(rows=6, cols=12, patch_size=(6.0, 6.0), border=1.0, terrains=_STAIRS),
    "street": MapConfig(rows=3, cols=8, border=1.0, preset="street"),  # boxes, cylinders and hulls
}


@pytest.fixture(scope="module", params=_CONFIGS)
def ground(request):
    return MapGround(generate(_CONFIGS[request.param]), "boxes")


@pytest.fixture(scope="module")
def scenes(quadruped, nominal_task, ground):
    return [Scene(quadruped, ground, nominal_task(_NUM), all_geoms=each) for each in (True, False)]


def walked(scene, ground, robot):
    """Return the positions of robots that slide over the patches."""
    sim, found = Simulation(scene, _NUM, 1), []
    qpos = np.tile(scene.default_qpos, (_NUM, 1))
    qpos[:, :3] = ground.env_origins.reshape(-1, 3)[:_NUM]
    qpos[:, 2] += robot.spawn_height
    sim.reset(np.arange(_NUM), qpos, np.zeros((_NUM, scene.model.nv)))
    for _ in range(60):
        sim.qvel[:, 0] = 1.5
        sim.step(4)
        found.append(sim.qpos.copy())
    return np.array(found)


def test_robots_move_as_on_all_geoms(scenes, ground, quadruped):
    whole, near = scenes
    assert whole.near_geoms is None
    assert near.model.ngeom < whole.model.ngeom - 40
    one, other = (walked(each, ground, quadruped) for each in scenes)
    assert np.ptp(one[:, :, 0], axis=0).min() > 1  # they reached other squares
    differ = np.abs(one - other).max(axis=2)
    # The order of contacts may differ, and with it the last bits.
    first = differ[(differ > 0).argmax(axis=0), np.arange(_NUM)]
    assert first.max() < 1e-12


def test_the_model_has_the_geoms_near_each_robot(scenes, ground):
    scene = scenes[1]
    near_geoms, sim = scene.near_geoms, Simulation(scene, 2, 1)
    sim.qpos[:, :2] = ground.env_origins[[0, 2], [0, 0], :2]
    places = sim.qpos[:, :2].copy()
    sim.step(1)
    assert near_geoms.num_near <= near_geoms.num_geoms / 8
    first, counts = scene.model.geom("near_0").id, sim.batch.expand("body_geomnum")[:, 0]
    for env, place in enumerate(places):
        near = near_geoms.near(near_geoms.square(place))
        assert counts[env] == first + len(near)
        for name, shapes in near_geoms.shapes.items():
            placed = sim.batch.expand(name)[env, first : counts[env]]
            np.testing.assert_array_equal(placed, shapes[near])


def test_few_geoms_stay(quadruped, nominal_task):
    config = MapConfig(rows=1, cols=2, terrains=(SubTerrain(terrain="pit"),), border=1.0)
    scene = Scene(quadruped, MapGround(generate(config), "boxes"), nominal_task(2))
    assert scene.near_geoms is None


def test_reach_bounds_the_robot_in_any_pose(scenes, quadruped):
    model, rng = scenes[0].model, np.random.default_rng(0)
    data, farthest = mujoco.MjData(model), 0.0
    for _ in range(50):
        data.qpos[:] = scenes[0].default_qpos
        data.qpos[scenes[0].joint_qpos] = rng.uniform(-np.pi, np.pi, len(quadruped.default_pose))
        mujoco.mj_kinematics(model, data)
        geoms = scenes[0].geoms
        distance = np.linalg.norm(data.geom_xpos[geoms] - data.qpos[:3], axis=1)
        farthest = max(farthest, float((distance + model.geom_rbound[geoms]).max()))
    assert 0.5 * reach(model, scenes[0].base) < farthest <= reach(model, scenes[0].base)
