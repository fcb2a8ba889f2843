import numpy as np
import pytest
import torch

from terrainkit import MapConfig, SubTerrain, generate
from terrainkit.errors import ConfigError
from terrainkit_robots.rl.config import Commands, Env, Terrain
from terrainkit_robots.rl.env_state import env_state, load_env_state
from terrainkit_robots.rl.stream_ground import StreamGround
from terrainkit_robots.rl.terrain import MapGround, Plane

_NUM = 5
_NAMES = ("pyramid_stairs", "rough", "boxes", "poles", "course")
_LANE = {"course": {"elements": [{"terrain": "flat"}, {"terrain": "flat"}]}}
_TERRAINS = tuple(SubTerrain(terrain=name, parameters=_LANE.get(name, {})) for name in _NAMES)
_CONFIG = MapConfig(rows=4, cols=_NUM, patch_size=(8.0, 6.0), border=1.0, terrains=_TERRAINS)


@pytest.fixture(scope="module")
def ground():
    return MapGround(generate(_CONFIG))


@pytest.fixture
def make_env(nominal_env, nominal_task, ground):
    def make(num_envs=_NUM, collision="hfield", **sections):
        sections["terrain"] = Terrain(stream=True, collision=collision)
        stream = StreamGround(ground, nominal_task(num_envs, **sections))
        return nominal_env(num_envs, stream, **sections)

    return make


def patch_map(env, robot):
    """Return the map that `generate` makes of the current patch of a robot."""
    ground = env.terrain
    chosen = int(ground.types[robot]), float(ground.difficulties[robot])
    return generate(ground.stream.map_config(robot, int(ground.episodes[robot]) - 1, *chosen))


@pytest.mark.filterwarnings("ignore::terrainkit.errors.TerrainkitWarning")  # of single patches
@pytest.mark.parametrize("collision", ["hfield", "boxes"])
def test_each_robot_has_its_new_patch(make_env, collision):
    env, rng = make_env(collision=collision), np.random.default_rng(0)
    ground, seeds = env.terrain, set()
    for episode in range(8):
        env.curriculum.levels[:] = episode // 2
        renewed = np.flatnonzero(rng.random(_NUM) < 0.6) if episode else np.arange(_NUM)
        env._reset_idx(renewed)
        start = env.sim.qpos[:, :3].copy()
        env.sim.step(1)  # gives each simulation the solids near its robot
        env.sim.qpos[:, 2] += 100  # out of the way of the rays
        points = start[:, None, :2] + rng.uniform(-0.8, 0.8, (_NUM, 150, 2))
        above = np.dstack([points, np.full(points.shape[:2], 20.0)])
        hit = 20 - env.sim.batch.ray(above, (0, 0, -1.0))[0]
        seen = ground.height(*np.moveaxis(points, 2, 0).astype(np.float32), scan=True)
        for robot in range(_NUM):
            terrain_map, offset = patch_map(env, robot), ground.offsets[robot]
            assert terrain_map.terrain_names == (_NAMES[robot],)
            if robot in renewed:
                seeds.add((terrain_map.config.seed, robot))
                assert episode // 2 / 4 <= ground.difficulties[robot] <= (episode // 2 + 1) / 4
                center = terrain_map.env_origins[0, 0, :2] + offset
                np.testing.assert_allclose(start[robot, :2], center, atol=1e-4)
            own = terrain_map.scan(above[robot] - [*offset, 0])
            # A heightfield has slopes for walls, and pixels of solids are 2.5 cm.
            differ = np.abs([hit[robot] - own, seen[robot] - own]) > 1e-3
            assert differ.mean(axis=1).max() < 0.12
            if _NAMES[robot] in ("rough", "pyramid_stairs" if collision == "boxes" else "rough"):
                assert not differ.any()
            goals = terrain_map.goals[0, 0] + [*offset, 0, 0]
            np.testing.assert_allclose(ground.goals[robot, 0, : len(goals)], goals, atol=1e-4)
            assert np.isnan(ground.goals[robot, 0, len(goals) :]).all()
        env.sim.qpos[:, 2] -= 100
    assert len(seeds) == ground.episodes.sum() - _NUM  # no patch came twice


def test_robots_stand_on_their_patches(make_env):
    for collision in ("hfield", "boxes"):
        env = make_env(collision=collision)
        env.set_commands(np.zeros((_NUM, 3), np.float32))
        for _ in range(25):
            dones = env.step(torch.zeros(_NUM, env.num_actions))[2]
            assert not dones.any()
        assert env.state.foot_contact.all()
        assert np.abs(env.state.foot_height).max() < 0.02


def test_episodes_end_beyond_the_patch_without_a_fall(make_env):
    env = make_env()
    env.sim.qpos[1, 0] = env.terrain.upper[1, 0] + 0.01
    env.sim.qpos[2, 0] = env.terrain.upper[2, 0] - 0.2
    before = env.terrain.episodes.tolist()
    dones, extras = env.step(torch.zeros(_NUM, env.num_actions))[2:]
    assert dones.tolist() == extras["time_outs"].tolist() == [False, True, False, False, False]
    assert env.terrain.episodes.tolist() == [before[0], before[1] + 1, *before[2:]]
    assert extras["log"]["Episode/falls"] == 0


class TestCheckpoint:
    def test_the_same_patches_follow(self, make_env):
        sections = {"commands": Commands(waypoints=True), "env": Env(num_envs=3, num_threads=1)}
        env, other = (make_env(3, **sections) for _ in range(2))
        env._reset_idx(np.array([1]))
        saved = env_state(env)
        load_env_state(other, saved)
        for _ in range(2):
            for name in ("heights", "goals", "spawns", "episodes"):
                expected = getattr(env.terrain, name)
                np.testing.assert_array_equal(getattr(other.terrain, name), expected)
            for each in (env, other):
                each._reset_idx(np.array([0, 1]))

    def test_no_patch_comes_again_with_more_environments(self, make_env):
        env = make_env(2)
        env._reset_idx(np.array([1]))
        other = make_env(3)
        load_env_state(other, env_state(env))
        assert other.terrain.episodes.tolist() == [3, 3, 3]


def test_what_cannot_change_is_rejected(nominal_task):
    task = nominal_task(terrain=Terrain(stream=True))
    with pytest.raises(ConfigError, match="got a plane; expected a map"):
        StreamGround(Plane(), task)
    for values, told in (
        ({"terrain": "rocks"}, "got hulls on a map of rocks"),
        ({"terrain": "flat", "friction": 0.5}, "got several frictions; expected one"),
    ):
        terrains = (SubTerrain(**values),)
        config = MapConfig(rows=1, cols=1, border=1.0, terrains=terrains)
        with pytest.raises(ConfigError, match=told):
            StreamGround(MapGround(generate(config)), task)
