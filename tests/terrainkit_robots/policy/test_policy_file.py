import json
import shutil
import signal
import threading
from dataclasses import replace
from functools import partial

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto, helper, numpy_helper

from terrainkit.errors import ConfigError
from terrainkit.files.child_process import ProcessLimits
from terrainkit_robots.policy import policy_file
from terrainkit_robots.policy.evaluate import EvaluationConfig, evaluate
from terrainkit_robots.policy.export import export_policy
from terrainkit_robots.policy.open_policy import open_policy
from terrainkit_robots.policy.policy_file import PolicyFile
from terrainkit_robots.rl.config import Control, Env, Observations, Task, Terrain
from terrainkit_robots.rl.env import LeggedEnv
from terrainkit_robots.rl.run import PolicySpec, open_run
from terrainkit_robots.rl.runner import LeggedRunner
from terrainkit_robots.rl.terrain import load_terrain
from tests.child_functions import odd_policy
from tests.tables import read_table

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
    spec, result = open_policy(mine, "quadruped"), json.loads(evaluate(trained, SHORT).to_json())
    outside = json.loads(evaluate(spec, SHORT).to_json())
    assert (result.pop("checkpoint"), outside.pop("checkpoint")) == ("model_2.pt", "mine.onnx")
    assert (outside.pop("all"), outside) == (pytest.approx(result.pop("all"), abs=1e-4), result)


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
    spec = open_policy(tmp_path / "exported" / "policy.onnx", "quadruped")

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
        assert (result.about["checkpoint"], result.about["all"].falls) == ("stand", 0)
    with pytest.raises(ConfigError, match=r"shape of the actions: got \(3, 2\)"):
        evaluate(replace(spec, policy=lambda obs: obs[:, :2]), SHORT)
    with pytest.raises(ConfigError, match="policy: got none; expected a run, or a function"):
        evaluate(spec, SHORT)


def test_metadata_is_used_without_a_json_file(mine):
    mine.with_name("policy.json").unlink()
    assert open_policy(mine, "quadruped").policy_name == "mine.onnx"


def test_json_replaces_gains_and_joint_order(mine):
    policy = json.loads(mine.with_name("policy.json").read_text())
    document = policy["joints"]
    order = np.roll(np.arange(12), 3)
    joints = {key: [value[k] for k in order] for key, value in document.items()}
    joints |= {"stiffness": [31.0] * 12, "gain": [31.0] * 12}
    action = policy["action"] | {"joints": joints["name"]}
    # The offsets of the observation have the old order.
    change_json(mine, joints=joints, action=action, observation=None)
    spec = open_policy(mine, "quadruped").robot.spec
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
        ({"task__observations": {"foot_contact": True}}, "parts.0.stop: got 3; expected 9"),
        ({"observation__parts": [{"name": "camera"}]}, "parts.0.name: got camera; expected comm"),
        ({"observation__parts": 3}, "observation.parts: got 3; the environment"),
        ({"format_version": 1}, "format_version: got 1; expected 2"),
        ({"joints__name": [{}] * 12}, "Expected .*, got `object`"),
        ({"timing__physics_dt": 10**400}, "timing.physics_dt: got 1000000.*; expected 0.005"),
        ({"task__sim": {"dt": 1e-300}}, "sim.dt: got 1e-300, which is below 1e-12"),
        ({"task__commands": {"resampling_time": 1e39}}, r"got 1e\+39, which is beyond"),
    ],
)
def test_json_that_does_not_describe_the_environment_is_rejected(mine, keys, message):
    change_json(mine, **keys)
    with pytest.raises(ConfigError, match=message) as info:
        open_policy(mine, "quadruped")
    assert str(info.value).startswith(str(mine.with_name("policy.json")))
    assert "\n" not in str(info.value)


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 100_000, "\ud800", "\xff"])
def test_json_that_is_not_an_object_is_rejected(mine, text):
    encoding = "latin-1" if text == "\xff" else "utf-8"
    mine.with_name("policy.json").write_bytes(text.encode(encoding, "surrogatepass"))
    with pytest.raises(ConfigError, match=r"policy\.json: "):
        open_policy(mine, "quadruped")


def test_policy_of_another_robot_is_rejected(mine):
    with pytest.raises(ConfigError, match=r"got FL_hip_joint, .* which biped lacks, .* left_hip"):
        open_policy(mine, "biped")


FLOAT, INT64, BOOL = TensorProto.FLOAT, TensorProto.INT64, TensorProto.BOOL


def node(op, inputs, output, **attributes):
    """Return a node whose inputs are the words of a text."""
    return helper.make_node(op, inputs.split(), [output], **attributes)


def make_onnx(path, shape=("n", 47), size=12, op="MatMul", kind=FLOAT, nodes=(), save=onnx.save):
    """Write a linear policy with some nodes before it, or a network of one other operation."""
    names = ["obs", "weight"] if op == "MatMul" else ["obs"]
    weight = numpy_helper.from_array(np.ones((47, size), np.float32), "weight")
    names[0] = "before" if nodes else "obs"
    graph = helper.make_graph(
        [*nodes, helper.make_node(op, names, ["out"])],
        "graph",
        [helper.make_tensor_value_info("obs", kind, shape)],
        [helper.make_tensor_value_info("out", kind, None)],
        [weight] if op == "MatMul" else [],
    )
    opset = [helper.make_opsetid("", 17)]
    save(helper.make_model(graph, opset_imports=opset, ir_version=8), path)
    return path


