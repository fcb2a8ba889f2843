from types import SimpleNamespace

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit.integrations.terrain_curriculum import (
    PROGRESS,
    TerrainLevels,
    TerrainProgress,
)

ROWS, COLS = 3, 2


class Env:
    """Robots on patches of 8 x 8 m around the origin, with the attributes of both frameworks."""

    def __init__(self, sampler="levels", levels=(0, 0, 1, 2)):
        self.num_envs, self.device, self.step_dt, self.common_step_counter = 4, "cpu", 0.5, 0
        x, y = np.meshgrid([-8.0, 0.0, 8.0], [-4.0, 4.0], indexing="ij")
        origins = torch.tensor(np.stack([x, y, 0 * x], axis=-1), dtype=torch.float)
        self.terrain = SimpleNamespace(
            terrain_origins=origins,
            terrain_levels=torch.tensor(levels),
            terrain_types=torch.tensor([0, 0, 1, 1]),
            env_origins=torch.zeros(4, 3),
            cfg=SimpleNamespace(
                terrain_generator=SimpleNamespace(
                    size=(8.0, 8.0), sub_terrains={"stairs": None, "stairs#2": None}
                )
            ),
        )
        heading = SimpleNamespace(heading_command=False)
        self.data = SimpleNamespace(root_link_pos_w=torch.zeros(4, 3), heading_w=torch.zeros(4))
        self.command = torch.tensor([[1.0, 0.0, 0.0]]).repeat(4, 1)
        self.scene = Scene(robot=SimpleNamespace(data=self.data))
        self.scene.terrain = self.terrain
        self.command_manager = SimpleNamespace(
            get_term=lambda _: SimpleNamespace(cfg=heading),
            get_command=lambda _: self.command,
        )
        self.cfg = SimpleNamespace(seed=None)
        term = TerrainProgress(None, self)
        self.termination_manager = SimpleNamespace(
            terminated=torch.zeros(4, dtype=torch.bool),
            get_term_cfg=lambda name: {PROGRESS: SimpleNamespace(func=term)}[name],
        )
        self.progress, self.params = term, {"sampler": sampler}
        self.curriculum = TerrainLevels(SimpleNamespace(params=self.params), self)

    def reset(self, ids=None):
        log = self.curriculum(self, ids, **self.params)
        self.data.root_link_pos_w[ids] = self.terrain.env_origins[ids]
        self.progress.reset(ids)
        return log

    def step(self, velocity):
        self.common_step_counter += 1
        velocity = torch.tensor(velocity, dtype=torch.float)
        self.data.root_link_pos_w[:, 0] += velocity * self.step_dt
        return self.progress(self, "twist")


class Scene(dict):
    pass


def test_robots_that_follow_their_commands_move_up():
    env = Env()
    log = env.reset()
    assert env.terrain.terrain_levels.tolist() == [0, 0, 1, 2]  # there was no episode
    assert log == {"mean": 0.75, "stairs": 0.75}
    for _ in range(12):  # 6 m were commanded; the first step is the start
        assert not env.step([1.0, 0.2, -1.0, 1.0]).any()
    env.termination_manager.terminated[1] = True
    log = env.reset(torch.tensor([0, 1, 2]))
    assert env.terrain.terrain_levels.tolist() == [1, 0, 0, 2]
    expected = env.terrain.terrain_origins[[1, 0, 0], env.terrain.terrain_types[:3]]
    assert torch.equal(env.terrain.env_origins[:3], expected)
    assert env.terrain.terrain_types[3] == 1
    # One of two episodes on level 0 crossed its patch: 0 and 1 of the same column.
    success = {"success/stairs": 0.25, "success/level_0": 0.5, "success/level_1": 0.0}
    assert log == {"mean": 0.75, "stairs": 0.75} | {k: pytest.approx(v) for k, v in success.items()}


@pytest.mark.parametrize(
    ("sampler", "names", "rotates"),
    [
        ("levels", ("stairs", "stairs#2"), True),
        ("levels", ("stairs", "rough"), False),
        (None, ("stairs", "stairs#2"), False),
    ],
)
def test_variants_of_a_terrain_take_turns(sampler, names, rotates):
    env = Env(sampler)
    env.terrain.cfg.terrain_generator.sub_terrains = dict.fromkeys(names)
    env.curriculum = TerrainLevels(SimpleNamespace(params=env.params), env)
    env.reset()
    columns = set()
    for _ in range(20):
        env.step([0.0] * 4)
        env.reset()
        columns.add(tuple(env.terrain.terrain_types.tolist()))
    assert (len(columns) > 8) == rotates  # of 16
    assert rotates or columns == {(0, 0, 1, 1)}


@pytest.mark.parametrize(("y", "levels"), [(-7.9, [0, 1]), (-8.1, [0, 2])])
def test_robots_that_follow_and_leave_the_map_move_up(y, levels):
    env = Env(levels=(1, 1, 1, 1))
    env.reset()
    env.step([0.0] * 4)
    # The map of 3 x 2 patches ends 8 m from its center. Robot 0 stays; robot 1 follows for 0.5 m.
    env.data.root_link_pos_w[1] = torch.tensor([0.5, y, 0.0])
    env.step([0.0] * 4)
    env.reset(torch.tensor([0, 1]))
    assert env.terrain.terrain_levels[:2].tolist() == levels


@pytest.mark.parametrize(("distance", "level"), [(3.9, 1), (4.1, 2)])
def test_robots_cross_half_a_patch(distance, level):
    env = Env(levels=(1, 1, 1, 1))
    env.reset()
    for _ in range(10):  # 5 m were commanded
        env.step([0.0] * 4)
    env.data.root_link_pos_w[1, 0] = distance
    env.step([0.0] * 4)
    env.reset(torch.tensor([1]))
    assert env.terrain.terrain_levels.tolist() == [1, level, 1, 1]


def test_curriculum_begins_with_the_patches_of_the_terrain():
    env = Env()
    env.terrain.cfg.terrain_generator.sub_terrains = {"stairs": None}  # less than the columns
    env.terrain.terrain_types = torch.tensor([1, 0, 1, 0])
    term = TerrainLevels(SimpleNamespace(params={"sampler": None}), env)
    assert term.sampler.columns.tolist() == [1, 0, 1, 0]
    assert term.sampler.levels.tolist() == [0, 0, 1, 2]
    assert term._log() == {"mean": 0.75, "terrain": 0.75}


@pytest.mark.parametrize(
    ("target", "yaw"), [(3.0, 0.25), (0.6, 0.15), (0.6 - 2 * np.pi, 0.15), (-3.5, 0.25)]
)
def test_heading_commands_turn_the_reference(target, yaw):
    env = Env()
    cfg = SimpleNamespace(
        heading_command=True,
        heading_control_stiffness=0.5,
        ranges=SimpleNamespace(ang_vel_z=(-0.5, 0.5)),
    )
    term = SimpleNamespace(
        cfg=cfg,
        heading_target=torch.full((4,), target),
        is_heading_env=torch.tensor([True, False, True, False]),
    )
    env.command_manager.get_term = lambda _: term
    env.step([0.0] * 4)
    assert env.progress.progress.yaw == pytest.approx([yaw, 0, yaw, 0])


def test_unknown_sampler_is_an_error():
    with pytest.raises(ConfigError, match="sampler: got 'level'"):
        Env("level")
