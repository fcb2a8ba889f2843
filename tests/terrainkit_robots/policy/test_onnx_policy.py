import json
import shutil
from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto, helper

from terrainkit.errors import ConfigError
from terrainkit_robots.policy.evaluate import EvaluationConfig, evaluate
from terrainkit_robots.policy.export import export_policy
from terrainkit_robots.policy.onnx_policy import OnnxPolicy, open_onnx
from terrainkit_robots.rl.config import Control, Env, Observations, Task, Terrain
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import PolicySpec, open_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.terrain import load_terrain

SMALL = Task(env=Env(num_threads=1))
SHORT = EvaluationConfig(num_envs=3, seconds=0.3, command=(0.5, 0.0, 0.2))


@pytest.fixture(scope="module")
def exported(trained_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports") / "policy"
    export_policy(open_run(trained_folder), folder)
    return folder


@pytest.fixture
def mine(exported, tmp_path):
    """An exported policy with another name, and its JSON."""
    path = tmp_path / "mine.onnx"
    shutil.copy(exported / "policy.onnx", path)
    shutil.copy(exported / "policy.json", tmp_path)
    return path


def change_json(path, **keys):
    """Replace values of the JSON beside a policy, by dotted key; `None` deletes one."""
    file = path.with_name("policy.json")
    document = json.loads(file.read_text())
    for key, value in keys.items():
        *parents, last = key.split("__")
        table = document
        for each in parents:
            table = table[each]
        table[last] = value
        if value is None:
            del table[last]
    file.write_text(json.dumps(document))


def test_exported_policy_is_evaluated_as_its_run(trained, mine):
    spec, result = open_onnx(mine, "quadruped"), json.loads(evaluate(trained, SHORT).as_json())
    outside = json.loads(evaluate(spec, SHORT).as_json())
    assert (result.pop("checkpoint"), outside.pop("checkpoint")) == ("model_2.pt", "mine.onnx")
    assert outside.pop("all") == pytest.approx(result.pop("all"), abs=1e-4)
    assert outside == result


@pytest.mark.parametrize("control_type", ["P", "V", "T"])
def test_environment_is_that_of_the_training(make_run, map_file, tmp_path, control_type):
    """Equal observations for equal actions, with every option, on the map of the training."""
    observations = Observations(base_lin_vel=True, foot_contact=True, history_length=2)
    control = Control(control_type=control_type, damping=1.5, decimation=2)
    terrain = Terrain(measured_points_x=(0.0, 0.3), measured_points_y=(-0.1, 0.1))
    parts = {"observations": observations, "control": control, "terrain": terrain}
    run = make_run(map_file, **parts)
    LeggedRunner(LeggedEnv(run.task, run.robot, load_terrain(map_file)), run.folder).save()
    run, seen = open_run(run.folder), []
    export_policy(run, tmp_path / "exported")
    spec = open_onnx(tmp_path / "exported" / "policy.onnx", "quadruped")

    def move(obs):
        seen.append(obs)
        return torch.sin(torch.arange(12) + obs[:, :1])

    for each in (run, spec):
        config = EvaluationConfig(terrain=str(map_file), num_envs=2, seconds=0.2)
        evaluate(replace(each, policy=move), config)
    steps = len(seen) // 2
    np.testing.assert_array_equal(torch.stack(seen[:steps]), torch.stack(seen[steps:]))


def test_functions_are_evaluated_in_place_of_a_checkpoint(trained, quadruped):
    def stand(obs):
        return np.zeros((len(obs), 12))

    for spec in (trained, PolicySpec(task=SMALL, robot=quadruped)):
        result = evaluate(replace(spec, policy=stand), SHORT)
        assert (result.checkpoint, result.metrics.falls) == ("stand", 0)
    with pytest.raises(ConfigError, match=r"shape of the actions: got \(3, 2\)"):
        evaluate(replace(spec, policy=lambda obs: obs[:, :2]), SHORT)
    with pytest.raises(ConfigError, match="policy: got none; expected a run, or a function"):
        evaluate(spec, SHORT)


def test_metadata_is_used_without_a_json_file(mine):
    mine.with_name("policy.json").unlink()
    assert open_onnx(mine, "quadruped").policy_name == "mine.onnx"


def test_json_replaces_gains_and_joint_order(mine):
    policy = json.loads(mine.with_name("policy.json").read_text())
    document = policy["joints"]
    order = np.roll(np.arange(12), 3)
    joints = {key: [value[k] for k in order] for key, value in document.items()}
    joints |= {"stiffness": [31.0] * 12, "gain": [31.0] * 12}
    action = policy["action"] | {"joints": joints["name"]}
    # The offsets of the observation have the old order.
    change_json(mine, joints=joints, action=action, observation=None)
    spec = open_onnx(mine, "quadruped").robot.spec
    assert list(spec.joint_order) == joints["name"]
    assert spec.per_joint("stiffness") == dict.fromkeys(joints["name"], 31.0)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"joints": None}, "missing required field `joints`"),
        ({"joints__name": ["a"] * 12}, "belongs to another robot: got a, a"),
        ({"joints__damping": [1.0]}, "joints.damping: got 1 values; expected one for each joint"),
        ({"joints__damping": ["x"] * 12}, "damping"),
        ({"joints__gain": [3.0] * 12}, "joints.gain.0: got 3.0; expected 60.0, as in task"),
        ({"timing__decimation": 5}, "timing.decimation: got 5; expected 4"),
        ({"task__commands": {"speed": 1}}, "task.commands has no key 'speed'"),
        ({"task__observations": {"foot_contact": True}}, "observation.size: got 47; expected 51"),
        (
            {"observation__parts": [{"name": "camera"}]},
            "parts.0.name: got camera; expected commands",
        ),
        ({"observation__parts": 3}, "observation.parts: got 3; the environment"),
        ({"format_version": 2}, "format_version: got 2; expected 1"),
    ],
)
def test_json_that_does_not_describe_the_environment_is_rejected(mine, keys, message):
    change_json(mine, **keys)
    with pytest.raises(ConfigError, match=message) as info:
        open_onnx(mine, "quadruped")
    assert str(info.value).startswith(str(mine.with_name("policy.json")))
    assert "\n" not in str(info.value)


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 100_000, "\ud800"])
def test_json_that_is_not_an_object_is_rejected(mine, text):
    mine.with_name("policy.json").write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(ConfigError, match=r"policy\.json: "):
        open_onnx(mine, "quadruped")


