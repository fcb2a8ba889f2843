"""The checkpoint: a file of weights, numbers and tensors, and nothing that could run."""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from terrainkit.atomic_write import atomic_write
from terrainkit.errors import ConfigError

FORMAT = "terrainkit checkpoint"
VERSION = 1
"""Version of the format; it changes when an old file would be read wrongly."""

_LARGEST = 1 << 32
"""No checkpoint is larger [bytes]."""

_WANTED = {
    "iteration": int,
    "robot": str,
    "joints": list,
    "observed": dict,
    "actor_state_dict": dict,
    "critic_state_dict": dict,
}
"""What is in every checkpoint, and of which kind. What only training needs to go on is left out of
a policy that is shipped."""


def save_checkpoint(path: Path, state: Mapping[str, Any]) -> None:
    """Write a checkpoint: whole, or not at all.

    Args:
        path: Where; what is there is replaced.
        state: Tables, lists, texts, numbers, tensors and arrays; see `LeggedRunner.state_dict`.

    Raises:
        ExportError: if the disk does not take it.
    """
    data = io.BytesIO()  # torch, writing to a full disk itself, ends the process
    torch.save(_plain({"format": FORMAT, "version": VERSION, **state}), data)
    with atomic_write(path, overwrite=True) as target:
        target.write_bytes(data.getbuffer())


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Return what a checkpoint holds; arrays have become tensors.

    Raises:
        ConfigError: if it is missing, foreign, truncated, or holds anything but weights and
            numbers.
    """
    try:
        if path.exists() and not path.is_file():
            raise ConfigError(f"{path} is not a file; wanted a checkpoint")
        if path.stat().st_size > _LARGEST:
            raise ConfigError(f"{path}: over {_LARGEST} bytes; wanted a checkpoint")
        _refuse_packed(path)
        state = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error
    except ConfigError:
        raise
    except Exception as error:  # torch raises whatever a damaged file leads to
        raise ConfigError(
            f"{path} is not a checkpoint of terrainkit, or not a whole one"
        ) from error
    if not isinstance(state, dict) or state.get("format") != FORMAT:
        raise ConfigError(f"{path} is not a checkpoint of terrainkit")
    if state.get("version") != VERSION:
        got = state.get("version", "missing")
        raise ConfigError(f"{path}: version is {got!r}; wanted {VERSION}")
    for key, kind in _WANTED.items():
        if not isinstance(state.get(key), kind):
            raise ConfigError(f"{path} has no {key}, or one of another kind")
    return state


def only_policy(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a policy and its critic need, without what only training needs to go on."""
    return {key: state[key] for key in _WANTED}


def _refuse_packed(path: Path) -> None:
    """Refuse a file whose parts are packed: unpacked they might be of any size."""
    with zipfile.ZipFile(path) as file:
        if any(part.compress_type != zipfile.ZIP_STORED for part in file.infolist()):
            raise ConfigError(f"{path} is not a checkpoint of terrainkit: its parts are packed")


def _plain(value: Any) -> Any:
    """Return a value as tables, lists, numbers and tensors, which can be read without a risk."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return torch.from_numpy(np.ascontiguousarray(value))
    if isinstance(value, torch.Tensor):
        return value.detach().to("cpu").clone()  # a view would drag along all that it looks at
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a checkpoint holds no {type(value).__name__}")