def endless_loop():
    """Nodes whose output `before` is `obs`, after a loop that ends only if all `obs` are 0."""
    nodes = [node("Identity", "go_on", "again"), node("Identity", "old", "new")]
    value = partial(helper.make_tensor_value_info, shape=[])
    inputs = [value("index", INT64), value("go_on", BOOL), value("old", FLOAT)]
    body = helper.make_graph(nodes, "body", inputs, [value("again", BOOL), value("new", FLOAT)])
    return [
        node("ReduceSumSquare", "obs", "sum", keepdims=0),
        node("Cast", "sum", "is_moving", to=BOOL),
        helper.make_node("Loop", ["", "is_moving", "sum"], ["same"], body=body),
        node("Sub", "same sum", "zero"),
        node("Add", "obs zero", "before"),
    ]


def memory_bomb():
    """Nodes whose output `before` is `obs`, after 100 GB of numbers unless all `obs` are 0."""
    return [
        node("Constant", "", "count", value=helper.make_tensor("count", FLOAT, (1,), [25e9])),
        node("ReduceMax", "obs", "largest", keepdims=0),
        node("Mul", "count largest", "product"),
        node("Cast", "product", "size", to=INT64),
        node("ConstantOfShape", "size", "zeros"),
        node("ReduceSum", "zeros", "sum", keepdims=0),
        node("Add", "obs sum", "before"),
    ]


def test_first_call_that_does_not_end_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(policy_file, "LIMITS", ProcessLimits(seconds=5.0))
    one = node("Constant", "", "one", value=helper.make_tensor("one", FLOAT, (), [1.0]))
    always = [one, node("Add", "obs one", "shifted"), *endless_loop()]
    always[2].input[0] = "shifted"
    path = make_onnx(tmp_path / "always.onnx", nodes=always)
    with pytest.raises(ConfigError, match=r"always\.onnx is not a policy: takes more than 5 s"):
        PolicyFile(path)


def test_later_call_that_does_not_end_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(policy_file, "LIMITS", ProcessLimits(seconds=5.0))
    policy = PolicyFile(make_onnx(tmp_path / "later.onnx", nodes=endless_loop()))
    assert policy(torch.zeros(2, 47)).shape == (2, 12)
    with pytest.raises(ConfigError, match=r"later\.onnx: takes more than 5 s"):
        policy(torch.ones(2, 47))


def test_signal_ends_a_call(tmp_path):
    policy = PolicyFile(make_onnx(tmp_path / "later.onnx", nodes=endless_loop()))
    main = threading.main_thread().ident
    threading.Timer(0.5, lambda: signal.pthread_kill(main, signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        policy(torch.ones(2, 47))


def test_memory_of_a_call_is_limited(tmp_path):
    policy = PolicyFile(make_onnx(tmp_path / "bomb.onnx", nodes=memory_bomb()))
    assert policy(torch.zeros(2, 47)).shape == (2, 12)
    with pytest.raises(ConfigError, match=r"bomb\.onnx: needs too much memory"):
        policy(torch.ones(2, 47))


def save_with_data(model, path, location="weights.bin"):
    """Save a model whose weight is in another file, and change the location afterward."""
    onnx.save(model, path, save_as_external_data=True, location="weights.bin", size_threshold=0)
    saved = onnx.load(path, load_external_data=False)
    (entry,) = (e for e in saved.graph.initializer[0].external_data if e.key == "location")
    entry.value = location
    path.write_bytes(saved.SerializeToString())


def test_external_data_is_read_beside_the_model(tmp_path, monkeypatch):
    (tmp_path / "model").mkdir()
    path = make_onnx(tmp_path / "model" / "mine.onnx", save=save_with_data)
    monkeypatch.chdir(tmp_path)
    for given in (path, path.relative_to(tmp_path)):
        np.testing.assert_allclose(PolicyFile(given)(torch.ones(1, 47)), np.full((1, 12), 47))


@pytest.mark.parametrize("location", ["../weights.bin", "{}/weights.bin", "link.bin", "here.bin"])
def test_external_data_elsewhere_is_rejected(tmp_path, monkeypatch, location):
    folder = tmp_path / "model"
    folder.mkdir()
    save = partial(save_with_data, location=location.format(tmp_path))
    path = make_onnx(folder / "mine.onnx", save=save)
    (folder / "weights.bin").rename(tmp_path / "weights.bin")
    (folder / "link.bin").symlink_to(tmp_path / "weights.bin")
    (tmp_path / "here.bin").write_bytes((tmp_path / "weights.bin").read_bytes())
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="not an ONNX file that can be loaded") as info:
        PolicyFile(path)
    assert "\n" not in str(info.value)


def test_external_data_of_sparse_tensors_is_rejected(tmp_path, monkeypatch):
    def save(model, path):
        values = helper.make_tensor("sparse", TensorProto.FLOAT, (3,), np.ones(3))
        indices = helper.make_tensor("indices", TensorProto.INT64, (3,), [0, 1, 2])
        sparse = helper.make_sparse_tensor(values, indices, [564])
        sparse.values.ClearField("float_data")
        sparse.values.data_location = TensorProto.EXTERNAL
        sparse.values.external_data.add(key="location", value="here.bin")
        model.graph.sparse_initializer.append(sparse)
        onnx.save(model, path)

    (tmp_path / "here.bin").write_bytes(bytes(12))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="not an ONNX file that can be loaded"):
        PolicyFile(make_onnx(tmp_path / "mine.onnx", save=save))


