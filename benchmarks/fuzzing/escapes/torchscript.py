"""TorchScript policies that do more than compute actions; torchscript.toml lists them.

Each one is a policy of any robot, so that only a check of its code, or the limits of a sandbox, can
refuse it. benchmarks/verify_escapes.py shows that each has its effect in plain torch.
"""

import importlib.util
import io
import sys
import tempfile
import tomllib
import warnings
import zipfile
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import torch

MARK = "::error::"
"""What is printed; a runner of CI takes it for a command."""

_FILE = Path(__file__).with_suffix(".toml")
_CODE = "code/__torch__.py"


@dataclass(frozen=True, kw_only=True)
class Escape:
    """A TorchScript archive that does more than compute actions.

    In its text, `PATH` is the file that it writes, and `NUM_OBS` and `NUM_ACTIONS` are its sizes.
    """

    effect: str
    """What it does: `writes` PATH, `hangs` (runs without end and ignores signals), `prints` MARK to
    stdout, stderr or in an error, needs more than 1 GB of `memory`, or `crashes` the process."""

    body: str = ""
    """Lines at the start of `forward`, in the language of the archive."""

    before: str = ""
    """Functions and classes before the class of the policy."""

    methods: str = ""
    """Methods after `forward`."""

    replace: list[list[str]] = field(default_factory=list)
    """Pairs of text to find in each file of the archive and what replaces it, in Latin-1."""

    repeat: list[tuple[str, str, int]] = field(default_factory=list)
    """Words in the texts, and what replaces each of them so many times."""

    file: str = _CODE
    """Where the code is. Elsewhere than usual, a file that torch ignores has harmless code."""

    module: str = ""
    """Python source with a class `Policy`, which torch compiles, in place of the other texts."""

    def archive(self, path: Path | str, num_obs: int = 8, num_actions: int = 3) -> bytes:
        """Return the archive.

        Args:
            path: What it writes, if it writes.
            num_obs: Number of observations of its policy.
            num_actions: Number of actions.
        """
        values = {"PATH": str(path), "NUM_OBS": str(num_obs), "NUM_ACTIONS": str(num_actions)}
        if self.module:
            return _pack(_compiled(_replace(self.module, values)))
        files = dict(_harmless(num_obs, num_actions))
        end = "    weight = self.weight\n"
        head, tail = files[_CODE].decode().split(end)
        inserted = "".join(f"    {line}\n" for line in self.body.splitlines())
        methods = "".join(f"  {line}\n" for line in self.methods.splitlines())
        code = self.before + head + inserted + end + tail + methods
        if self.file != _CODE:
            files["code/harmless.py"] = files.pop(_CODE)
        values |= {word: part * times for word, part, times in self.repeat}
        files[self.file] = _replace(code, values).encode()
        for old, new in self.replace:
            for name, data in files.items():
                if name == self.file or name.endswith(".pkl"):
                    new_data = _replace(new, values).encode("latin-1")
                    files[name] = data.replace(old.encode("latin-1"), new_data)
        return _pack(files)


def load_escapes() -> dict[str, Escape]:
    """Return the escapes by name."""
    return {name: Escape(**table) for name, table in tomllib.loads(_FILE.read_text()).items()}


class Policy(torch.nn.Module):
    """A harmless policy."""

    def __init__(self, num_obs: int, num_actions: int) -> None:
        super().__init__()
        self.weight = torch.nn.Parameter(torch.full((num_actions, num_obs), 0.1))
        self.bias = torch.nn.Parameter(torch.zeros(num_actions))

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return the actions."""
        return torch.nn.functional.linear(obs, self.weight, self.bias)


Policy.__module__ = "__main__"  # torch calls it __torch__.Policy


@cache
def _harmless(num_obs: int, num_actions: int) -> dict[str, bytes]:
    return _saved(Policy(num_obs, num_actions))


@cache
def _compiled(source: str) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "policy.py"
        path.write_text(source)
        spec = importlib.util.spec_from_file_location("escape_policy", path)
        assert spec
        assert spec.loader
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module  # where torch looks for the source of classes
        spec.loader.exec_module(module)
        return _saved(module.Policy())


def _saved(policy: torch.nn.Module) -> dict[str, bytes]:
    """Return the files of a policy that torch compiles, without the positions in its source."""
    data = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch deprecates TorchScript
        torch.jit.save(torch.jit.script(policy), data)
    with zipfile.ZipFile(data) as archive:
        names = [name for name in archive.namelist() if not name.endswith(".debug_pkl")]
        return {name.partition("/")[2]: archive.read(name) for name in names}


def _replace(text: str, values: dict[str, str]) -> str:
    for word, value in values.items():
        text = text.replace(word, value)
    return text


def _pack(files: dict[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(f"policy/{name}"), content)
    return data.getvalue()


ESCAPES = load_escapes()
