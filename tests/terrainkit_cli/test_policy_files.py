"""The commands that run policies of strangers refuse those that do more than compute actions."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

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
