"""The extra `train`: what the commands that train robots need, and the others do not."""

import importlib.util
import os

from terrainkit.errors import ConfigError

_PACKAGES = ("torch", "rsl_rl", "tensordict", "tensorboard")
"""Packages of the extra that training imports."""


def require_training(*more: str) -> None:
    """Make ready for training, or raise an error that says what to install; imports no torch.

    Args:
        *more: Packages of the extra that this command needs besides.

    Raises:
        ConfigError: if a package is missing.
    """
    missing = [name for name in (*_PACKAGES, *more) if importlib.util.find_spec(name) is None]
    if missing:
        raise ConfigError(
            f"this needs {', '.join(missing)}, which is not installed: "
            "pip install 'terrainkit[train]'"
        )
    # Waiting threads of torch slow the physics down; this must be set before torch is imported.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
