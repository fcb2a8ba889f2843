import pickle
import re
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
    check_state,
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


@pytest.fixture
def path(tmp_path, state) -> Path:
    """Return the path of a checkpoint."""
    save_checkpoint(tmp_path / "model.pt", state)
    return tmp_path / "model.pt"


def test_checkpoint_round_trip(path, state):
    read = read_checkpoint(path)
    assert (read["iteration"], read["joints"]) == (7, ["front", "rear"])
    torch.testing.assert_close(read["actor_state_dict"], state["actor_state_dict"], rtol=0, atol=0)
    (mine,) = read["processes"]
    assert mine["levels"].tolist() == [0, 1, 2, 3]
    assert (mine["rng"], mine["pair"]) == ({"state": 2**127 + 1}, (1.5, 2.5))


def test_policy_state_is_a_checkpoint(tmp_path, path):
    save_checkpoint(tmp_path / "policy.pt", policy_state(read_checkpoint(path)))
    assert read_checkpoint(tmp_path / "policy.pt").keys() == Checkpoint.__annotations__.keys()


def test_full_disk_keeps_the_previous_checkpoint(path, state):
    before, limits = path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
    try:
        with pytest.raises(ExportError, match=r"cannot write .*model\.pt: File too large"):
            save_checkpoint(path, state | {"more": torch.ones(1000)})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_bytes() == before
    assert [entry.name for entry in path.parent.iterdir()] == ["model.pt"]


def test_damaged_checkpoint_raises_one_line_or_has_the_same_content(path):
    data, draw, rejected = path.read_bytes(), np.random.default_rng(0), 0
    for flips in (1, 5) * 100:
        damaged = bytearray(data)
        for at in draw.integers(0, len(data), flips):
            damaged[at] ^= int(draw.integers(1, 256))
        path.write_bytes(damaged)
        try:
            read = read_checkpoint(path)
        except ConfigError as error:
            assert "\n" not in str(error)  # noqa: PT017
            rejected += 1
        else:  # the padding of the archive
            assert torch.equal(read["actor_state_dict"]["weight"], torch.arange(6.0).reshape(2, 3))
            assert read["processes"][0]["levels"].tolist() == [0, 1, 2, 3]
    assert rejected > 50


def test_flipped_bit_in_a_weight_is_a_wrong_checksum(path, state):
    weight = state["actor_state_dict"]["weight"].numpy().tobytes()
    data = bytearray(path.read_bytes())
    data[data.index(weight)] ^= 1
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=r"model\.pt is damaged: the checksum of archive/data/0"):
        read_checkpoint(path)


def test_archive_whose_parts_overlap_is_rejected(path):
    with zipfile.ZipFile(path, "a") as archive:
        archive.filelist += [archive.getinfo("archive/data.pkl")] * 100
        archive.writestr("archive/more", b"")  # writes the table of contents again
    with pytest.raises(ConfigError, match="is damaged: its parts overlap"):
        read_checkpoint(path)


FORM = {
    "weight": torch.zeros(2, 3),
    "heading": torch.zeros(2),
    "count": torch.tensor(1),
    "rate": 0.5,
    "means": [0.5],
    "levels": ...,
}


def test_state_of_the_same_form_is_accepted():
    state = FORM | {"heading": torch.tensor([1.0, torch.nan]), "levels": 3, "more": 1}
    check_state("part", state | {"means": [1.0, 2.0, -3.0]}, FORM)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weight": torch.zeros(3, 2)}, "weight: got float32 (3, 2); expected float32 (2, 3)"),
        ({"weight": torch.zeros(2, 3).double()}, "weight: got float64 (2, 3); expected float32 (2"),
        ({"weight": torch.full((2, 3), torch.nan)}, "weight: got nan; expected finite numbers"),
        ({"heading": torch.full((2,), torch.inf)}, "heading: got inf; expected finite numbers"),
        ({"count": torch.tensor(-2)}, "count: got -2; expected finite numbers >= 0"),
        ({"rate": "0.5"}, "rate: got str; expected float"),
        ({"rate": True}, "rate: got bool; expected float"),
        ({"means": [0.5, None]}, "means.1: got NoneType; expected float"),
        ({"means": 3}, "means: got int; expected list"),
        ({"rate": ...}, "rate: got nothing; expected float"),
    ],
)
def test_state_of_another_form_is_named(change, message):
    with pytest.raises(ConfigError, match=f"^part.{re.escape(message)}"):
        check_state("part", {k: v for k, v in (FORM | change).items() if v is not ...}, FORM)


class _Harm:
    def __reduce__(self) -> Any:
        return print, ("harm",)


def test_read_checkpoint_executes_nothing(path, state, capsys):
    torch.save(state | {"format": "terrainkit checkpoint", "version": 1, "harm": _Harm()}, path)
    for _ in range(2):
        with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit"):
            read_checkpoint(path)
        path.write_bytes(pickle.dumps(_Harm()))
    assert capsys.readouterr().out == ""


def test_read_checkpoint_rejects_compressed_files(path):
    with zipfile.ZipFile(path) as whole:
        parts = {name: whole.read(name) for name in whole.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in parts.items():
            packed.writestr(name, data)
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
        with pytest.raises(ConfigError, match="is not a checkpoint of terrainkit"):
            read_checkpoint(path)
    assert not printed


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("gone.pt", r"cannot read .*gone\.pt: No such file"),
        (".", r"cannot read .*: is a folder, not a file"),
        ("/dev/zero", "cannot read /dev/zero: is a device, not a file"),
    ],
)
def test_read_checkpoint_rejects_nonfiles(tmp_path, name, message):
    with pytest.raises(ConfigError, match=message):
        read_checkpoint(tmp_path / name)