def test_unknown_part_of_the_observation_is_named(mine):
    observation = json.loads(mine.with_name("policy.json").read_text())["observation"]
    observation["parts"].append({"name": "camera", "start": 47, "stop": 50})
    change_json(mine, observation={**observation, "size": 50})
    with pytest.raises(ConfigError, match=r"observation\.parts\.7\.name: got camera; .* has no"):
        open_onnx(mine, "quadruped")


def test_policy_of_another_robot_is_rejected(mine):
    with pytest.raises(ConfigError, match=r"got FL_hip_joint, .* which biped lacks, .* left_hip"):
        open_onnx(mine, "biped")


def make_onnx(path, shape=("n", 47), size=12, op="MatMul", kind=TensorProto.FLOAT):
    """Write a linear policy, or a network of one other operation."""
    names = ["obs", "weight"] if op == "MatMul" else ["obs"]
    weight = helper.make_tensor("weight", TensorProto.FLOAT, (47, size), np.ones(47 * size))
    graph = helper.make_graph(
        [helper.make_node(op, names, ["out"])],
        "graph",
        [helper.make_tensor_value_info("obs", kind, shape)],
        [helper.make_tensor_value_info("out", kind, None)],
        [weight] if op == "MatMul" else [],
    )
    opset = [helper.make_opsetid("", 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=8), path)
    return path


def test_policy_with_a_batch_of_one_runs_row_by_row(tmp_path):
    policy = OnnxPolicy(make_onnx(tmp_path / "one.onnx", shape=(1, 47)))
    obs = torch.arange(3.0)[:, None] * torch.ones(47)
    np.testing.assert_allclose(policy(obs), 47 * np.arange(3)[:, None] * np.ones(12))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"shape": ("n", 3, 8, 8), "op": "Relu"}, "not a policy: got the inputs .*3, 8, 8"),
        ({"shape": (), "op": "Relu"}, "is not a policy"),
        ({"kind": TensorProto.INT64, "op": "Abs"}, "is not a policy"),
        ({"shape": (5, 47)}, "is not a policy"),
        ({"shape": ("n", "k")}, "is not a policy"),
        ({"shape": ("n", 45), "op": "Relu"}, "got 45 observations and 45 actions; expected 47 and"),
        ({"size": 10}, "got 47 observations and 10 actions; expected 47 and 12"),
    ],
)
def test_other_networks_are_rejected(mine, options, message):
    make_onnx(mine, **options)
    with pytest.raises(ConfigError, match=message):
        open_onnx(mine, "quadruped")


def test_files_that_cannot_be_read_are_rejected(mine, tmp_path):
    for path, message in (
        (tmp_path / "gone.onnx", "cannot read .*gone"),
        (tmp_path, "cannot read .*a folder"),
        (mine.with_name("policy.json"), "is not an ONNX file"),
    ):
        with pytest.raises(ConfigError, match=message):
            open_onnx(path, "quadruped")
    mine.with_name("policy.json").unlink()
    make_onnx(mine)
    with pytest.raises(ConfigError, match=r"no policy\.json beside it, nor in its metadata"):
        open_onnx(mine, "quadruped")
