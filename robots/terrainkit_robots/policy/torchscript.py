"""Load and call TorchScript of a stranger in a child process, which may change nothing.

Parts of a file are executed while it is loaded, such as `__setstate__` and default arguments.
Therefore the process gives up its rights first. Then the operators of the network are checked.
"""

import io
import pickletools
import re
import warnings
import zipfile
from collections.abc import Iterator
from operator import attrgetter
from typing import Any

import torch

from terrainkit.errors import ConfigError, listing
from terrainkit.files.sandbox import forbid_changes

TENSOR_CLASSES = re.compile(
    r"torch\._utils _rebuild_tensor_v2|torch \w+Storage|collections OrderedDict"
)
"""What the pickle of a tensor names. Other objects may execute code while they are loaded."""

MAX_UNPACKED_SIZE = 1 << 28
"""Largest size of the content of a file [bytes]."""

# aten has operators that read and write files, such as `save` and `from_file`.
_OPERATORS = """
abs acos adaptive_avg_pool1d adaptive_avg_pool2d adaptive_max_pool1d adaptive_max_pool2d add addbmm
addcmul addmm addr alias all amax amin any append arange argmax argmin asin atan atan2 avg_pool1d
avg_pool2d baddbmm batch_norm bilinear bmm Bool broadcast_to bucketize cat cdist celu chunk clamp
clamp_max clamp_min clip clone contiguous conv1d conv2d conv_transpose1d convolution copy cos cosh
count cpu cross cumprod cumsum derive_index detach diag diagonal dim div dot dropout dstack einsum
elu embedding empty eq erf erfinv exp expand expand_as expm1 extend eye
fake_quantize_per_tensor_affine fill flatten flip Float FloatImplicit floor floor_divide floordiv
fmod format frac full full_like gather ge gelu glu group_norm gru gru_cell gt hardshrink hardsigmoid
hardswish hardtanh heaviside hstack hypot index index_put index_select insert instance_norm Int
interpolate IntImplicit is_autocast_enabled is_contiguous is_floating_point is_grad_enabled
is_nonzero isfinite isinf isnan item items keys kron layer_norm le leaky_relu len lerp lift_fresh
linalg_norm linalg_vector_norm linear linspace list log log10 log1p log2 log_sigmoid log_softmax
logaddexp logical_and logical_not logical_or logit logsumexp lstm lstm_cell lt masked_fill
masked_select matmul matrix_exp max max_pool1d max_pool2d maximum mean meshgrid min minimum mish mm
movedim mul mv nan_to_num narrow native_layer_norm native_multi_head_attention ne neg nonzero norm
numel one_hot ones ones_like outer pad permute pixel_shuffle pop pow prelu prod range_length ravel
reciprocal relu relu6 remainder remove repeat repeat_interleave reshape reshape_as reverse rms_norm
rnn_relu rnn_tanh roll round rrelu rsqrt rsub ScalarImplicit scaled_dot_product_attention scatter
searchsorted select selu sgn sigmoid sign silu sin sinh size slice softmax softplus softshrink sort
split split_with_sizes sqrt square squeeze stack std std_mean stride sub sum swapaxes t tan tanh
tensor tensor_split threshold tile to topk trace transformer_encoder_layer_fwd transpose tril triu
true_divide trunc type_as unbind unflatten unfold unsafe_chunk unsqueeze upsample_bilinear2d
upsample_nearest1d upsample_nearest2d values var var_mean view view_as vstack warn where zero zeros
zeros_like
"""
OPERATORS = frozenset(_OPERATORS.split())
"""Operators that a network may call; those of Python's operators, such as `__not__`, as well."""

_LANGUAGE = """
abs Constant data device DictConstruct dtype GetAttr If is_cpu is_cuda is_nested layout
ListConstruct ListUnpack Loop max min NumToTensor Print RaiseException requires_grad SetAttr shape
TupleConstruct TupleIndex TupleSlice TupleUnpack type unchecked_cast Uninitialized
"""
LANGUAGE = frozenset(_LANGUAGE.split())
"""Nodes of the language, without `fork` and calls that are not inlined. Prints are discarded."""


def run_script(received: Iterator[Any], data: bytes) -> Iterator[dict[str, Any]]:
    """Yield what a network is, and then its actions; the function of a child process.

    A recurrent network keeps the state of each robot.

    Args:
        received: For each step, observations of shape (n, k), and a mask of the robots whose state
            is cleared first, shape (n,), or None.
        data: The TorchScript file.

    Yields:
        At first `sizes`, the numbers of observations and actions, and `metadata`, an empty JSON
        object. Then the `actions` of each step, shape (n, a).

    Raises:
        ConfigError: If it is not a function of the observations of each robot alone, or fails.
    """
    torch.set_num_threads(1)
    if not forbid_changes():
        raise ConfigError("TorchScript can execute code, and is run on Linux alone; expected ONNX")
    data = checked_archive(data)
    modules = [load_script(data) for _ in range(3)]
    check_operators(modules[0])
    yield {"sizes": network_sizes(modules), "metadata": "{}"}
    for obs, dones in received:
        if dones is not None:
            clear_state(modules[0], torch.from_numpy(dones))
        yield {"actions": call_script(modules[0], torch.from_numpy(obs)).numpy()}


