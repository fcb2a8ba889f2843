"""A policy in a file of a stranger, which a child process loads and calls."""

from pathlib import Path

import msgspec
import numpy as np
import torch

from terrainkit.errors import ConfigError
from terrainkit.files.child_process import ChildProcess, ProcessError, ProcessLimits
from terrainkit_robots.files import open_regular
from terrainkit_robots.policy.onnx_model import run_model
from terrainkit_robots.policy.torchscript import run_script
from terrainkit_robots.transforms import BoolArray, FloatArray

MAX_FILE_SIZE = 1 << 28
"""Largest file of a policy or its contract [bytes]."""

LIMITS = ProcessLimits(seconds=30.0, memory=2 << 30)
"""Limits of loading a policy, and of each call."""


_ERRORS = (ProcessError, LookupError, TypeError, ValueError, msgspec.MsgspecError)
"""Errors of a call, and of answers of a process that a file has taken over."""


class PolicyFile:
    """A policy in an ONNX or TorchScript file, from observations (n, k) to actions (n, a).

    The state of a recurrent network is kept; `reset` clears it for robots whose episodes ended.
    """

    def __init__(self, path: Path) -> None:
        """Load a file, and call it once.

        Args:
            path: The file; TorchScript ends with `.pt`, or is a zip file.

        Raises:
            ConfigError: If the file is not a policy.
        """
        self.__name__ = path.name
        data = read_file(path)
        self._dones: BoolArray | None = None
        if path.suffix == ".pt" or data.startswith(b"PK"):
            self._process = ChildProcess(run_script, data, limits=LIMITS)
        else:
            self._process = ChildProcess(run_model, data, path.parent.absolute(), limits=LIMITS)
        try:
            loaded = self._process.receive()
            self.num_obs, self.num_actions = loaded["sizes"].astype(np.int64).tolist()
            self.metadata = msgspec.json.decode(str(loaded["metadata"]), type=dict[str, str])
        except _ERRORS as error:
            self._process.close()
            raise ConfigError(f"{path} is not a policy: {error}") from error

    def __call__(self, obs: torch.Tensor) -> FloatArray:
        """Return actions (n, a) for observations (n, k).

        Raises:
            ConfigError: If the policy fails, or exceeds the limits.
        """
        self._process.send((obs.numpy(force=True).astype(np.float32), self._dones))
        self._dones = None
        try:
            actions = self._process.receive()["actions"]
        except _ERRORS as error:
            raise ConfigError(f"{self.__name__}: {error}") from error
        if actions.shape != (len(obs), self.num_actions) or actions.dtype.kind != "f":
            got = f"got actions of shape {actions.shape} and type {actions.dtype}"
            raise ConfigError(f"{self.__name__}: {got}; expected {len(obs), self.num_actions}")
        return actions

    def reset(self, dones: torch.Tensor) -> None:
        """Clear the state of robots before the next step, a mask of shape (n,)."""
        mask: BoolArray = dones.numpy(force=True).astype(bool)
        if self._dones is not None and self._dones.shape == mask.shape:
            mask |= self._dones  # the policy has not been called since
        self._dones = mask


def read_file(path: Path) -> bytes:
    """Return the content of a file of at most `MAX_FILE_SIZE`.

    Raises:
        ConfigError: If it cannot be read, or is larger.
    """
    try:
        with open_regular(path) as file:
            data = file.read(MAX_FILE_SIZE + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise ConfigError(f"cannot read {path}: {reason or error}") from error
    if len(data) > MAX_FILE_SIZE:
        raise ConfigError(f"{path}: more than {MAX_FILE_SIZE} bytes; expected a smaller file")
    return data
