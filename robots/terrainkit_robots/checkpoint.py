"""Checkpoint files: the networks of a policy, and the state of its training.

They hold only tensors and plain values, so that they can be read without executing code.
"""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypedDict

import msgspec

from terrainkit.atomic_write import atomic_write
from terrainkit.errors import ConfigError
from terrainkit_robots.files import open_regular


class Checkpoint(TypedDict):
    """The part of a checkpoint that describes a policy; one of training also has its state."""

    format: Literal["terrainkit checkpoint"]
    version: Literal[1]
    iteration: int
    robot: str
    joints: list[str]
    observed: dict[str, int]  # width of each observation group
    actor_state_dict: dict[str, Any]
    critic_state_dict: dict[str, Any]


def save_checkpoint(path: Path, state: Mapping[str, Any]) -> None:
    """Write a checkpoint completely, or not at all; see `LeggedRunner.state_dict`."""
    import torch

    data = io.BytesIO()  # torch itself aborts the process on a full disk
    torch.save({"format": "terrainkit checkpoint", "version": 1, **state}, data)
    with atomic_write(path, overwrite=True) as target:
        target.write_bytes(data.getbuffer())


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint, without executing code from it.

    Raises:
        ConfigError: If it is missing, damaged, or not written by terrainkit.
    """
    import torch

    try:
        with open_regular(path) as file:
            parts = zipfile.ZipFile(file).infolist()
            if any(part.compress_type != zipfile.ZIP_STORED for part in parts):
                raise ConfigError(f"{path}: got a compressed file, which could expand to any size")
            file.seek(0)
            state: dict[str, Any] = torch.load(file, map_location="cpu", weights_only=True)
        policy_state(state)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path} is not a checkpoint of terrainkit: {error}") from error
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from error
    except ConfigError:
        raise
    except Exception as error:  # torch's errors for damaged files have no common class
        raise ConfigError(f"{path} is not a checkpoint of terrainkit, or is damaged") from error
    return state


def policy_state(state: Mapping[str, Any]) -> Checkpoint:
    """Return the part of a checkpoint without which there is no policy or critic."""
    return msgspec.convert(state, Checkpoint)
