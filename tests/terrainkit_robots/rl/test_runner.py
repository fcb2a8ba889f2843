import os
import re
import subprocess
import sys
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
import torch
from rsl_rl.utils import WandbLogWriter

from terrainkit.errors import ConfigError, PluginError
from terrainkit_robots.checkpoint import policy_state, read_checkpoint, save_checkpoint
from terrainkit_robots.rl.config import Algorithm, Policy, Task, Termination
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.estimator import estimator_update
from terrainkit_robots.rl.run import open_run
from terrainkit_robots.rl.runner import LeggedRunner, resolve_device, runner_config
from terrainkit_robots.rl.symmetry import has_symmetry
from terrainkit_robots.rl.terrain import Plane


@pytest.fixture
def make(quadruped, task, tmp_path):
    """Return a function that makes runners with the same seed."""

    def made(task=task, ground=None, folder=tmp_path, **options):
        torch.manual_seed(task.runner.seed)
        return LeggedRunner(LeggedEnv(task, quadruped, ground or Plane()), folder, **options)

    return made


def differences(a, b, path=""):
    """Return the paths at which two states differ, except for the elapsed time."""
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        return [d for key in a for d in differences(a[key], b[key], f"{path}.{key}")]
    if isinstance(a, list | tuple):
        assert len(a) == len(b)
        return [d for k in range(len(a)) for d in differences(a[k], b[k], f"{path}[{k}]")]
    same = np.array_equal(a, b, equal_nan=np.asarray(a).dtype.kind == "f")
    return [] if same or path == ".logger.tot_time" else [path]


@pytest.mark.parametrize("kind", ["plane", "map", "stuck", "estimator"])
def test_resuming_continues_exactly(make, task, tmp_path, map_ground, kind):
    ground = None
    if kind == "stuck":
        task = replace(task, termination=Termination(stuck_time=0.1))
    if kind == "estimator":
        task = replace(task, policy=Policy(estimator_hidden_dims=(8,)))
    if kind == "map":
        commands = replace(task.commands, heading_command=True)
        terrain = replace(task.terrain, curriculum="learning_progress")
        task, ground = replace(task, commands=commands, terrain=terrain), map_ground
    unbroken = make(task, ground, folder=tmp_path / "unbroken")
    unbroken.learn(4, init_at_random_ep_len=True)
    make(task, ground).learn(2, init_at_random_ep_len=True)
    resumed = make(task, ground)
    resumed.load(tmp_path / "model_2.pt")
    resumed.learn(2)
    assert resumed.current_learning_iteration == 4
    assert resumed.env.curriculum.sampler.statistics.visits.any()
    assert differences(unbroken.state_dict(), resumed.state_dict()) == []


def test_rewards_of_running_episodes_are_logged_after_a_resume(make, tmp_path):
    before = make()
    before.learn(1)
    after = make()
    after.load(tmp_path / "model_1.pt")
    for name in ("cur_reward_sum", "cur_episode_length"):
        expected = getattr(before.logger, name)
        torch.testing.assert_close(getattr(after.logger, name), expected)
    assert after.logger.cur_episode_length.any()
    assert after.logger.tot_timesteps == before.logger.tot_timesteps


def test_load_with_other_num_envs_keeps_curriculum(make, task, tmp_path, map_ground):
    before = make(task, map_ground)
    before.env.curriculum.levels[:] = 2
    before.env.curriculum.sampler.statistics.success[1, 0] = 0.75
    before.env.velocity_command.lin_vel_x[:] = -1.5, 2
    before.env.velocity_command.steps[:] = 7
    before.save()
    more = make(replace(task, env=replace(task.env, num_envs=9)), map_ground)
    more.load(tmp_path / "model_0.pt")
    assert (more.env.curriculum.levels == 2).all()
    assert more.env.curriculum.sampler.statistics.success[1, 0] == 0.75
    assert more.env.velocity_command.lin_vel_x.tolist() == [-1.5, 2]
    assert more.env.velocity_command.steps == 7
    assert differences(before.alg.save(), more.alg.save()) == []
    more.learn(1)


def test_load_of_policy_takes_only_networks(make, tmp_path):
    before = make()
    before.learn(1)
    path = tmp_path / "model_1.pt"
    save_checkpoint(path, policy_state(read_checkpoint(path)))
    after = make()
    after.load(path)
    assert after.current_learning_iteration == 0
    networks = [runner.alg.get_policy().state_dict() for runner in (before, after)]
    assert differences(*networks) == []


