import json
import shutil
import sys
import textwrap
from dataclasses import replace

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from tensordict import TensorDict

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.policy import export as policy_export
from terrainkit_robots.policy.actor import policy_of
from terrainkit_robots.policy.export import METADATA, export_policy
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.config import Env, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import create_run, open_run
from terrainkit_robots.rl.tasks import get_task
from terrainkit_robots.rl.terrain import Plane


@pytest.fixture(scope="module")
def exported(trained, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports") / "policy"
    export_policy(open_run(trained), folder)
    return folder


@pytest.fixture(scope="module")
def asked(trained):
    """Return observations of a rollout and random ones, and what the environment acts on."""
    run = open_run(trained)
    env = LeggedEnv(replace(run.task, env=Env(num_envs=20, num_threads=1)), run.robot, Plane())
    policy = policy_of(run, env)
    seen = []
    for _ in range(20):
        obs = env.get_observations()
        seen.append(obs["policy"].numpy())
        env.step(policy(obs))
    rolled = np.concatenate(seen)
    obs = np.concatenate([rolled, np.random.default_rng(3).normal(0, 3, rolled.shape)])
    obs = obs.astype(np.float32)
    answers = policy(TensorDict({"policy": torch.from_numpy(obs)}, [len(obs)])).numpy()
    return obs, np.clip(answers, -0.3, 0.3)


def session(folder):
    return onnxruntime.InferenceSession(folder / "policy.onnx", providers=["CPUExecutionProvider"])


def test_a_task_of_many_robots_and_mini_batches_is_exported(trained, tmp_path):
    run = open_run(trained)
    many = replace(
        run.task,
        env=replace(run.task.env, num_envs=4096),
        algorithm=replace(run.task.algorithm, num_mini_batches=256),
    )
    assert export_policy(replace(run, task=many), tmp_path / "policy").error < 1e-5


@pytest.mark.parametrize("batch", [1, 7, 800])
def test_the_onnx_file_acts_as_the_checkpoint_whatever_the_batch(exported, asked, batch):
    obs, wanted = asked
    run = session(exported)
    assert [(i.name, i.shape) for i in run.get_inputs()] == [("obs", ["batch", 45])]
    assert [(o.name, o.shape) for o in run.get_outputs()] == [("actions", ["batch", 12])]
    assert 0.05 < (np.abs(wanted) == np.float32(0.3)).mean() < 0.95  # some are clipped, some not
    for start in range(0, len(obs), max(batch, len(obs) // 8)):
        got = run.run(None, {"obs": obs[start : start + batch]})[0]
        np.testing.assert_allclose(got, wanted[start : start + batch], atol=1e-5, rtol=0)


@pytest.mark.filterwarnings("ignore:.torch.jit:FutureWarning")
@pytest.mark.parametrize("batch", [1, 7, 800])
def test_the_torchscript_acts_as_the_checkpoint_whatever_the_batch(exported, asked, batch):
    obs, wanted = asked
    policy = torch.jit.load(exported / "policy.pt")
    for start in range(0, len(obs), max(batch, len(obs) // 8)):
        got = policy(torch.from_numpy(obs[start : start + batch])).detach().numpy()
        np.testing.assert_allclose(got, wanted[start : start + batch], atol=1e-5, rtol=0)


def test_the_onnx_file_is_sound_and_carries_the_json(exported):
    model = onnx.load(exported / "policy.onnx")
    onnx.checker.check_model(model, full_check=True)
    inside = {each.key: each.value for each in model.metadata_props}[METADATA]
    assert inside == (exported / "policy.json").read_text()
    told = json.loads(inside)
    assert told["format_version"] == 1
    assert told["robot"]["name"] == "quadruped"
    assert told["iteration"] == 2
    assert told["timing"] == {"physics_dt": 0.005, "decimation": 4, "policy_dt": 0.02}
    assert told["action"] == {"size": 12, "clip": 0.3}
    assert [part["name"] for part in told["observation"]["parts"]] == [
        "commands",
        "projected_gravity",
        "base_ang_vel",
        "dof_pos",
        "dof_vel",
        "actions",
    ]
    assert told["observation"]["parts"][0]["scale"] == [2, 2, 0.25]
    assert told["observation"]["parts"][-1]["stop"] == told["observation"]["size"] == 45
    assert told["height_scan"] is None


def example():
    """Return the program in the module's docstring."""
    lines = policy_export.__doc__.split("::\n\n", 1)[1].splitlines()
    end = next(k for k, line in enumerate(lines) if line and not line.startswith("    "))
    return textwrap.dedent("\n".join(lines[:end]))


def follow_the_example(folder, robot, tmp_path, monkeypatch):
    for path in folder.iterdir():
        shutil.copy(path, tmp_path)
    shutil.copy(robot.mjcf, tmp_path / "robot.xml")
    monkeypatch.chdir(tmp_path)
    names = {}
    with quiet_mujoco():
        exec(example(), names)
    assert not any(key.startswith("terrainkit") for key in names)
    data, target = names["data"], robot.spec.base_height_target
    assert data.qpos[2] > 0.7 * target, "it fell"
    assert names["turn"].reshape(3, 3)[2, 2] > 0.9, "it is tilted"
    assert data.time == pytest.approx(5)
    return data


def test_the_example_runs_a_policy_in_plain_mujoco(exported, quadruped, tmp_path, monkeypatch):
    follow_the_example(exported, quadruped, tmp_path, monkeypatch)


@pytest.mark.parametrize("name", ["quadruped", "biped"])
def test_the_example_walks_with_the_policy_that_is_shipped(name, tmp_path, monkeypatch):
    if not get_task(name).shipped.is_dir():
        pytest.skip(f"no policy of {name} is shipped")
    run = open_run(name)
    export_policy(run, tmp_path / "exported")
    data = follow_the_example(tmp_path / "exported", run.robot, tmp_path, monkeypatch)
    assert data.qpos[0] > 1.5  # of 2.5 m that are asked for, the start included


# What goes wrong.


def test_files_that_are_there_stay_unless_overwritten(trained, exported, tmp_path):
    folder = tmp_path / "policy"
    shutil.copytree(exported, folder)
    (folder / "policy.pt").unlink()
    (folder / "notes.txt").write_text("mine")
    (folder / "policy.onnx").write_bytes(b"before")
    with pytest.raises(ExportError, match=r"policy\.onnx exists; another name would do"):
        export_policy(open_run(trained), folder)
    assert (folder / "policy.onnx").read_bytes() == b"before"
    assert not (folder / "policy.pt").exists()
    export_policy(open_run(trained), folder, overwrite=True)
    assert (folder / "policy.json").read_bytes() == (exported / "policy.json").read_bytes()
    assert sorted(path.name for path in folder.iterdir()) == [
        "notes.txt",
        "policy.json",
        "policy.onnx",
        "policy.pt",
    ]


@pytest.mark.parametrize("name", ["_write_onnx", "_write_script"])
def test_a_file_that_answers_otherwise_is_not_written(trained, tmp_path, monkeypatch, name):
    write = getattr(policy_export, name)

    def wrong(live, *rest):
        with torch.no_grad():
            live.actor.mlp[-1].bias += 1e-3
        write(live, *rest)
        with torch.no_grad():
            live.actor.mlp[-1].bias -= 1e-3

    monkeypatch.setattr(policy_export, name, wrong)
    with pytest.raises(ExportError, match=r"answers otherwise than the policy: up to 0\.001"):
        export_policy(open_run(trained), tmp_path / "policy")
    assert list(tmp_path.iterdir()) == []


def test_without_onnxruntime_the_onnx_file_is_written_and_not_said_to_be_checked(
    trained, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    done = export_policy(open_run(trained), tmp_path / "policy")
    assert done.onnx_error is None
    assert done.error <= 1e-5
    assert (tmp_path / "policy" / "policy.onnx").is_file()


def test_without_onnx_it_is_said_what_to_install(trained, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(ConfigError, match=r"needs onnx.*pip install 'terrainkit\[train\]'"):
        export_policy(open_run(trained), tmp_path / "policy")
    assert list(tmp_path.iterdir()) == []


def test_a_run_without_a_checkpoint_has_no_policy(tmp_path):
    run = create_run(tmp_path / "run", Task(), "quadruped", "plane")
    with pytest.raises(ConfigError, match="no checkpoint"):
        export_policy(run, tmp_path / "policy")
    assert not (tmp_path / "policy").exists()


def test_a_target_that_cannot_be_is_refused_before_the_work(trained, tmp_path):
    (tmp_path / "file").write_text("")
    for folder, said in ((tmp_path / "file", "exists"), (tmp_path / "a" / "b", "no folder")):
        with pytest.raises(ExportError, match=said):
            export_policy(open_run(trained), folder)