def checked_archive(data: bytes) -> bytes:
    """Return the archive of a TorchScript file, written anew.

    torch does not compare the checksums, and may find other content in a file than `zipfile`.

    Raises:
        ConfigError: If it is damaged, or another kind of file.
    """
    expected = "expected TorchScript (torch.jit.save) or ONNX"
    result = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(file.file_size for file in archive.infolist())
            if size > MAX_UNPACKED_SIZE:
                raise ConfigError(f"got {size} bytes, unpacked; expected a smaller network")
            content = {name: archive.read(name) for name in archive.namelist()}
        # torch finds names in capitals, too.
        constants = (content[name] for name in content if name.lower().endswith("/constants.pkl"))
        names = sorted({name for data in constants for name in _classes(data)})
        if objects := [name for name in names if not TENSOR_CLASSES.fullmatch(name)]:
            raise ConfigError(f"got constants of {listing(objects)}; expected tensors")
    except ConfigError:
        raise
    except Exception as error:  # of zipfile and its decompressors
        raise ConfigError(f"got no TorchScript archive, or a damaged one; {expected}") from error
    if not any(re.fullmatch(r"[^/]+/code/.*\.py", name) for name in content):
        got = "got a pickle, which can execute any code" if content else "got no file inside"
        raise ConfigError(f"{got}; {expected}")
    with zipfile.ZipFile(result, "w") as archive:
        for name, member in content.items():
            archive.writestr(name, member)
    return result.getvalue()


def _classes(data: bytes) -> Iterator[str]:
    """Yield the classes and functions that a pickle names."""
    for operation, argument, _ in pickletools.genops(data):
        if operation.name == "GLOBAL":
            yield str(argument)


def check_operators(module: Any) -> None:
    """Check that all methods of a module and its parts consist of the operators of networks.

    Raises:
        ConfigError: If they do not.
    """
    kinds = set()
    for name, part in module.named_modules():
        if part._c._get_forward_hooks() or part._c._get_forward_pre_hooks():
            kinds.add(f"a hook of {name or 'the network'}")
        for method in part._c._method_names():
            kinds |= set(_kinds(part._c._get_method(method).inlined_graph))
    if unknown := sorted(kind for kind in kinds if not _is_known(kind)):
        raise ConfigError(f"got code with {listing(unknown)}; expected a network alone")


def _kinds(block: Any) -> Iterator[str]:
    """Yield the kinds of the nodes of a graph, such as `aten::linear`."""
    for node in block.nodes():
        yield node.kind()
        for inner in node.blocks():
            yield from _kinds(inner)


def _is_known(kind: str) -> bool:
    domain, _, name = kind.partition("::")
    if domain == "prim":
        return name in LANGUAGE
    return domain == "aten" and (
        name.strip("_") in OPERATORS or re.fullmatch("__[a-z]+__", name) is not None
    )


def load_script(data: bytes) -> Any:
    """Return the module of an archive."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch deprecates TorchScript, which these files are
        return torch.jit.load(io.BytesIO(data), map_location="cpu").eval()


def network_sizes(modules: list[Any]) -> tuple[int, int]:
    """Return the numbers of observations and actions of a network, of three equal modules.

    Raises:
        ConfigError: If it is not a function of the observations of each robot alone.
    """
    parameters = dict(modules[0].named_parameters())
    inputs = {value.shape[1] for value in parameters.values() if value.dim() == 2}
    recurrent = [w.shape[1] for name, w in parameters.items() if name.endswith("weight_ih_l0")]
    sizes = recurrent[:1] or sorted(inputs, reverse=True)
    steps = torch.randn(3, 2, 1 << 16, generator=torch.Generator().manual_seed(0))
    reason: object = "it has no weights"
    for size in sizes:
        try:
            actions = [call_script(modules[0], obs[:, :size]) for obs in steps]
            single = [
                torch.stack([call_script(module, obs[k : k + 1, :size]) for obs in steps])
                for k, module in enumerate(modules[1:])
            ]
        except RuntimeError as error:
            reason = error
            continue
        rows = torch.cat(single, dim=1)
        if rows.dim() != 3 or not torch.allclose(
            torch.stack(actions), rows, atol=1e-4, equal_nan=True
        ):
            raise ConfigError("got a network whose robots influence each other; expected rows")
        return size, rows.shape[2]
    raise ConfigError(f"fails with {listing(map(str, sizes))} observations: {reason}")


def clear_state(module: Any, dones: torch.Tensor) -> None:
    """Clear the state of robots, a mask of shape (n,)."""
    for _, _, state in _states(module):
        if state.shape[1] == len(dones):
            state[:, dones] = 0


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
    for path, value in module.named_buffers():  # a buffer that modules share, once
        parent, _, name = path.rpartition(".")
        if value.dim() == 3 and re.search("hidden|cell|state", name):
            found.append((attrgetter(parent)(module) if parent else module, name, value))
    return found
