"""Checkpoint files: the networks of a policy, and the state of its training.

They hold only tensors and plain values, so that they can be read without executing code.
"""

import io
import math
import os
import warnings
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, BinaryIO, Literal, TypedDict

import msgspec
from msgspec import Meta

from terrainkit.errors import ConfigError, listing, one_line
from terrainkit.files.atomic_write import atomic_write
from terrainkit_robots.files import open_regular

TRAINING_KEYS = {"optimizer_state_dict", "processes", "logger"}
"""Keys of the state of the training."""

_MAYBE_NAN = {"heading", "speed", "goals", "success", "returns", "score"}
"""Names of the numbers that may be NaN: none, or unknown."""

_NON_NEGATIVE = {"_var", "_std", "step", "exp_avg_sq", "lr"}
"""Names of the floats of networks and of Adam that are not negative. No integer is negative."""


class Checkpoint(TypedDict):
    """The part of a checkpoint that describes a policy; training checkpoints also have a state."""

    format: Literal["terrainkit checkpoint"]
    version: Literal[1]
    iteration: Annotated[int, Meta(ge=0, lt=10**12)]
    robot: str
    joints: list[str]
    observed: dict[str, int]  # width of each observation group
    actor_state_dict: dict[str, Any]
    critic_state_dict: dict[str, Any]


def save_checkpoint(path: Path, state: Mapping[str, Any]) -> None:
    """Write a checkpoint completely, or not at all; see `LeggedRunner.state_dict`."""
    data = checkpoint_bytes(state)
    with atomic_write(path, overwrite=True) as target:
        target.write_bytes(data)


def checkpoint_bytes(state: Mapping[str, Any]) -> bytes:
    """Return the content of a checkpoint file; torch itself aborts the process on a full disk."""
    import torch

    data = io.BytesIO()
    torch.save({"format": "terrainkit checkpoint", "version": 1, **state}, data)
    # Not `getbuffer`: the traceback of an error would keep the view, and Python 3.12 crashes when
    # it then collects the buffer.
    return data.getvalue()


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint, without executing code from it.

    Raises:
        ConfigError: If it is missing, damaged, or not written by terrainkit.
    """
    import torch

    try:
        with open_regular(path) as file:
            _check_archive(path, file)
            file.seek(0)
            with warnings.catch_warnings():
                # torch warns of kinds of tensors that no checkpoint of terrainkit has.
                warnings.simplefilter("error", UserWarning)
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


def _check_archive(path: Path, file: BinaryIO) -> None:
    """Raise ConfigError if a checksum differs; torch does not compare them."""
    archive = zipfile.ZipFile(file)
    parts = archive.infolist()
    if any(part.compress_type != zipfile.ZIP_STORED for part in parts):
        raise ConfigError(f"{path}: got a compressed file, which could expand to any size")
    if sum(part.file_size for part in parts) > os.fstat(file.fileno()).st_size:
        raise ConfigError(f"{path} is damaged: its parts overlap")
    if damaged := archive.testzip():
        raise ConfigError(f"{path} is damaged: the checksum of {damaged} differs")


def policy_state(state: Mapping[str, Any]) -> Checkpoint:
    """Return the part of a checkpoint without which there is no policy or critic."""
    return msgspec.convert(state, Checkpoint)


def check_state(name: str, got: Any, expected: Any) -> None:
    """Raise ConfigError unless a part of a checkpoint has the form of another, and is finite.

    Args:
        name: Path of the part, for the error.
        got: The part: tensors, numbers, text and None, in dicts and lists.
        expected: An example: a dict with the required keys, a list with one element, whose form all
            elements have, a tensor of the dtype and shape, a value of the type, or `...` for
            anything.
    """
    if expected is ...:
        return
    if isinstance(expected, Mapping) and isinstance(got, Mapping):
        for key, value in expected.items():
            if key not in got:
                raise ConfigError(f"{name}.{key}: got nothing; expected {_form(value)}")
            check_state(f"{name}.{key}", got[key], value)
    elif isinstance(expected, list) and isinstance(got, list):
        for index, value in enumerate(got):
            check_state(f"{name}.{index}", value, expected[0])
    elif (form := _form(got)) != _form(expected):
        raise ConfigError(f"{name}: got {form}; expected {_form(expected)}")
    else:
        _check_numbers(name, got)


def _check_numbers(name: str, got: Any) -> None:
    """Raise ConfigError if a number or a tensor is not finite, or negative where it cannot be."""
    import torch

    if not isinstance(got, torch.Tensor | float | int):
        return
    values = got if isinstance(got, torch.Tensor) else torch.tensor(float(got), dtype=torch.float64)
    key = name.rpartition(".")[2]
    is_signed = "float" in _form(got) and key not in _NON_NEGATIVE
    valid = values.isfinite() & (values >= (-math.inf if is_signed else 0))
    if key in _MAYBE_NAN:
        valid |= values.isnan()
    if not valid.all():
        wrong = values[~valid].flatten()[0].item()
        expected = "finite numbers" if is_signed else "finite numbers >= 0"
        raise ConfigError(f"{name}: got {wrong:g}; expected {expected}")


def _form(value: Any) -> str:
    """Return the type of a value, and the dtype and shape of a tensor."""
    if value is ...:
        return "a value"
    if not hasattr(value, "dtype"):
        return type(value).__name__
    return f"{str(value.dtype).removeprefix('torch.')} {tuple(value.shape)}"


@contextmanager
def open_checkpoint(
    path: Path, joints: Sequence[str], observed: Mapping[str, int]
) -> Iterator[dict[str, Any]]:
    """Yield the content of a checkpoint after checking that it fits a robot and its observations.

    Errors in the block, such as an error of `check_state`, become ConfigErrors that name the file.

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
    except (RuntimeError, LookupError, ValueError, TypeError, OverflowError) as error:
        reason = one_line(str(error))[:300]
        raise ConfigError(f"{path} does not fit its robot, task and map: {reason}") from error
