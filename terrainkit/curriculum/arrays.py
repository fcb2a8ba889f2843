"""Arrays of callers: numpy arrays, lists, or tensors of torch on any device."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit.settings.type_hint import show

if TYPE_CHECKING:
    from torch import Tensor

# The order matters: without torch, mypy finds that results of arrays are arrays.
Array = TypeVar("Array", "Tensor", NDArray[Any])
"""A numpy array or a tensor of torch; the result is of the same kind."""

Seed = int | Sequence[int]
"""Seed of random numbers, such as (seed, iteration)."""


def to_numpy(name: str, values: Any) -> NDArray[Any]:
    """Return an array, a list or a tensor as a numpy array; torch is not imported.

    Args:
        name: What the values are, for the error.
        values: An array, list or tensor of torch, on any device.

    Raises:
        ConfigError: if lists have different lengths, or numpy lacks the dtype of a tensor.
    """
    if hasattr(values, "detach"):
        values = values.detach().cpu()
    try:
        return np.asarray(values)
    except ValueError:
        raise ConfigError(f"{name}: got lists of different lengths; expected one list") from None
    except TypeError:  # such as bfloat16
        expected = "one that numpy has, such as float32"
        raise ConfigError(f"{name}: got values of {values.dtype}; expected {expected}") from None


def like(array: NDArray[Any], original: Array) -> Array:
    """Return an array as a tensor on the device of `original` if that is a tensor of torch.

    Args:
        array: The result as an array.
        original: An argument of the caller, which decides the type of the result.
    """
    if not hasattr(original, "new_tensor"):
        return array
    import torch

    return cast("Array", torch.as_tensor(array, device=original.device))


def to_indices(name: str, values: Any, size: int, number: int | None = None) -> NDArray[np.int64]:
    """Return integers from 0 to `size` - 1, such as rows of a map.

    Args:
        name: What the values are, for the errors.
        values: An array, list or tensor of torch.
        size: Number of valid indices.
        number: Expected length; None for any.

    Returns:
        Indices, shape (n,) or (number,).

    Raises:
        ConfigError: if the shape is wrong, or a value is not an integer from 0 to `size` - 1.
    """
    given = to_numpy(name, values)
    if given.ndim != 1 or len(given) != (len(given) if number is None else number):
        expected = "(n,)" if number is None else f"({number},)"
        raise ConfigError(f"{name}: got shape {given.shape}; expected {expected}")
    if given.size and given.dtype.kind not in "iu":
        raise ConfigError(f"{name}: got values of {given.dtype}; expected integers")
    if given.size and not (given.min() >= 0 and given.max() < size):
        raise ConfigError(f"{name}: got {given.min()} to {given.max()}; expected 0 to {size - 1}")
    return given.astype(np.int64)


def to_numbers(name: str, values: Any, number: int) -> NDArray[np.float64]:
    """Return one number for each episode.

    Args:
        name: What the values are, for the errors.
        values: Shape (number,), or a single value, which applies to all episodes.
        number: Number of episodes.

    Returns:
        Numbers, shape (number,), read-only.

    Raises:
        ConfigError: if the values are not numbers, or have another shape.
    """
    given = to_numpy(name, values)
    if given.dtype.kind not in "fiub":
        raise ConfigError(f"{name}: got values of {given.dtype}; expected numbers")
    if given.shape not in ((), (number,)):
        raise ConfigError(f"{name}: got shape {given.shape}; expected ({number},)")
    return np.broadcast_to(given.astype(np.float64), (number,))


def to_progress(values: Any, number: int) -> NDArray[np.float64]:
    """Return the progress of each episode.

    Args:
        values: Progress, 0 to 1 or NaN, shape (number,) or a single value.
        number: Number of episodes.

    Returns:
        Progress, shape (number,), read-only.

    Raises:
        ConfigError: if a value is not from 0 to 1 or NaN, or the shape is wrong.
    """
    progress = to_numbers("progress", values, number)
    outside = progress[(progress < 0) | (progress > 1)]
    if outside.size:
        raise ConfigError(f"progress: got {outside[0]:g}; expected numbers from 0 to 1, or NaN")
    return progress


def make_rng(seed: Seed) -> np.random.Generator:
    """Return the generator of a seed.

    numpy itself would accept None.

    Args:
        seed: A nonnegative integer, or a sequence of nonnegative integers.

    Raises:
        ConfigError: if the seed is anything else.
    """
    try:
        values = np.asarray(seed)
        is_valid = (
            values.dtype.kind in "iu" and values.ndim < 2 and values.size and values.min() >= 0
        )
    except ValueError:  # lists of different lengths
        is_valid = False
    if not is_valid:
        raise ConfigError(f"seed: got {show(seed)}; expected integers >= 0")
    return np.random.default_rng(seed)
