"""A policy in an ONNX file of a stranger."""

from concurrent.futures import Future
from pathlib import Path
from threading import Thread
from typing import Any

import msgspec
import onnxruntime
import torch

from terrainkit.errors import ConfigError
from terrainkit.files.child_process import ProcessError, run_in_process
from terrainkit_robots.files import open_regular
from terrainkit_robots.policy.onnx_model import (
    LIMITS,
    call_model,
    load_model,
    make_session,
    make_state,
)
from terrainkit_robots.transforms import FloatArray

MAX_FILE_SIZE = 1 << 28
"""Largest ONNX or JSON file that is read [bytes]."""


class OnnxPolicy:
    """A policy in an ONNX file, from observations (n, k) to actions (n, a).

    It keeps the state of a recurrent network; `reset` clears it for robots whose episodes ended.
    """

    def __init__(self, path: Path) -> None:
        """Load a file, and call it once.

        Args:
            path: The ONNX file.

        Raises:
            ConfigError: If the file is not a policy.
        """
        self.__name__ = path.name
        try:
            loaded = run_in_process(load_model, read_file(path), path.parent, limits=LIMITS)
        except ProcessError as error:
            raise ConfigError(f"{path} is not a policy: {error}") from error
        self.num_obs, self.num_actions = loaded["sizes"].tolist()
        self.metadata: dict[str, str] = msgspec.json.decode(loaded["metadata"].tobytes())
        self._session = make_session(loaded["model"].tobytes())
        self._sizes, self._state = loaded["state"].tolist(), make_state((), 0)

    def __call__(self, obs: torch.Tensor) -> FloatArray:
        """Return actions (n, a) for observations (n, k).

        Raises:
            ConfigError: If the model fails, or exceeds the limits of :mod:`.onnx_model`.
        """
        if self._sizes and (not self._state or self._state[0].shape[1] != len(obs)):
            self._state = make_state(self._sizes, len(obs))
        result: Future[list[FloatArray]] = Future()
        options = onnxruntime.RunOptions()
        options.log_severity_level = 4
        # A signal interrupts waiting for a thread, but not a call of native code. The process does
        # not wait for a daemon thread when it ends.
        arguments = result, self._session, obs.numpy(force=True), self._state, options
        Thread(target=_set_result, args=arguments, daemon=True).start()
        try:
            actions, *self._state = result.result(LIMITS.seconds)
            return actions
        except TimeoutError:
            raise ConfigError(f"{self.__name__} takes more than {LIMITS.seconds:g} s") from None
        except ConfigError as error:
            raise ConfigError(f"{self.__name__} {one_line(error)}") from error
        finally:
            options.terminate = True  # ends the call if it is still running

    def reset(self, dones: torch.Tensor) -> None:
        """Clear the state of robots, a mask of shape (n,)."""
        for part in self._state:
            part[:, dones.numpy(force=True)] = 0


def _set_result(result: Future[list[FloatArray]], *arguments: Any) -> None:
    try:
        result.set_result(call_model(*arguments))
    except Exception as error:
        result.set_exception(error)


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


def one_line(error: Exception) -> str:
    """Return the beginning of an error message in one line."""
    return " ".join(str(error).split())[:300]
