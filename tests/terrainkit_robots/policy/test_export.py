import json
import runpy
import shutil
import sys
import warnings
from dataclasses import replace

import mujoco
import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from tensordict import TensorDict

from terrainkit.errors import ExportError
from terrainkit_robots.policy import export as module
from terrainkit_robots.policy.contracts.policy_json import METADATA_KEY
from terrainkit_robots.policy.evaluate import EvaluationConfig, build_eval_env, eval_task
from terrainkit_robots.policy.export import (
    describe_policy,
    export_policy,
    observation_order,
)
from terrainkit_robots.policy.load_policy import load_policy
from terrainkit_robots.policy.open_policy import open_policy
from terrainkit_robots.policy.policy_rollout import rollout
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.config import Control, Env, Observations, Policy, Task
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import create_run, open_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.terrain import Plane
from terrainkit_robots.spec.robot_arrays import Robot

FILES = ["policy.json", "policy.onnx", "policy.pt", "robot.xml"]
EXAMPLE = "run_policy.py"
SMALL = Task(env=Env(num_envs=4, num_threads=1), observations=Observations(history_length=1))


@pytest.fixture(scope="module")
def exported(trained_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports") / "policy"
    result = export_policy(open_run(trained_folder), folder, example=True)
    assert max(result.errors) <= 1e-5
    return folder


@pytest.fixture(scope="module")
def samples(trained_folder):
    """Observations of a rollout and random ones, and the clipped actions of the checkpoint."""
    run = open_run(trained_folder)
    env = LeggedEnv(replace(run.task, env=Env(num_envs=20, num_threads=1)), run.robot, Plane())
    policy = load_policy(run, env)
    steps = (env.get_observations()["policy"] for _ in rollout(env, policy, [None] * 20))
    visited = torch.cat(list(steps))
    random = 3 * torch.randn(visited.shape, generator=torch.Generator().manual_seed(3))
    obs = torch.cat([visited, random])
    with torch.inference_mode():
        actions = policy(TensorDict({"policy": obs}, [len(obs)])).clamp(-0.3, 0.3)
    return obs.numpy(), actions.numpy()


@pytest.mark.parametrize("batch", [1, 7, 800])
@pytest.mark.parametrize("name", ["policy.onnx", "policy.pt"])
def test_exported_policy_acts_as_the_checkpoint(exported, samples, name, batch):
    if name == "policy.onnx":
        session = onnxruntime.InferenceSession(exported / name, providers=["CPUExecutionProvider"])

        def policy(obs):
            return session.run(None, {"obs": obs})[0]
    else:
        with warnings.catch_warnings():  # torch 2.9 and newer: deprecated
            warnings.simplefilter("ignore")
            script = torch.jit.load(exported / name)

        def policy(obs):
            return script(torch.from_numpy(obs)).detach().numpy()

    obs, actions = samples
    for start in range(0, len(obs), max(batch, len(obs) // 8)):
        part = slice(start, start + batch)
        np.testing.assert_allclose(policy(obs[part]), actions[part], atol=1e-5, rtol=0)


def test_onnx_file_is_valid_and_holds_the_json(exported):
    model = onnx.load(exported / "policy.onnx")
    onnx.checker.check_model(model, full_check=True)
    metadata = {each.key: each.value for each in model.metadata_props}
    assert metadata[METADATA_KEY] == (exported / "policy.json").read_text()


def test_json_describes_the_policy(exported):
    config = json.loads((exported / "policy.json").read_text())
    assert (config["format_version"], config["iteration"]) == (2, 2)
    assert config["robot"]["name"] == "quadruped"
    assert config["timing"] == {"physics_dt": 0.005, "decimation": 4, "policy_dt": 0.02}
    joints = config["joints"]["name"]
    assert config["action"] == {"size": 12, "clip": 0.3, "joints": joints}
    parts = config["observation"]["parts"]
    names = "commands projected_gravity base_ang_vel dof_pos dof_vel actions gait_phase"
    assert [part["name"] for part in parts] == names.split()
    assert config["gait"] == {"period": pytest.approx(0.49151), "min_yaw_rate": 0.1}
    assert (parts[0]["scale"], parts[4]["unit"]) == ([2, 2, 0.25], ["rad/s"] * 12)
    assert parts[-1]["stop"] == config["observation"]["size"] == 47
    assert config["height_scan"] is None
    assert config["joints"]["armature"] == [0.01] * 12
    assert config["joints"]["frictionloss"] == [0.0] * 12  # asset.joint_friction is off
    assert config["joints"]["passive_damping"] == [0.1] * 12
    assert config["contact"] == {"friction": 0.8}
    assert config["task"]["domain_rand"]["friction"] == [0.3, 1.25]


@pytest.mark.parametrize("wheels", [False, True])
@pytest.mark.parametrize(
    ("control_type", "drive"), [("P", "position"), ("V", "velocity"), ("T", "torque")]
)
def test_json_reproduces_the_torques(quadruped, wheels, control_type, drive):
    robot = quadruped
    if wheels:  # a joint without stiffness is driven by velocity
        stiffness = robot.spec.per_joint("stiffness") | {robot.spec.joint_order[0]: 0.0}
        robot = Robot.from_spec(replace(robot.spec, stiffness=stiffness), robot.mjcf.parent)
    control = Control(control_type=control_type, damping=1.5)
    env = LeggedEnv(eval_task(replace(SMALL, control=control), 1), robot, Plane())
    config = describe_policy(env)
    joints = {name: np.array(value) for name, value in config["joints"].items()}
    assert config["control_type"] == control_type
    first = "velocity" if wheels and control_type == "P" else drive
    assert joints["drive"].tolist() == [first] + [drive] * 11
    scene, model, data = env.scene, env.scene.model, mujoco.MjData(env.scene.model)
    assert [model.actuator(k).name for k in range(model.nu)] == joints["name"].tolist()
    rng, num_clipped = np.random.default_rng(1), 0
    for _ in range(10):
        action = rng.normal(0, 2, 12).astype(np.float32)
        data.qpos[scene.joint_qpos] = rng.normal(0, 0.5, 12)
        data.qvel[scene.joint_qvel] = rng.normal(0, 5, 12)
        data.ctrl[:] = env.to_ctrl(action[None])[0]
        with quiet_mujoco():
            mujoco.mj_forward(model, data)
        target = joints["action_offset"] + joints["action_scale"] * action
        torque = joints["gain"] * target
        torque -= joints["stiffness"] * data.qpos[scene.joint_qpos]
        torque -= joints["damping"] * data.qvel[scene.joint_qvel]
        clipped = np.clip(torque, -joints["effort"], joints["effort"])
        np.testing.assert_allclose(data.actuator_force, clipped, rtol=1e-5, atol=1e-4)
        num_clipped += (clipped != torque).sum()
    assert num_clipped > 0


def run_example(folder, monkeypatch, *words):
    """Run the program of an exported folder, and return its variables."""
    program = str(folder / "run_policy.py")
    monkeypatch.setattr(sys, "argv", [program, *words])
    with quiet_mujoco():
        return runpy.run_path(program)


# The first steps of the biped turn it.
@pytest.mark.parametrize(
    ("name", "sideways"),
    [("quadruped", 0.3), ("quadruped_hard", 0.3), ("quadruped_map", 0.3), ("biped", 0.5)],
)
def test_example_walks_with_bundled_policies(name, sideways, tmp_path, monkeypatch, capsys):
    export_policy(open_run(name), tmp_path / "exported", example=True)
    names = run_example(tmp_path / "exported", monkeypatch, "--vx", "0.5", "--seconds", "3")
    data = names["data"]
    assert data.time == pytest.approx(3)
    assert data.qpos[0] > 0.9  # of 1.5 m
    assert abs(data.qpos[1]) < sideways
    assert names["rotation"][2, 2] > 0.9
    distance = np.hypot(*data.qpos[:2])
    first, second = capsys.readouterr().out.splitlines()
    assert first == f"distance: {distance:.2f} m in 3.00 s"
    assert float(second.split()[2]) == pytest.approx(distance / 3, abs=0.05)


def test_joints_without_action(held_calves, tmp_path, monkeypatch):
    run = create_run(tmp_path / "run", SMALL, held_calves, "plane")
    env = LeggedEnv(eval_task(run.task, 1), run.robot, Plane())
    LeggedRunner(LeggedEnv(run.task, run.robot, Plane()), run.folder).learn(1)
    folder = tmp_path / "exported"
    result = export_policy(open_run(run.folder), folder, example=True)
    assert (result.num_observations, result.num_actions) == (43, 8)
    names = run_example(folder, monkeypatch, "--seconds", "0.02")
    action = names["config"]["action"]
    assert action["joints"] == [k for k in run.robot.spec.joint_order if "calf" not in k]
    # The same observation and targets as in the environment.
    obs = names["observe"](np.zeros(3), np.zeros(8), np.eye(3))
    assert obs.shape == (43,)
    expected = env.to_ctrl(names["action"][None])[0]
    np.testing.assert_allclose(names["target"], expected, atol=1e-6)
    assert open_policy(folder / "policy.onnx", held_calves).policy.policy.num_actions == 8


def test_example_computes_the_observations(exported, trained, monkeypatch):
    names = run_example(exported, monkeypatch, "--seconds", "0.02")
    task = replace(trained.task, observations=Observations(base_lin_vel=True))
    env = LeggedEnv(eval_task(task, 1), trained.robot, Plane())
    names["config"] |= describe_policy(env)
    env.set_commands(np.array([[0.5, -0.2, 0.3]], np.float32))
    for value in (0.1, -0.3):
        env.step(torch.full((1, 12), value))
    model, data = names["model"], names["data"]
    assert model.nq == env.sim.qpos.shape[1]
    data.qpos[:], data.qvel[:], data.time = env.sim.qpos[0], env.sim.qvel[0], 2 * env.cfg.dt
    rotation = names["rotation"]
    mujoco.mju_quat2Mat(rotation.reshape(9), data.qpos[3:7])
    obs = names["observe"](env.commands[0], env.action_history[0, 0], rotation)
    np.testing.assert_allclose(obs, env.get_observations()["policy"][0], atol=1e-4)


def test_example_observes_contacts_as_the_training(quadruped, trained, tmp_path, monkeypatch):
    """The training reads contact sensors, the example `cfrc_ext`."""
    options = Observations(foot_contact=True, history_length=1)
    task = replace(eval_task(SMALL, 1), observations=options)
    env = LeggedEnv(task, quadruped, Plane())
    config = describe_policy(env)
    assert config["feet"] == {"name": list(quadruped.spec.feet), "contact_force": 1.0}
    export_policy(trained, tmp_path / "exported", example=True)
    names = run_example(tmp_path / "exported", monkeypatch, "--seconds", "0.02")
    scene, data = env.scene, mujoco.MjData(env.scene.model)
    contact = {**config["observation"]["parts"][-1], "start": 0, "stop": 4}
    names["config"] |= {**config, "observation": {"parts": [contact]}}
    names["observe"].__globals__.update(model=scene.model, data=data)
    feet, seen = [scene.model.body(name).id for name in config["feet"]["name"]], []
    generator = torch.Generator().manual_seed(0)
    for _ in range(40):
        data.qpos[:], data.qvel[:] = env.sim.qpos[0], env.sim.qvel[0]
        env.step(0.5 * torch.randn(1, 12, generator=generator))
        data.ctrl[:] = env.to_ctrl(env.action_history[0])[0]
        mujoco.mj_step(scene.model, data, task.control.decimation)
        observed = names["observe"](np.zeros(3), np.zeros(12), np.eye(3))
        np.testing.assert_array_equal(observed, env.state.foot_contact[0])
        np.testing.assert_allclose(data.cfrc_ext[feet, 3:], env.state.foot_force[0], atol=1e-3)
        seen += observed.tolist()
    assert 0.1 < np.mean(seen) < 0.95


def test_exported_policy_with_a_history(make_run, tmp_path, monkeypatch):
    run = make_run(observations=Observations(base_lin_vel=True, history_length=3))
    LeggedRunner(LeggedEnv(run.task, run.robot, Plane()), run.folder).learn(1)
    result = export_policy(open_run(run.folder), tmp_path / "exported", example=True)
    assert max(result.errors) <= 1e-5
    assert result.num_observations == 150
    names = run_example(tmp_path / "exported", monkeypatch, "--seconds", "0.04")
    parts = names["config"]["observation"]["parts"]
    assert [(part["start"], part["stop"]) for part in parts[:2]] == [(0, 9), (9, 18)]
    assert {part["history"] for part in parts} == {3}
    past, args = {}, (names["action"], np.eye(3))
    observed = [names["observe"](np.array([vx, 0, 0]), *args, past) for vx in (1.0, 0.5, 0.25)]
    scale = parts[0]["scale"][0]
    for obs, seen in zip(observed, ([1, 1, 1], [1, 1, 0.5], [1, 0.5, 0.25]), strict=True):
        assert obs[[0, 3, 6]].tolist() == [scale * each for each in seen]  # the oldest first
    # The exported network sees what the environment observes in its own order.
    env = build_eval_env(open_run(run.folder), Plane(), 2, EvaluationConfig())
    order = observation_order(env)
    assert sorted(order) == list(range(150))
    assert order[:9].tolist() == [100, 101, 102, 50, 51, 52, 0, 1, 2]


def test_exported_estimator_has_si_units(make_run, tmp_path):
    run = make_run(policy=Policy(estimator_hidden_dims=(8,)))
    runner = LeggedRunner(LeggedEnv(run.task, run.robot, Plane()), run.folder)
    runner.learn(1)
    result = export_policy(open_run(run.folder), tmp_path / "exported")
    assert tmp_path / "exported" / "estimator.onnx" in result.files
    described = json.loads((tmp_path / "exported" / "policy.json").read_text())["estimator"]
    assert described == {
        "file": "estimator.onnx",
        "parts": [
            {"name": "base_lin_vel", "start": 0, "stop": 3, "unit": "m/s"},
            {"name": "foot_contact", "start": 3, "stop": 7, "unit": "1"},
        ],
    }
    obs = runner.env.get_observations()
    session = onnxruntime.InferenceSession(tmp_path / "exported" / "estimator.onnx")
    exported = obs["policy"].numpy()[:, observation_order(runner.env)]
    estimates = session.run(["estimates"], {"obs": exported})[0]
    # The task observes velocities times 2.
    runner.alg.actor.eval()
    expected = runner.alg.actor.estimate(obs).detach().numpy() / [2, 2, 2, 1, 1, 1, 1]
    np.testing.assert_allclose(estimates, expected, atol=1e-5)


def test_example_has_the_joints_and_friction_of_the_training(exported, trained, monkeypatch):
    model = run_example(exported, monkeypatch, "--seconds", "0.02")["model"]
    env = LeggedEnv(eval_task(trained.task, 1), trained.robot, Plane())
    scene, joints = env.scene.model, trained.robot.spec.joint_order
    for name in ("dof_armature", "dof_frictionloss", "dof_damping"):
        expected = [getattr(scene, name)[scene.joint(joint).dofadr[0]] for joint in joints]
        values = [getattr(model, name)[model.joint(joint).dofadr[0]] for joint in joints]
        np.testing.assert_allclose(values, expected)
    plane = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    assert model.geom_friction[plane, 0] == pytest.approx(0.8)


def test_example_ends_when_the_robot_has_tilted_by_60_degrees(exported, monkeypatch):
    monkeypatch.setattr(mujoco, "mju_quat2Mat", lambda turn, _: turn.fill(0.51))
    run_example(exported, monkeypatch, "--seconds", "0.02")
    monkeypatch.setattr(mujoco, "mju_quat2Mat", lambda turn, _: turn.fill(0.49))
    with pytest.raises(SystemExit, match=r"^fell after 0\.02 s$"):
        run_example(exported, monkeypatch)


@pytest.mark.parametrize("changed", [{"name": "camera"}, {"stop": 4}])
def test_example_rejects_unknown_observations(exported, tmp_path, monkeypatch, changed):
    shutil.copytree(exported, tmp_path, dirs_exist_ok=True)
    config = json.loads((tmp_path / "policy.json").read_text())
    config["observation"]["parts"][0] |= changed
    (tmp_path / "policy.json").write_text(json.dumps(config))
    name = changed.get("name", "commands")
    with pytest.raises(SystemExit, match=f"observation {name}: unknown; define it in a file"):
        run_example(tmp_path, monkeypatch)


def test_json_describes_the_height_scan(quadruped, map_terrain):
    config = describe_policy(LeggedEnv(SMALL, quadruped, map_terrain))
    scan, part = config["height_scan"], config["observation"]["parts"][-1]
    x, y = SMALL.terrain.measured_points_x, SMALL.terrain.measured_points_y
    assert scan["points"] == [[a, b] for a in x for b in y]
    assert [part[key] for key in ("start", "stop", "unit", "clip")] == [47, 234, "m", [-1, 1]]
    assert (part["offset"], part["scale"]) == ([0.5] * 187, [5.0] * 187)


def test_example_sees_a_plane_in_the_height_scan(exported, monkeypatch):
    names = run_example(exported, monkeypatch, "--seconds", "0.02")
    scan = {"name": "height_scan", "start": 0, "stop": 3, "history": 1, "offset": 0.3, "scale": 5}
    names["config"]["height_scan"] = {"points": [[0, 0], [0.1, 0], [0.2, 0]]}
    names["config"]["observation"]["parts"] = [scan | {"clip": [-1, 1]}]
    names["data"].qpos[2] = 0.4
    np.testing.assert_allclose(names["observe"](np.zeros(3), 0, np.eye(3)), [0.5] * 3, atol=1e-6)


def test_export_policy_of_a_large_task(trained, tmp_path):
    algorithm = replace(trained.task.algorithm, num_mini_batches=512)
    task = replace(trained.task, env=Env(num_envs=4096), algorithm=algorithm)
    result = export_policy(replace(trained, task=task), tmp_path / "policy")
    assert (result.num_observations, result.num_actions) == (47, 12)


def test_export_policy_overwrites_only_if_told(trained, exported, tmp_path):
    folder = tmp_path / "policy"
    shutil.copytree(exported, folder)
    (folder / "policy.pt").unlink()
    (folder / "notes.txt").write_text("mine")
    (folder / "policy.onnx").write_bytes(b"before")
    for target, message in (
        (folder, r"policy\.onnx exists"),
        (folder / "notes.txt", "exists"),
        (folder / "notes.txt" / "b", "not a folder"),
    ):
        with pytest.raises(ExportError, match=message):
            export_policy(trained, target)
    assert (folder / "policy.onnx").read_bytes() == b"before"
    assert not (folder / "policy.pt").exists()
    export_policy(trained, folder, example=True, overwrite=True)
    assert (folder / "policy.json").read_bytes() == (exported / "policy.json").read_bytes()
    assert sorted(path.name for path in folder.iterdir()) == ["notes.txt", *FILES, EXAMPLE]


@pytest.mark.parametrize(("owner", "name"), [(module, "export_onnx"), (torch.jit, "save")])
def test_export_policy_rejects_other_actions(trained, tmp_path, monkeypatch, owner, name):
    export = getattr(owner, name)

    def export_wrong(policy, *rest):
        with torch.no_grad():
            policy.model.mlp[-1].bias += 1e-3
        result = export(policy, *rest)
        with torch.no_grad():
            policy.model.mlp[-1].bias -= 1e-3
        return result

    monkeypatch.setattr(owner, name, export_wrong)
    with pytest.raises(ExportError, match=r"off the live policy by 0\.001"):
        export_policy(trained, tmp_path / "policy")
    assert list(tmp_path.iterdir()) == []
