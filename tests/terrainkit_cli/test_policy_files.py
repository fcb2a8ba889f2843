"""The commands that run policies of strangers refuse those that do more than compute actions."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import onnx
from onnx import TensorProto, helper

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from fuzzing.escapes.torchscript import load_escapes


@pytest.mark.parametrize("command", ["evaluate", "play", "view", "check-policy"])
def test_commands_refuse_a_policy_that_writes(rejected, tmp_path, command):
    path, written = tmp_path / "policy.pt", tmp_path / "written"
    path.write_bytes(load_escapes()["setstate"].archive(written))
    given = (path,) if command == "check-policy" else ("--policy", path)
    message = rejected(command, *given, "--robot", "quadruped")
    assert "policy.pt is not a policy: got code with aten::save; expected a network" in message
    assert not written.exists()


def test_names_in_a_policy_do_not_reach_the_terminal(terrainkit, tmp_path):
    model = helper.make_model(
        helper.make_graph(
            [helper.make_node("Identity", ["obs"], ["actions"])],
            "policy",
            [helper.make_tensor_value_info("obs", TensorProto.FLOAT, ("n", 3))],
            [helper.make_tensor_value_info("actions", TensorProto.FLOAT, ("n", 3))],
        ),
        opset_imports=[helper.make_opsetid("", 17)],
        ir_version=8,
    )
    values = {"joint_names": "\x1b[2Ja,b,c", "observation_names": "actions"}
    values |= dict.fromkeys(("joint_stiffness", "joint_damping", "action_scale"), "1,1,1")
    values |= {"default_joint_pos": "0,0,0", "observation_terms_scale": "1"}
    helper.set_model_props(model, values)
    onnx.save(model, tmp_path / "policy.onnx")
    for words in (("check-policy",), ("evaluate", "--policy")):
        done = terrainkit(*words, tmp_path / "policy.onnx", "--robot", "quadruped")
        assert "\\x1b[2Ja" in done.stdout + done.stderr
        assert "\x1b" not in done.stdout + done.stderr