def test_policy_of_another_run_gets_all_commands(make, task, tmp_path):
    commands = replace(task.commands, forward_steps=1000, lin_vel_x=(-1.0, -0.5), standing=0.0)
    task = replace(task, commands=commands)
    before = make(task)
    before.save()
    new = make(task)
    new.load(tmp_path / "model_0.pt", {"actor": True, "critic": True})
    new.env.reset()
    assert (before.env.commands[:, 0] > 0).all()
    assert (new.env.commands[:, 0] < 0).all()


def test_checkpoints_at_intervals_and_at_end(make, task, tmp_path, capfd):
    task = replace(task, runner=replace(task.runner, save_interval=2))
    make(task).learn(5)
    assert capfd.readouterr() == ("", "")
    names = {path.name for path in tmp_path.glob("*.pt")}
    assert names == {"model_2.pt", "model_4.pt", "model_5.pt"}
    assert len(list(tmp_path.glob("events.out.tfevents.*"))) == 1


def test_noise_is_limited_from_the_middle_to_the_last_quarter(make, task):
    policy = replace(task.policy, init_noise_std=0.7, final_noise_std=0.1)
    noisy = 0.9  # above the initial one, as after a training that raised it
    limited = replace(task, policy=policy, runner=replace(task.runner, max_iterations=8))
    largest = []

    def record(runner):
        largest.append(float(runner.alg.get_policy().distribution.std_param.detach().max()))

    runner = make(limited, progress_callback=record)
    runner.alg.get_policy().distribution.std_param.data[:] = noisy
    runner.learn(8)
    assert min(largest[:4]) > 0.8
    np.testing.assert_array_less(largest[4:], np.array([0.4, 0.1, 0.1, 0.1]) + 1e-6)


def test_writer_of_the_log_is_closed_and_stopped(make):
    logger = make().logger
    logger.writer = writer = Mock(spec=WandbLogWriter)
    logger.stop_logging_writer()
    assert [call[0] for call in writer.method_calls] == ["close", "stop"]
    assert logger.writer is None


def test_progress_callback_gets_the_runner_after_every_iteration(make, task, map_ground):
    seen = []

    def watch(runner):
        seen.append((runner.current_learning_iteration, runner.last_iteration))
        assert runner.collect_time > 0
        assert runner.learn_time > 0

    make(task, map_ground, progress_callback=watch).learn(4)
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_episode_callback_gets_the_means_of_the_episodes_that_a_step_ends(make, task):
    seen, fallen = [], []
    runner = make(replace(task, termination=Termination(tilt=0.1)))
    step = runner.env.step

    def record(actions):
        result = step(actions)
        _, _, dones, extras = result
        if dones.any():
            fallen.append((int(dones.sum()), float((~extras["time_outs"][dones]).float().mean())))
        return result

    runner.env.step = record
    runner.logger.episode_callback = lambda count, log: seen.append((count, log["Episode/falls"]))
    runner.learn(10)
    assert seen == [(count, pytest.approx(falls)) for count, falls in fallen]
    assert len(seen) > 5


def test_load_rejects_another_task(make, task, tmp_path, map_ground):
    make().save()
    wide = replace(task, policy=replace(task.policy, actor_hidden_dims=(32,)))
    for runner, told in (
        (make(ground=map_ground), "belongs to another task: got 141 policy observations; exp"),
        (make(wide), r"does not fit .*mlp\.0\.weight: got float32 \(16, 141\); exp"),
    ):
        with pytest.raises(ConfigError, match=told):
            runner.load(tmp_path / "model_0.pt")


DELETED = object()

