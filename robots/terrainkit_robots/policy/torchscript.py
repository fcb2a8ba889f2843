"""Load TorchScript of a stranger: its code is read before torch loads it, in a child process."""

import io
import re
import warnings
import zipfile
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, listing
from terrainkit.files.child_process import ProcessError, ProcessLimits, run_in_process
from terrainkit_robots.policy.onnx_policy import MAX_FILE_SIZE, read_file

LIMITS = ProcessLimits(seconds=120.0, memory=16 << 30)
"""Limits of loading a file and of its first calls; torch alone reserves some GB of addresses."""

MAX_CODE_SIZE, CODE_FILES = 1 << 20, re.compile(r"[^/]+/code/.*\.py")
"""Largest code in a file [bytes], and where it is."""

# aten has operators that read and write files, such as `save` and `from_file`.
_OPERATORS = """
abs add addcmul addmm append arange batch_norm bmm cat celu chunk clamp clamp_max clamp_min clip
clone contiguous conv1d conv2d copy cos detach dim div dropout elu empty eq exp expand expand_as
expm1 extend fill flatten floor floordiv fmod format full full_like gather ge gelu gru gru_cell gt
hardsigmoid hardswish hardtanh index index_select instance_norm insert is_floating_point item items
keys layer_norm le leaky_relu len lerp linear list log log1p log_softmax logical_and logical_not
logical_or logsigmoid lstm lstm_cell lt masked_fill matmul max maximum mean min minimum mish mm mul
nan_to_num narrow ne neg norm normalize numel ones ones_like permute pow prelu reciprocal relu
relu6 remainder repeat reshape rms_norm rnn_relu rnn_tanh round rsqrt rsub select selu sigmoid sign
silu sin size slice softmax softplus softsign split split_with_sizes sqrt square squeeze stack std
sub sum t tanh tensor tile to transpose tril triu type_as unbind unflatten unsqueeze values var
view warn where zero zeros zeros_like
"""
OPERATORS = frozenset(_OPERATORS.split())
"""Operators that a network may call; those of Python's operators, such as `__not__`, as well."""


