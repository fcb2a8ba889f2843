"""Check what the terms of a task of another package return."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, is_built_in, plugin_errors

Term = Callable[[Any], NDArray[Any]]


def checked(kind: str, name: str, function: Term, shape: tuple[int | None, ...]) -> Term:
    """Return a term whose errors name it, and whose values are checked; built-in terms unchanged.

    Args:
        kind: Kind of the term, such as `reward`.
        name: Name of the term.
        function: Function of the environment.
        shape: Expected shape, whose second length may be None: any.
    """
    if is_built_in(function):
        return function
    dtype: Any = np.bool_ if kind == "termination" else np.float32

    def term(env: Any) -> NDArray[Any]:
        with plugin_errors(f"{kind} {name} ({function.__module__})"):
            values: NDArray[Any] = np.asarray(function(env)).astype(dtype, casting="same_kind")
            if len(values.shape) != len(shape) or values.shape[0] != shape[0]:
                raise ConfigError(f"got shape {values.shape}; expected {shape}")
            return values

    return term
