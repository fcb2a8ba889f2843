import pickle
import resource
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.rl.run import policy_state, read_checkpoint, save_checkpoint


@pytest.fixture
def state() -> dict[str, Any]:
    return {
        "iteration": 7,
        "robot": "rover",
        "joints": ["front", "rear"],
        "observed": {"policy": 3},
        "actor_state_dict": {"weight": torch.arange(6.0).reshape(2, 3)},
        "critic_state_dict": {"weight": torch.ones(1)},
        "processes": [{"rng": {"state": 2**127 + 1}, "levels": np.arange(4), "pair": (1.5, 2.5)}],
    }


def test_what_is_saved_is_read(tmp_path, state):
    save_checkpoint(tmp_path / "model.pt", state)
    read = read_checkpoint(tmp_path / "model.pt")
    assert read["iteration"] == 7
    assert read["joints"] == ["front", "rear"]
    torch.testing.assert_close(read["actor_state_dict"], state["actor_state_dict"], rtol=0, atol=0)
    (mine,) = read["processes"]
    assert mine["rng"]["state"] == 2**127 + 1
    assert mine["levels"].tolist() == [0, 1, 2, 3]
    assert mine["pair"] == [1.5, 2.5]


def test_a_view_does_not_drag_along_what_it_looks_at(tmp_path, state):
    large = torch.zeros(1_000_000)
    save_checkpoint(tmp_path / "model.pt", state | {"view": large[:3]})
    assert (tmp_path / "model.pt").stat().st_size < 10_000


def test_only_what_can_be_read_without_a_risk_is_saved(tmp_path, state):
    with pytest.raises(TypeError, match=r"a checkpoint holds no \w*Path"):
        save_checkpoint(tmp_path / "model.pt", state | {"path": tmp_path})
    assert list(tmp_path.iterdir()) == []


def test_a_policy_alone_is_a_checkpoint_too(tmp_path, state):
    save_checkpoint(tmp_path / "model.pt", policy_state(state))
    assert "processes" not in read_checkpoint(tmp_path / "model.pt")


def test_a_full_disk_leaves_the_checkpoint_before(tmp_path, state):
    path = tmp_path / "model.pt"
    save_checkpoint(path, state)
    before, limits = path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
    try:
        with pytest.raises(ExportError, match=r"cannot write .*model\.pt: File too large"):
            save_checkpoint(path, state | {"more": torch.ones(1000)})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.pt"]


def test_a_truncated_checkpoint_is_told_wherever_it_ends(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    data = (tmp_path / "whole.pt").read_bytes()
    path = tmp_path / "model.pt"
    for length in (0, 1, 100, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:length])
        with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit, or not a whole"):
            read_checkpoint(path)


def test_a_damaged_checkpoint_never_ends_the_program(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    data = bytearray((tmp_path / "whole.pt").read_bytes())
    path, draw = tmp_path / "model.pt", np.random.default_rng(0)
    for _ in range(100):
        damaged = bytearray(data)
        for at in draw.integers(0, len(data), 5):
            damaged[at] ^= int(draw.integers(1, 256))
        path.write_bytes(damaged)
        try:
            read_checkpoint(path)
        except ConfigError as error:
            assert "\n" not in str(error)  # noqa: PT017 (damage may go unnoticed in a weight)


class _Harm:
    def __reduce__(self) -> Any:
        return print, ("harm",)


def test_nothing_in_a_file_is_executed(tmp_path, state, capsys):
    path = tmp_path / "model.pt"
    torch.save(state | {"format": "terrainkit checkpoint", "version": 1, "harm": _Harm()}, path)
    with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit"):
        read_checkpoint(path)
    path.write_bytes(pickle.dumps(_Harm()))
    with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit"):
        read_checkpoint(path)
    assert capsys.readouterr().out == ""


def test_a_packed_file_is_not_unpacked(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    path = tmp_path / "model.pt"
    with (
        zipfile.ZipFile(tmp_path / "whole.pt") as whole,
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed,
    ):
        for name in whole.namelist():
            packed.writestr(name, whole.read(name))
    with pytest.raises(ConfigError, match="its parts are packed"):
        read_checkpoint(path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "other"}, "is not a checkpoint of terrainkit"),
        ({"version": 2}, "version is 2; wanted 1"),
        ({"iteration": "seven"}, "has no iteration"),
        ({"actor_state_dict": None}, "has no actor_state_dict"),
    ],
)
def test_a_foreign_file_of_torch_is_told(tmp_path, state, change, said):
    whole = {"format": "terrainkit checkpoint", "version": 1}
    torch.save(policy_state(state) | whole | change, tmp_path / "model.pt")
    with pytest.raises(ConfigError, match=said):
        read_checkpoint(tmp_path / "model.pt")


def test_what_is_no_file_is_told(tmp_path):
    with pytest.raises(ConfigError, match=r"cannot read .*gone\.pt: No such file"):
        read_checkpoint(tmp_path / "gone.pt")
    with pytest.raises(ConfigError, match="is not a file; wanted a checkpoint"):
        read_checkpoint(tmp_path)
    with pytest.raises(ConfigError, match="is not a file; wanted a checkpoint"):
        read_checkpoint(Path("/dev/zero"))