OF_ENV = "processes 0 env"
"""Path of the state of the environment in a checkpoint."""


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        ("actor_state_dict mlp.0.weight", DELETED, "mlp.0.weight: got nothing; expected float32"),
        ("critic_state_dict mlp.0.bias", torch.zeros(16).double(), "got float64 (16,); expected"),
        ("optimizer_state_dict", {}, "optimizer_state_dict.state: got nothing"),
        ("optimizer_state_dict state", {}, "state.0: got nothing; expected dict"),
        ("optimizer_state_dict state 2 exp_avg", torch.zeros(3), "exp_avg: got float32 (3,); exp"),
        ("optimizer_state_dict param_groups 0 lr", -1.0, "lr: got -1; expected finite numbers"),
        ("processes", [], "processes: got none; expected one or more"),
        ("processes", DELETED, "state.processes: got nothing"),
        (OF_ENV, 3, "env: got int; expected dict"),
        (
            f"{OF_ENV} arrays buffers.path_length",
            torch.zeros(3),
            "arrays.buffers.path_length: got float32 (3,); exp",
        ),
        (
            f"{OF_ENV} arrays sim.episode_length",
            torch.zeros(2).long(),
            "episode_length: got int64 (2",
        ),
        (f"{OF_ENV} curriculum levels", torch.full((3,), 99), "levels: got 99 to 99; expected 0"),
        (f"{OF_ENV} observations policy", torch.zeros(3), "env.observations.policy: got float32"),
        (f"{OF_ENV} rng state state", 2**200, ""),
        (f"{OF_ENV} rng bit_generator", "MT19937", "PCG64"),
        ("processes 0 random cpu", torch.zeros(3).byte(), "random.cpu: got uint8 (3,); expected"),
        ("logger", DELETED, "state.logger: got nothing"),
        ("logger tot_time", 3, "logger.tot_time: got int; expected float"),
    ],
)
def test_load_names_the_part_that_does_not_fit(make, tmp_path, path, value, told):
    make().learn(1)
    state = read_checkpoint(tmp_path / "model_1.pt")
    *parents, last = (int(key) if key.isdecimal() else key for key in path.split())
    part = state
    for key in parents:
        part = part[key]
    if value is DELETED:
        del part[last]
    else:
        part[last] = value
    save_checkpoint(tmp_path / "changed.pt", state)
    with pytest.raises(ConfigError, match=rf"changed\.pt does not fit .*{re.escape(told)}") as info:
        make().load(tmp_path / "changed.pt")
    assert "\n" not in str(info.value)


def test_load_takes_the_settings_of_the_optimizer_from_the_task(make, tmp_path):
    make().learn(1)
    state = read_checkpoint(tmp_path / "model_1.pt")
    (group,) = state["optimizer_state_dict"]["param_groups"]
    group |= {"lr": 0.25, "betas": (0.5, 0.5), "maximize": True}
    save_checkpoint(tmp_path / "changed.pt", state)
    runner = make()
    runner.load(tmp_path / "changed.pt")
    (loaded,) = runner.alg.optimizer.param_groups
    assert (loaded["lr"], loaded["betas"], loaded["maximize"]) == (0.25, (0.9, 0.999), False)


@pytest.mark.parametrize("is_kept", [False, True])
def test_load_may_start_with_the_noise_of_the_task(make, task, tmp_path, is_kept):
    make().learn(1)
    before = read_checkpoint(tmp_path / "model_1.pt")["actor_state_dict"]
    runner = make(replace(task, policy=replace(task.policy, init_noise_std=0.125)))
    runner.load(tmp_path / "model_1.pt", {"actor": True, "critic": True, "noise_std": is_kept})
    after = runner.alg.get_policy().state_dict()
    std = after.pop("distribution.std_param")
    assert torch.equal(std, torch.full((12,), 0.125)) != is_kept
    assert torch.equal(std, before.pop("distribution.std_param")) == is_kept
    assert differences(before, after) == []


@pytest.mark.parametrize("symmetry", [None, True, False])
def test_symmetry_setting_reaches_rsl_rl(make, task, symmetry):
    runner = make(replace(task, algorithm=Algorithm(symmetry=symmetry)), folder=None)
    runner.learn(1)
    is_augmented = symmetry is not False and has_symmetry(runner.env)
    assert bool(runner.alg.symmetry) == is_augmented
    assert not is_augmented or runner.alg.symmetry.use_data_augmentation


def test_samples_mirrored_once_update_as_those_of_each_mini_batch(make):
    once, often = make(folder=None), make(folder=None)
    often.alg.update = type(often.alg).update.__get__(often.alg)
    for runner in (once, often):
        torch.manual_seed(1)
        runner.learn(2)
    assert differences(once.state_dict(), often.state_dict()) == []
    assert set(once.alg.storage.observations.keys()) == {"policy", "privileged"}


def test_estimator_learns_and_ppo_leaves_it_alone(make, task):
    task = replace(task, policy=replace(task.policy, estimator_hidden_dims=(16,)))
    runner = make(task, folder=None)
    runner.learn(1)
    obs, actor = runner.alg.storage.observations.flatten(0, 1), runner.alg.actor
    start = (actor.estimate(obs) - obs["estimate"]).square().mean()
    runner.alg.update = dict
    update = estimator_update(runner.alg, lambda obs: obs, 800)
    losses = [update()["estimator"] for _ in range(30)]
    assert losses[-1] < 0.5 * start < 0.6 * losses[0]
    assert {group["lr"] for group in runner.alg.optimizer.param_groups} == {
        runner.alg.learning_rate
    }
    actions = actor(obs).sum()
    weights = [*actor.estimator.parameters()]
    assert torch.autograd.grad(actions, weights, allow_unused=True) == (None,) * len(weights)


