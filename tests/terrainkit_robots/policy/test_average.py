import shutil

import pytest

from terrainkit.errors import ConfigError
from terrainkit_robots.checkpoint import read_checkpoint, save_checkpoint
from terrainkit_robots.policy.average import average_checkpoints
from terrainkit_robots.policy.load_policy import load_policy
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.rl.terrain import Plane

WEIGHT, COUNT = "mlp.0.weight", "obs_normalizer.count"


@pytest.fixture
def run(trained, tmp_path):
    """Return a run with the checkpoints 2 to 5, whose weights are 2 to 5, and counts 20 to 50."""
    folder = shutil.copytree(trained.folder, tmp_path / "run")
    state = read_checkpoint(trained.checkpoint)
    for old in folder.glob("model_*.pt"):
        old.unlink()
    for iteration in range(2, 6):
        for name in ("actor_state_dict", "critic_state_dict"):
            state[name][WEIGHT].fill_(iteration)
            state[name][COUNT].fill_(10 * iteration)
        save_checkpoint(folder / f"model_{iteration}.pt", state | {"iteration": iteration})
    return open_run(folder)


@pytest.mark.parametrize(
    ("selected", "number", "iterations", "mean"),
    [(None, 2, (4, 5), 4.5), (None, 4, (2, 3, 4, 5), 3.5), (4, 3, (2, 3, 4), 3.0)],
)
def test_mean_of_the_last_checkpoints(run, tmp_path, selected, number, iterations, mean):
    averaged = average_checkpoints(open_run(run.folder, selected), number, tmp_path / "new")
    assert averaged.info.averaged == iterations
    assert averaged.checkpoint.name == f"model_{iterations[-1]}.pt"
    state = read_checkpoint(averaged.checkpoint)
    assert not {"optimizer_state_dict", "processes", "logger"} & state.keys()
    for name in ("actor_state_dict", "critic_state_dict"):
        assert (state[name][WEIGHT] == mean).all()
        assert (state[name][COUNT] == 10 * iterations[-1]).all()
    assert (averaged.task, averaged.terrain) == (run.task, run.terrain)
    env = LeggedEnv(run.task, run.robot, Plane())
    assert load_policy(averaged, env)(env.get_observations()).isfinite().all()


def test_mean_with_the_policy_before(run, tmp_path):
    base = open_run(run.folder, 2)
    averaged = average_checkpoints(run, 3, tmp_path / "new", base)
    weight = read_checkpoint(averaged.checkpoint)["actor_state_dict"][WEIGHT]
    assert (weight == (2 + (3 + 4 + 5) / 3) / 2).all()
    assert averaged.info.averaged == (3, 4, 5)


@pytest.mark.parametrize("number", [-1, 0, 1, 5])
def test_average_needs_as_many_checkpoints(run, tmp_path, number):
    with pytest.raises(ConfigError, match=rf"got {number}; expected at least 2; .*run has 4 up to"):
        average_checkpoints(run, number, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_average_rejects_networks_of_other_shapes(run, tmp_path):
    path = run.folder / "model_3.pt"
    state = read_checkpoint(path)
    state["critic_state_dict"][WEIGHT] = state["critic_state_dict"][WEIGHT][:-1]
    save_checkpoint(path, state)
    with pytest.raises(ConfigError, match=r"model_3.pt: critic_state_dict.mlp.0.weight: got float"):
        average_checkpoints(run, 3, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_average_rejects_a_renamed_checkpoint(run, tmp_path):
    path = (run.folder / "model_3.pt").rename(run.folder / "best.pt")
    with pytest.raises(
        ConfigError, match=r"best.pt: got a .* iteration 3; expected the name model_3"
    ):
        average_checkpoints(open_run(path), 2, tmp_path / "new")
