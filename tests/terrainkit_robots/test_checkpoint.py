import pickle
import resource
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.checkpoint import (
    Checkpoint,
    policy_state,
    read_checkpoint,
    save_checkpoint,
)

torch = pytest.importorskip("torch", reason="the extra `train` is not installed")


@pytest.fixture
def state() -> dict[str, Any]:
    return {
        "iteration": 7,
        "robot": "rover",
        "joints": ["front", "rear"],
        "observed": {"policy": 3},
        "actor_state_dict": {"weight": torch.arange(6.0).reshape(2, 3)},
        "critic_state_dict": {"weight": torch.ones(1)},
        "processes": [
            {"rng": {"state": 2**127 + 1}, "levels": torch.arange(4), "pair": (1.5, 2.5)}
        ],
    }


def test_checkpoint_round_trip(tmp_path, state):
    save_checkpoint(tmp_path / "model.pt", state)
    read = read_checkpoint(tmp_path / "model.pt")
    assert read["iteration"] == 7
    assert read["joints"] == ["front", "rear"]
    torch.testing.assert_close(read["actor_state_dict"], state["actor_state_dict"], rtol=0, atol=0)
    (mine,) = read["processes"]
    assert mine["rng"]["state"] == 2**127 + 1
    assert mine["levels"].tolist() == [0, 1, 2, 3]
    assert mine["pair"] == (1.5, 2.5)


def test_policy_state_is_a_checkpoint(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    save_checkpoint(tmp_path / "model.pt", policy_state(read_checkpoint(tmp_path / "whole.pt")))
    assert read_checkpoint(tmp_path / "model.pt").keys() == Checkpoint.__annotations__.keys()


def test_full_disk_keeps_the_previous_checkpoint(tmp_path, state):
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


def test_read_checkpoint_rejects_truncated_files(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    data = (tmp_path / "whole.pt").read_bytes()
    path = tmp_path / "model.pt"
    for length in (0, 1, 100, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:length])
        with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit, or is damaged"):
            read_checkpoint(path)


def test_damaged_checkpoint_raises_one_line(tmp_path, state):
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


def test_read_checkpoint_executes_nothing(tmp_path, state, capsys):
    path = tmp_path / "model.pt"
    torch.save(state | {"format": "terrainkit checkpoint", "version": 1, "harm": _Harm()}, path)
    with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit"):
        read_checkpoint(path)
    path.write_bytes(pickle.dumps(_Harm()))
    with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit"):
        read_checkpoint(path)
    assert capsys.readouterr().out == ""


def test_read_checkpoint_rejects_compressed_files(tmp_path, state):
    save_checkpoint(tmp_path / "whole.pt", state)
    path = tmp_path / "model.pt"
    with (
        zipfile.ZipFile(tmp_path / "whole.pt") as whole,
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed,
    ):
        for name in whole.namelist():
            packed.writestr(name, whole.read(name))
    with pytest.raises(ConfigError, match="got a compressed file"):
        read_checkpoint(path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "other"}, "is not a checkpoint of terrainkit"),
        ({"version": 2}, r"Invalid enum value 2 - at `\$\.version`"),
        ({"iteration": "seven"}, r"Expected `int`, got `str` - at `\$\.iteration`"),
        ({"actor_state_dict": None}, r"Expected `object`, got `null` - at `\$\.actor_state_dict`"),
        ({"joints": [1]}, r"Expected `str`, got `int` - at `\$\.joints\[0\]`"),
    ],
)
def test_read_checkpoint_rejects_foreign_files(tmp_path, state, change, said):
    whole = {"format": "terrainkit checkpoint", "version": 1}
    torch.save(state | whole | change, tmp_path / "model.pt")
    with pytest.raises(ConfigError, match=said):
        read_checkpoint(tmp_path / "model.pt")


@pytest.mark.parametrize("kind", ["sparse", "torchscript"])
def test_read_checkpoint_rejects_content_that_torch_warns_about(tmp_path, state, kind):
    path = tmp_path / "model.pt"
    if kind == "sparse":
        torch.save(state | {"actor_state_dict": {"w": torch.eye(2).to_sparse()}}, path)
    else:
        torch.save({}, path)
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr("archive/constants.pkl", b"")
    with warnings.catch_warnings(record=True) as printed:
        warnings.simplefilter("always")
        with pytest.raises(ConfigError, match=r"is not a checkpoint of terrainkit, or is damaged$"):
            read_checkpoint(path)
    assert not printed


def test_read_checkpoint_rejects_nonfiles(tmp_path):
    with pytest.raises(ConfigError, match=r"cannot read .*gone\.pt: No such file"):
        read_checkpoint(tmp_path / "gone.pt")
    with pytest.raises(ConfigError, match=r"cannot read .*: is a folder, not a file"):
        read_checkpoint(tmp_path)
    with pytest.raises(ConfigError, match="cannot read /dev/zero: is a device, not a file"):
        read_checkpoint(Path("/dev/zero"))