def test_network_of_another_class_has_no_estimator(make, task):
    network = {"actor": {"class_name": "RNNModel", "rnn_type": "gru"}}
    recurrent = replace(task.runner, rsl_rl=network)
    policy = replace(task.policy, estimator_hidden_dims=(16,))
    runner = make(replace(task, policy=policy, runner=recurrent), folder=None)
    runner.learn(1)
    assert runner.alg.actor.is_recurrent
    assert set(runner.env.obs_sizes) == {"policy", "privileged"}


def test_policy_observes_simulated_values_at_first(make, task):
    task = replace(task, policy=replace(task.policy, estimator_hidden_dims=(16,)))
    runner = make(task, folder=None)
    obs, actor = runner.env.get_observations(), runner.alg.actor
    width = obs["estimate"].shape[1]
    simulated, estimated = obs["estimate"], actor.estimate(obs)
    for share, expected in [(1, simulated), (0.25, 0.25 * simulated + 0.75 * estimated)]:
        actor.forced.fill_(share)
        torch.testing.assert_close(actor.get_latent(obs)[:, -width:], expected)
    actor.eval()
    torch.testing.assert_close(actor.get_latent(obs)[:, -width:], estimated)
    assert width == 7


def test_mixed_precision_changes_little_and_keeps_single_precision(make, task):
    settings = (
        Algorithm(schedule="fixed", use_mixed_precision=is_mixed) for is_mixed in (True, False)
    )
    mixed, single = (
        make(replace(task, algorithm=algorithm), folder=None) for algorithm in settings
    )
    for runner in (mixed, single):
        torch.manual_seed(1)
        runner.learn(1)
    weights, other = (runner.alg.actor.state_dict() for runner in (mixed, single))
    assert {weight.dtype for weight in weights.values()} <= {torch.float32, torch.int64}
    errors = [float((weight - other[name]).abs().max()) for name, weight in weights.items()]
    assert 0 < max(errors) < 0.02  # 20 steps of Adam change a weight by about 0.02


def test_runner_config_has_the_tasks_values():
    policy = Policy(actor_hidden_dims=(7,), critic_hidden_dims=(5, 6), activation="relu")
    algorithm = Algorithm(gamma=0.5, entropy_coef=0.125, num_mini_batches=2)
    config = runner_config(Task(policy=policy, algorithm=algorithm))
    assert (config["actor"]["hidden_dims"], config["critic"]["hidden_dims"]) == ([7], [5, 6])
    assert config["critic"]["activation"] == "relu"
    algorithm = {"gamma": 0.5, "entropy_coef": 0.125, "num_mini_batches": 2}
    assert config["algorithm"] | algorithm == config["algorithm"]


TWO_PROCESSES = """
import os, sys
from pathlib import Path
from terrainkit_robots.rl.config import Env, Policy, Runner, Task
from terrainkit_robots.rl.train import train

out = Path(sys.argv[1])
runner = Runner(num_steps_per_env=8, max_iterations=2)
env, policy = Env(num_envs=5, episode_length_s=0.3), Policy(estimator_hidden_dims=(8,))
task = Task(env=env, policy=policy, runner=runner)
trained = train("quadruped", "plane", task, folder=out / "run")
import torch
torch.save(
    {
        "actor": trained.alg.get_policy().state_dict(),
        "envs": trained.env.num_envs,
        "qpos": torch.tensor(trained.env.sim.qpos[:2].copy()),
        "folder": str(trained.folder),
    },
    out / f"rank{os.environ['RANK']}.pt",
)
"""


