"""The extra `train`: what the commands that train robots need, and the others do not."""

import importlib.util

from terrainkit.errors import ConfigError

_PACKAGES = ("torch", "rsl_rl", "tensordict", "tensorboard", "imageio_ffmpeg")
"""Packages of the extra that training imports."""


def require_training() -> None:
    """Raise an error that says what to install, if the extra is not; imports nothing.

    Raises:
        ConfigError: if a package is missing.
    """
    missing = [name for name in _PACKAGES if importlib.util.find_spec(name) is None]
    if missing:
        raise ConfigError(
            f"this needs {', '.join(missing)}, which is not installed: "
            "pip install 'terrainkit[train]'"
        )
