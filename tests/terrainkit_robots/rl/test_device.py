import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")

import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.rl.runner import resolve_device


@pytest.mark.parametrize("name", ["cpu", "cpu:0"])
def test_the_cpu_is_always_there(name):
    assert resolve_device(name) == "cpu"


@pytest.mark.parametrize("name", ["gpu", "abacus", "", "meta", "cuda:99", "cuda:-1"])
def test_what_is_not_there_is_told_with_what_is(name):
    with pytest.raises(ConfigError, match=f"device '{name}'; here there is: cpu"):
        resolve_device(name)


@pytest.mark.parametrize(("name", "there"), [("cuda", True), ("cuda:1", True), ("cuda:2", False)])
def test_gpus_are_counted(monkeypatch, name, there):
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    if there:
        assert resolve_device(name) == name
    else:
        with pytest.raises(ConfigError, match="'cuda:2'; here there is: cpu, cuda:0, cuda:1"):
            resolve_device(name)