def test_two_processes_learn_the_same_weights(tmp_path):
    (tmp_path / "two.py").write_text(TWO_PROCESSES)
    launch = ["torch.distributed.run", "--nproc-per-node", "2", "--standalone"]
    run = subprocess.run(
        [sys.executable, "-m", *launch, str(tmp_path / "two.py"), str(tmp_path)],
        # With an empty PATH, git is missing, which rsl-rl imports.
        env={**os.environ, "PATH": "", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    first, second = (torch.load(tmp_path / f"rank{k}.pt", weights_only=True) for k in (0, 1))
    assert differences(first["actor"], second["actor"]) == []
    assert (first["envs"], second["envs"]) == (3, 2)
    assert differences(first["qpos"], second["qpos"])
    assert (first["folder"], second["folder"]) == (str(tmp_path / "run"), "None")
    state = read_checkpoint(tmp_path / "run" / "model_2.pt")
    assert [len(each["env"]["observations"]["policy"]) for each in state["processes"]] == [3, 2]
    assert len(list((tmp_path / "run").glob("events.*"))) == 1
    assert open_run(tmp_path / "run").task.env.num_envs == 5


def test_curiosity_of_rsl_rl_is_trained_and_resumed(make, task, tmp_path):
    curiosity = {"weight": 0.5, "num_outputs": 2, "predictor_hidden_dims": [8]}
    changes = {
        "algorithm": {"rnd_cfg": curiosity | {"target_hidden_dims": [8]}},
        "obs_groups": {"rnd_state": ["policy"]},
    }
    task = replace(task, runner=replace(task.runner, rsl_rl=changes))
    runner, resumed = make(task), make(task)
    runner.learn(2)
    assert runner.alg.rnd.weight == pytest.approx(0.5 * task.dt)
    resumed.load(tmp_path / "model_2.pt")
    assert differences(runner.alg.save(), resumed.alg.save()) == []
    resumed.learn(1)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"actor": 3}, "TypeError: argument of type 'int'"),
        ({"actor": {"class_name": "Unknown"}}, "ValueError: Could not resolve 'Unknown'"),
        ({"actor": {"distribution_cfg": 3}}, "AttributeError: 'int' object has no attribute"),
        ({"algorithm": {"symmetry_cfg": {"data_augmentation_func": "PPO"}}}, "TypeError: PPO"),
    ],
)
def test_invalid_rsl_rl_table_is_named(make, task, changes, told):
    changed = replace(task, runner=replace(task.runner, rsl_rl=changes))
    with pytest.raises(PluginError, match=rf"^runner\.rsl_rl: {told}"):
        make(changed).learn(1)


@pytest.fixture(params=[0, 1])
def alone(request, make, tmp_path, monkeypatch):
    """Return a runner in a group of one process, which breaks after 0 or 1 updates."""
    store = torch.distributed.FileStore(str(tmp_path / "store"), 1)
    torch.distributed.init_process_group("gloo", store=store, rank=0, world_size=1)
    runner = make(folder=tmp_path / "run")
    (tmp_path / "run").mkdir()
    runner.is_distributed, updates, update = True, [], runner.alg.update

    def fail(*_, **__):
        raise RuntimeError("Connection closed by peer [127.0.0.1]:1234")

    def update_before():
        if len(updates) < request.param:
            updates.append(None)
            return update()
        for name in ("all_reduce", "gather_object"):
            monkeypatch.setattr(torch.distributed, name, fail)
        return fail()

    monkeypatch.setattr(runner.alg, "update", update_before)
    yield runner, request.param
    torch.distributed.destroy_process_group()


def test_main_process_saves_a_checkpoint_when_another_one_ends(
    alone, make, tmp_path, capfd, monkeypatch
):
    (runner, last), folder = alone, tmp_path / "run"
    assert len(runner.state_dict()["processes"]) == 1  # gathered
    with pytest.raises(ConfigError) as caught:
        runner.learn(4)
    told = f"another process of torchrun ended after iteration {last}; continue with --resume"
    assert str(caught.value) == f"{told} {folder}"
    assert isinstance(caught.value.__cause__, RuntimeError)
    assert capfd.readouterr() == ("", "")
    assert [path.name for path in folder.glob("*.pt")] == [f"model_{last}.pt"]
    monkeypatch.undo()
    resumed = make(folder=folder)
    resumed.load(folder / f"model_{last}.pt")
    assert resumed.current_learning_iteration == last
    resumed.learn(1)
    assert (folder / f"model_{last + 1}.pt").exists()


def test_other_processes_exit_without_a_checkpoint(alone, tmp_path):
    runner, _ = alone
    runner.is_main_process = False
    with pytest.raises(SystemExit) as caught:
        runner.learn(4)
    assert caught.value.code == 1
    assert not list((tmp_path / "run").glob("*.pt"))


def test_error_of_a_single_process_is_not_hidden(alone):
    runner, _ = alone
    runner.is_distributed = False
    with pytest.raises(RuntimeError, match="Connection closed"):
        runner.learn(4)


def test_resolve_device(monkeypatch):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    found = [resolve_device(name) for name in ("cpu", "cpu:0", "cuda", "cuda:1")]
    assert found == ["cpu", "cpu", "cuda", "cuda:1"]
    for name in ("gpu", "", "meta", "cuda:2", "cuda:-1"):
        with pytest.raises(ConfigError, match=f"device: got '{name}'; .*: cpu, cuda:0, cuda:1"):
            resolve_device(name)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    with pytest.raises(ConfigError, match=r"device: got 'cuda'; expected one of: cpu$"):
        resolve_device("cuda")
