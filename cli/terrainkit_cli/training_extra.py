"""The optional dependencies of the commands that train or run policies: the extra `train`."""

import importlib.util
import os
from importlib import metadata

from terrainkit.errors import ConfigError, install_command
from terrainkit.files.memory import check_address_space

PACKAGES = ("torch", "rsl_rl", "tensordict", "tensorboard")
"""Packages that training imports, besides MuJoCo."""

_OLDEST = {"mujoco": "3.17", "rsl-rl-lib": "5.5"}
"""Oldest versions of packages that frameworks pin, as in pyproject.toml: `mujoco.batch` is new."""

_ADDRESS_SPACE = 1_300_000_000
"""Addresses that the packages need [bytes]; with fewer, some of them end the process."""


def require_training(*packages: str, extra: str = "train") -> None:
    """Check that the packages of training are installed, without importing them.

    Args:
        *packages: Further packages of the extra that the command needs.
        extra: The extra that has all of the packages.

    Raises:
        ConfigError: if a package is missing or too old.
        MemoryLimitError: if torch cannot be imported in the address space (`ulimit -v`).
    """
    missing = [name for name in (*PACKAGES, *packages) if importlib.util.find_spec(name) is None]
    if missing:
        raise ConfigError(f"missing packages: {', '.join(missing)}; run: {install_command(extra)}")
    for package, oldest in _OLDEST.items():
        found = metadata.version(package)
        if [int(part) for part in found.split(".")[:2]] < [int(part) for part in oldest.split(".")]:
            raise ConfigError(
                f"{package}: got version {found}; expected {oldest} or newer; where a framework "
                f"pins an older one, use an environment of its own: {install_command(extra)}"
            )
    check_address_space(_ADDRESS_SPACE, "importing torch and MuJoCo")
    # Busy-waiting threads of torch slow the physics down. torch reads this when it is imported.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