class ScriptPolicy:
    """A policy in a TorchScript file, from observations (n, k) to actions (n, a).

    A recurrent network keeps the state of each robot; `reset` clears it.
    """

    metadata: ClassVar[dict[str, str]] = {}

    def __init__(self, path: Path) -> None:
        """Load a file, and call it once.

        Args:
            path: The file.

        Raises:
            ConfigError: If the file is not a policy.
        """
        self.__name__, data = path.name, read_file(path)
        try:
            check_code(data)
            loaded = run_in_process(try_script, data, limits=LIMITS)
            self.num_obs, self.num_actions = loaded["sizes"].tolist()
            self._module = load_script(data)
        except (ProcessError, ConfigError, RuntimeError) as error:
            reason = " ".join(str(error).split())[:300]
            raise ConfigError(f"{path} is not a policy: {reason}") from error

    def __call__(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions (n, a) for observations (n, k).

        Raises:
            ConfigError: If the network fails.
        """
        try:
            return call_script(self._module, obs)
        except RuntimeError as error:
            reason = " ".join(str(error).split())[-200:]
            raise ConfigError(f"{self.__name__} fails: {reason}") from error

    def reset(self, dones: torch.Tensor) -> None:
        """Clear the state of robots, a mask of shape (n,)."""
        for _, _, state in _states(self._module):
            if state.shape[1] == len(dones):
                state[:, dones.to(state.device)] = 0


def check_code(data: bytes) -> None:
    """Check a TorchScript file before it is loaded: it has code, without loops or other operators.

    Raises:
        ConfigError: If it is another kind of file, or its code is more than a network.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            files = archive.infolist()
            code = [file for file in files if CODE_FILES.fullmatch(file.filename)]
            if not code:
                got = "got a pickle, which can execute any code" if files else "got no file inside"
                raise ConfigError(f"{got}; expected TorchScript (torch.jit.save) or ONNX")
            size = sum(file.file_size for file in files)
            if size > MAX_FILE_SIZE or sum(file.file_size for file in code) > MAX_CODE_SIZE:
                raise ConfigError(f"got {size} bytes, unpacked; expected a smaller network")
            text = "\n".join(archive.read(file).decode() for file in code)
    except ConfigError:
        raise
    except Exception as error:  # of zipfile and its decompressors, for damaged files
        expected = "expected TorchScript (torch.jit.save) or ONNX"
        raise ConfigError(f"got no TorchScript archive; {expected}") from error
    called = re.findall(r"(?<![\w.])((?:torch|ops)\.[\w.]+)\(", text)
    names = {name for name in called if not _is_known(name)}
    if re.search(r"^\s*(while|for)\b", text, re.MULTILINE):
        names.add("a loop")
    if names:
        raise ConfigError(f"got code with {listing(sorted(names))}; expected a network alone")


def _is_known(name: str) -> bool:
    kind, _, operator = name.partition(".")
    if kind == "ops":
        return operator.startswith("prim.")
    return operator.strip("_") in OPERATORS or re.fullmatch("__[a-z]+__", operator) is not None


def load_script(data: bytes) -> Any:
    """Return the module of a file whose code was checked."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch deprecates TorchScript, which these files are
        return torch.jit.load(io.BytesIO(data), map_location="cpu").eval()


def try_script(data: bytes) -> dict[str, NDArray[np.int64]]:
    """Return the `sizes` of a network, observations and actions, after some calls.

    Raises:
        ConfigError: If it is not a function of the observations of each robot alone.
    """
    torch.set_num_threads(1)
    modules = [load_script(data) for _ in range(3)]
    weights = [each for _, each in modules[0].named_parameters() if each.dim() == 2]
    inputs = {weight.shape[1] for weight in weights}
    recurrent = [w for name, w in modules[0].named_parameters() if name.endswith("weight_ih_l0")]
    sizes = [recurrent[0].shape[1]] if recurrent else sorted(inputs, reverse=True)
    steps = torch.randn(3, 2, 1 << 16, generator=torch.Generator().manual_seed(0))
    reason: object = "it has no weights"
    for size in sizes:
        try:
            actions = [call_script(modules[0], obs[:, :size]) for obs in steps]
            single = [
                [call_script(module, obs[k : k + 1, :size]) for obs in steps]
                for k, module in enumerate(modules[1:])
            ]
        except RuntimeError as error:
            reason = error
            continue
        rows = torch.cat([torch.stack(each) for each in single], dim=1)
        if rows.dim() != 3 or not torch.allclose(
            torch.stack(actions), rows, atol=1e-4, equal_nan=True
        ):
            raise ConfigError("got a network whose robots influence each other; expected rows")
        return {"sizes": np.array([size, rows.shape[2]])}
    raise ConfigError(f"fails with {listing(map(str, sizes))} observations: {reason}")


def call_script(module: Any, obs: torch.Tensor) -> torch.Tensor:
    """Return the actions of a module, whose state gets a column for each robot."""
    with torch.inference_mode(False), torch.no_grad():
        for owner, name, state in _states(module):
            if state.shape[1] != len(obs):
                setattr(owner, name, state.new_zeros(state.shape[0], len(obs), state.shape[2]))
        actions: torch.Tensor = module(obs.detach().clone().float())
    return actions


def _states(module: Any) -> list[tuple[Any, str, torch.Tensor]]:
    """Return owner, name and value of each buffer with a state, shape (layers, n, width)."""
    found = []
    for path, value in module.named_buffers():
        *parents, name = path.split(".")
        owner = module
        for each in parents:
            owner = getattr(owner, each)
        if value.dim() == 3 and re.search("hidden|cell|state", name):
            found.append((owner, name, value))
    return found
