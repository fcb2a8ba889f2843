"""Load and call an ONNX model of a stranger, which may loop forever or need any memory.

It imports neither torch nor mujoco, since a child process calls `load_model` first.
"""

from contextlib import chdir
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, listing
from terrainkit.files.child_process import ProcessLimits

LIMITS = ProcessLimits(seconds=30.0, memory=2 << 30)
"""Limits of loading a model and of its first call. Later calls have the same time limit."""

ARENA_SIZE = 1 << 30
"""Memory that the intermediate results of all models of a process may need [bytes]."""

_FLOATS = ("tensor(float)", "tensor(double)", "tensor(float16)")


def load_model(
    data: bytes, folder: Path, metadata_key: str
) -> dict[str, NDArray[np.uint8] | NDArray[np.int64]]:
    """Return a model with its external data, after calling it once.

    Args:
        data: The ONNX file.
        folder: The folder of its external data.
        metadata_key: Key of the text to return from its metadata.

    Returns:
        `model`, the file with its external data inside; `text`, in UTF-8, empty if there is none;
        and `sizes`, the numbers of observations and actions.

    Raises:
        ConfigError: If it is not a policy without memory.
    """
    try:
        parsed = onnx.load_model_from_string(data)
        onnx.load_external_data_for_model(parsed, str(folder))
        model = parsed.SerializeToString()
        # onnx leaves the external data of sparse tensors to onnxruntime, which looks for it in the
        # current folder.
        with TemporaryDirectory() as empty, chdir(empty):
            session = make_session(model)
    except Exception as error:  # errors of onnx and onnxruntime have no common class
        raise ConfigError(f"not an ONNX file that can be loaded: {error}") from error
    num_obs = _num_observations(session)
    outputs = [each.type for each in session.get_outputs()]
    if not outputs or outputs[0] not in _FLOATS:
        raise ConfigError(f"got the outputs {listing(outputs)}; expected actions of tensor(float)")
    actions = call_model(session, np.zeros((2, num_obs), np.float32))
    if len(actions) != 2 or actions.ndim != 2:
        raise ConfigError(f"got actions of shape {actions.shape}; expected (2, a) for two rows")
    text = session.get_modelmeta().custom_metadata_map.get(metadata_key, "")
    arrays = {"model": model, "text": text.encode()}
    return {name: np.frombuffer(value, np.uint8) for name, value in arrays.items()} | {
        "sizes": np.array([num_obs, actions.shape[1]])
    }


def make_session(model: bytes) -> onnxruntime.InferenceSession:
    """Return a session on the CPU, with one thread and limited memory."""
    _register_arena()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.log_severity_level = 1, 4
    options.add_session_config_entry("session.use_env_allocators", "1")
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def call_model(session: onnxruntime.InferenceSession, obs: Any, options: Any = None) -> Any:
    """Return the first output of a model.

    Args:
        session: The loaded model.
        obs: Observations, shape (n, k). They are passed row by row if the model takes a batch of 1.
        options: onnxruntime's `RunOptions`; None for the defaults.

    Returns:
        Actions, shape (n, a).

    Raises:
        ConfigError: If the model fails, or needs too much memory.
    """
    (given,), output = session.get_inputs(), session.get_outputs()[0]
    parts = np.split(obs, len(obs)) if given.shape[0] == 1 else [obs]
    try:
        results = [session.run([output.name], {given.name: part}, options)[0] for part in parts]
        return np.concatenate(results)
    except Exception as error:  # errors of onnxruntime have no common class
        reason = f"fails: {error}"
        if "BFCArena" in reason:
            reason = f"needs more than {ARENA_SIZE / 2**30:g} GB of memory"
        raise ConfigError(reason) from error


def _num_observations(session: onnxruntime.InferenceSession) -> int:
    """Return k of the only input, of shape (n, k) or (1, k); raise ConfigError for others."""
    inputs = [f"{each.name} {each.type} {each.shape}" for each in session.get_inputs()]
    shapes = [each.shape for each in session.get_inputs()]
    if len(shapes) == 1 and len(shapes[0]) == 2:
        batch, num_obs = shapes[0]
        if isinstance(num_obs, int) and (batch == 1 or not isinstance(batch, int)):
            return num_obs
    raise ConfigError(f"got the inputs {listing(inputs)}; expected one of shape (n, k) or (1, k)")


@cache
def _register_arena() -> None:
    cpu = onnxruntime.OrtMemoryInfo(
        "Cpu", onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, onnxruntime.OrtMemType.DEFAULT
    )
    limit = onnxruntime.OrtArenaCfg({"max_mem": ARENA_SIZE})
    onnxruntime.create_and_register_allocator(cpu, limit)
