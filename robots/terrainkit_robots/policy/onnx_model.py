"""Load and call an ONNX model of a stranger, which may loop forever or need any memory.

It imports neither torch nor mujoco, since a child process calls `run_model`.
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, listing
from terrainkit.files.sandbox import forbid_changes

_FLOATS = ("tensor(float)", "tensor(double)", "tensor(float16)")


def run_model(received: Iterator[Any], data: bytes, folder: Path) -> Iterator[dict[str, Any]]:
    """Yield what a model is, and then its actions; the function of a child process.

    Args:
        received: For each step, observations of shape (n, k), and a mask of the robots whose state
            is cleared first, shape (n,), or None.
        data: The ONNX file.
        folder: The folder of its external data.

    Yields:
        At first `sizes`, the numbers of observations and actions, and `metadata`, a JSON object of
        texts. Then the `actions` of each step, shape (n, a).

    Raises:
        ConfigError: If it is not a policy, or fails.
    """
    forbid_changes()
    try:
        parsed = onnx.load_model_from_string(data)
        onnx.load_external_data_for_model(parsed, str(folder))
        # onnx leaves the external data of sparse tensors to onnxruntime, which looks for it in the
        # current folder, which is empty.
        session = make_session(parsed.SerializeToString())
    except Exception as error:  # errors of onnx and onnxruntime have no common class
        raise ConfigError(f"not an ONNX file that can be loaded: {error}") from error
    num_obs = _num_observations(session)
    num_states = len(session.get_inputs()) - 1
    outputs = [output.type for output in session.get_outputs()]
    if len(outputs) <= num_states or outputs[0] not in _FLOATS:
        expected = f"expected actions of tensor(float), and {num_states} states"
        raise ConfigError(f"got the outputs {listing(outputs)}; {expected}")
    state = make_state(session, 2)
    actions, *new = call_model(session, np.zeros((2, num_obs), np.float32), state)
    if len(actions) != 2 or actions.ndim != 2:
        raise ConfigError(f"got actions of shape {actions.shape}; expected (2, a) for two rows")
    if (got := [part.shape for part in new]) != [part.shape for part in state]:
        raise ConfigError(f"got states of the shapes {got}; expected the shapes of the inputs")
    metadata = json.dumps(session.get_modelmeta().custom_metadata_map)
    yield {"sizes": [num_obs, actions.shape[1]], "metadata": metadata}
    for obs, dones in received:
        if state and state[0].shape[1] != len(obs):
            state = make_state(session, len(obs))
        elif dones is not None:
            for part in state:
                part[:, dones] = 0
        actions, *state = call_model(session, obs, state)
        yield {"actions": actions}


def make_state(session: onnxruntime.InferenceSession, count: int) -> list[NDArray[np.float32]]:
    """Return the state of `count` robots at the start: zeros, shape (layers, count, width)."""
    shapes = [node.shape for node in session.get_inputs()[1:]]
    return [np.zeros((layers, count, width), np.float32) for layers, _, width in shapes]


def make_session(model: bytes) -> onnxruntime.InferenceSession:
    """Return a session on the CPU, with one thread."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.log_severity_level = 1, 4
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def call_model(
    session: onnxruntime.InferenceSession,
    obs: Any,
    state: Sequence[NDArray[np.float32]] = (),
) -> list[Any]:
    """Return the actions of a model, and its new state.

    Args:
        session: The loaded model.
        obs: Observations, shape (n, k). They are passed row by row if the model takes a batch of 1.
        state: State of a recurrent network, each part of shape (layers, n, width).

    Returns:
        Actions, shape (n, a), and the parts of the state.

    Raises:
        ConfigError: If the model fails.
    """
    names = [node.name for node in session.get_inputs()]
    outputs = [node.name for node in session.get_outputs()[: len(names)]]
    count = len(obs) if session.get_inputs()[0].shape[0] == 1 else 1
    rows = [np.split(obs, count), *(np.split(part, count, axis=1) for part in state)]
    try:
        results = [
            session.run(outputs, dict(zip(names, row, strict=True)))
            for row in zip(*rows, strict=True)
        ]
        actions, *new = zip(*results, strict=True)
        return [np.concatenate(actions), *(np.concatenate(part, axis=1) for part in new)]
    except Exception as error:  # errors of onnxruntime have no common class
        reason = "needs too much memory" if "bfc_arena" in str(error) else f"fails: {error}"
        raise ConfigError(reason) from error


def _num_observations(session: onnxruntime.InferenceSession) -> int:
    """Return the number of observations.

    The first input must have the shape (n, k) or (1, k), and the states (layers, n, width).
    """
    first, *others = [node.shape for node in session.get_inputs()] or [()]
    is_valid = len(first) == 2 and isinstance(first[1], int) and _is_batch(first[0])
    for shape in others:
        is_valid &= len(shape) == 3 and _is_batch(shape[1])
        is_valid = is_valid and isinstance(shape[0], int) and isinstance(shape[2], int)
    if not is_valid:
        inputs = [f"{node.name} {node.type} {node.shape}" for node in session.get_inputs()]
        expected = "expected one of shape (n, k) or (1, k), and states of shape (layers, n, width)"
        raise ConfigError(f"got the inputs {listing(inputs)}; {expected}")
    return int(first[1])


def _is_batch(size: Any) -> bool:
    return size == 1 or not isinstance(size, int)
