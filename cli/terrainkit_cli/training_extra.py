"""The optional dependencies of the commands that train or run policies: the extra `train`."""

import importlib.util
import os

from terrainkit.errors import ConfigError, install_command
from terrainkit.files.memory import check_address_space

PACKAGES = ("torch", "rsl_rl", "tensordict", "tensorboard", "mujoco.batch")
"""Packages that training imports; MuJoCo has `batch` since version 3.17."""

_ADDRESS_SPACE = 1_300_000_000
"""Addresses that the packages need [bytes]; with fewer, some of them end the process."""


def require_training(*packages: str, extra: str = "train") -> None:
    """Check that the packages of training are installed, without importing them.

    Args:
        *packages: Further packages of the extra that the command needs.
        extra: The extra that has all of the packages.

    Raises:
        ConfigError: if a package is missing.
        MemoryLimitError: if torch cannot be imported in the address space (`ulimit -v`).
    """
    missing = [name for name in (*PACKAGES, *packages) if importlib.util.find_spec(name) is None]
    if missing:
        raise ConfigError(f"missing packages: {', '.join(missing)}; run: {install_command(extra)}")
    check_address_space(_ADDRESS_SPACE, "importing torch and MuJoCo")
    # Busy-waiting threads of torch slow the physics down. torch reads this when it is imported.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
