"""Checkpoint files: the networks of a policy, and the state of its training.

They hold only tensors and plain values, so that they can be read without executing code.
"""

import io
import warnings
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, TypedDict

import msgspec

from terrainkit.errors import ConfigError, listing
from terrainkit.files.atomic_write import atomic_write
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
            with warnings.catch_warnings():  # of content that no checkpoint of terrainkit has
                warnings.simplefilter("error")
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


@contextmanager
def open_checkpoint(
    path: Path, joints: Sequence[str], observed: Mapping[str, int]
) -> Iterator[dict[str, Any]]:
    """Yield the content of a checkpoint after checking that it fits a robot and its observations.

    Errors in the block, such as torch's about weights that do not fit, become ConfigErrors.

    Args:
        path: The checkpoint.
        joints: Joints of the robot, in the order of its spec.
        observed: Number of observations in each group that is used.

    Raises:
        ConfigError: If the checkpoint cannot be read, or belongs to another robot or task.
    """
    state = read_checkpoint(path)
    if state["joints"] != list(joints):
        raise ConfigError(
            f"{path} belongs to another robot, {state['robot']}: got the joints "
            f"{listing(state['joints'])}; expected {listing(joints)}"
        )
    for name, width in observed.items():
        if (got := state["observed"].get(name)) != width:
            raise ConfigError(
                f"{path} belongs to another task: got {got} {name} observations; expected "
                f"{width}. On a map after a plane, set terrain.measure_heights on both, "
                "and keep the options in observations"
            )
    try:
        yield state
    except ConfigError:
        raise
    except (RuntimeError, ValueError, LookupError, TypeError, AttributeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigError(f"{path} does not fit the networks of its task: {reason}") from error