@pytest.mark.parametrize("part", ["key", "value", "input"])
def test_text_that_is_not_utf8_is_rejected(tmp_path, part):
    path = make_onnx(tmp_path / "mine.onnx")
    model = onnx.load(path)
    model.metadata_props.add(key="@@key@@", value="@@value@@")
    model.graph.input[0].name = model.graph.node[0].input[0] = "@@input@@"
    marker = f"@@{part}@@".encode()
    path.write_bytes(model.SerializeToString().replace(marker, b"\xff" * len(marker)))
    with pytest.raises(ConfigError, match=r"mine\.onnx is not a policy: .*utf-8"):
        PolicyFile(path)


def test_policy_with_a_batch_of_one_runs_row_by_row(tmp_path):
    policy = PolicyFile(make_onnx(tmp_path / "one.onnx", shape=(1, 47)))
    obs = torch.arange(3.0)[:, None] * torch.ones(47)
    np.testing.assert_allclose(policy(obs), 47 * np.arange(3)[:, None] * np.ones(12))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        *read_table(__file__, "other_networks_are_rejected"),
        ({"kind": TensorProto.INT64, "op": "Abs"}, r"got the outputs tensor\(int64\); expected"),
        ({"kind": TensorProto.STRING, "op": "Identity"}, r"got the outputs tensor\(string\)"),
    ],
)
def test_other_networks_are_rejected(mine, options, message):
    make_onnx(mine, **options)
    with pytest.raises(ConfigError, match=message):
        open_policy(mine, "quadruped")


def test_files_that_cannot_be_read_are_rejected(mine, tmp_path):
    for path, message in (
        (tmp_path / "gone.onnx", "cannot read .*gone"),
        (tmp_path, "cannot read .*a folder"),
        (mine.with_name("policy.json"), r"policy\.json is not a policy: not an ONNX file"),
    ):
        with pytest.raises(ConfigError, match=message):
            open_policy(path, "quadruped")
    mine.with_name("policy.json").unlink()
    make_onnx(mine)
    with pytest.raises(ConfigError, match=r"no policy\.json or deploy\.yaml beside it"):
        open_policy(mine, "quadruped")


def test_evaluation_starts_without_the_state_of_another(trained):
    masks = []

    class Stand:
        __name__ = "stand"

        def __call__(self, obs):
            return np.zeros((len(obs), 12))

        def reset(self, dones):
            masks.append(dones.tolist())

    evaluate(replace(trained, policy=Stand()), SHORT)
    assert masks[0] == [True] * SHORT.num_envs


SIZES = {"sizes": [47, 12], "metadata": "{}"}


@pytest.mark.parametrize("first", read_table(__file__, "odd_first_answer_is_an_error"))
def test_odd_first_answer_is_an_error(tmp_path, monkeypatch, first):
    monkeypatch.setattr(policy_file, "run_model", partial(odd_policy, first=first, second={}))
    with pytest.raises(ConfigError, match=r"mine\.onnx is not a policy: "):
        PolicyFile(make_onnx(tmp_path / "mine.onnx"))


@pytest.mark.parametrize(
    "second",
    [
        {},
        {"other": np.zeros((2, 12))},
        {"actions": np.zeros((1, 12))},
        {"actions": np.zeros(24)},
        {"actions": np.zeros((2, 12), int)},
        {"actions": np.full((2, 12), "a")},
    ],
)
def test_odd_answer_is_an_error(tmp_path, monkeypatch, second):
    monkeypatch.setattr(policy_file, "run_model", partial(odd_policy, first=SIZES, second=second))
    policy = PolicyFile(make_onnx(tmp_path / "mine.onnx"))
    with pytest.raises(ConfigError, match=r"^mine\.onnx: "):
        policy(torch.zeros(2, 47))


def test_reset_is_for_the_environment_of_the_next_call(tmp_path):
    """`check-policy` uses a policy in environments with different numbers of robots."""
    policy = PolicyFile(make_onnx(tmp_path / "mine.onnx"))
    policy.reset(torch.tensor([True, False]))
    policy.reset(torch.tensor([False, True, False]))
    assert policy(torch.zeros(3, 47)).shape == (3, 12)


def test_type_of_a_file_is_found_by_its_content(exported, tmp_path):
    shutil.copy(exported / "policy.pt", tmp_path / "policy.jit")
    assert PolicyFile(tmp_path / "policy.jit").num_actions == 12
