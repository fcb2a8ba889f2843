import io
import pickle
import sys
import zipfile
from pathlib import Path
from random import Random

import numpy as np
import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit.files.child_process import ProcessLimits, run_in_process
from terrainkit_robots.policy import policy_file
from terrainkit_robots.policy.policy_file import PolicyFile
from terrainkit_robots.policy.torchscript import checked_archive, load_script
from tests.child_functions import call_scripts, refusals

sys.path.append(str(Path(__file__).parents[3] / "benchmarks"))
from fuzzing.escapes.torchscript import load_escapes

ESCAPES = load_escapes()
WRITES = {name: escape for name, escape in ESCAPES.items() if escape.effect == "writes"}
KEPT = b"content"


class Recurrent(torch.nn.Module):
    """A network with the state of one robot, as legged_gym exports it."""

    def __init__(self):
        super().__init__()
        self.rnn = torch.nn.GRU(3, 4)
        self.register_buffer("hidden_state", torch.zeros(1, 1, 4))

    def forward(self, x):
        out, state = self.rnn(x.unsqueeze(0), self.hidden_state)
        self.hidden_state[:] = state
        return out.squeeze(0)


class Mixes(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.layer = torch.nn.Linear(3, 2)

    def forward(self, x):
        return self.layer(x - x.mean(0))


class Network(torch.nn.Module):
    """Parts that policies of the field consist of."""

    def __init__(self):
        super().__init__()
        self.encoder = torch.nn.Sequential(
            torch.nn.Conv1d(1, 4, 3, padding=1), torch.nn.ELU(), torch.nn.Flatten()
        )
        self.first = torch.nn.Linear(6, 6)
        self.layers = torch.nn.ModuleList([torch.nn.Linear(24, 8), torch.nn.Linear(8, 8)])
        self.norm = torch.nn.LayerNorm(8)
        self.attention = torch.nn.MultiheadAttention(8, 2, batch_first=True)
        self.last = torch.nn.Linear(8, 2)
        self.register_buffer("mean", torch.zeros(6))
        self.count = 0

    def forward(self, x):
        self.count += 1
        x = self.first(((x - self.mean) / 2.0).clamp(-5.0, 5.0))
        x = self.encoder(x[:, None])
        for layer in self.layers:
            x = torch.nn.functional.silu(layer(x))
        x = self.norm(x)[:, None]
        x, _ = self.attention(x, x, x)
        return torch.tanh(self.last(x[:, 0]))


def archive(module):
    file = io.BytesIO()
    torch.jit.save(torch.jit.script(module), file)
    return file.getvalue()


pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")


@pytest.fixture
def save(tmp_path):
    """Return a function that writes a policy, and returns its path."""

    def write(data):
        (tmp_path / "policy.pt").write_bytes(data)
        return tmp_path / "policy.pt"

    return write


@pytest.mark.parametrize("is_nested", [False, True])
def test_state_is_kept_for_each_robot(save, is_nested):
    torch.manual_seed(0)
    data = archive(torch.nn.Sequential(Recurrent()) if is_nested else Recurrent())
    policy, obs = PolicyFile(save(data)), torch.randn(5, 3)
    assert (policy.num_obs, policy.num_actions) == (3, 4)
    first = policy(obs)
    assert not np.allclose(policy(obs), first)
    policy.reset(torch.tensor([False, True, False, False, False]))
    policy.reset(torch.tensor([False, False, True, False, False]))
    again = policy(obs)
    np.testing.assert_allclose(again[1:3], first[1:3], atol=1e-6)
    alone = load_script(data)
    steps = [alone(obs[:1]).detach() for _ in range(3)]
    np.testing.assert_allclose(again[:1], steps[2], atol=1e-6)


def test_common_layers_run(save):
    network = Network().eval()
    policy, obs = PolicyFile(save(archive(network))), torch.randn(5, 6)
    assert (policy.num_obs, policy.num_actions) == (6, 2)
    np.testing.assert_allclose(policy(obs), network(obs).detach(), atol=1e-6)


def damaged_archive():
    """Return an archive whose code cannot be decompressed."""
    name, file = "model/code/a.py", io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as zipped:
        zipped.writestr(name, "x = 1\n" * 100)
    data = bytearray(file.getvalue())
    start = 30 + len(name)  # after the header of the file in the archive
    data[start : start + 8] = b"\xff" * 8
    return bytes(data)


def saved_pickle():
    file = io.BytesIO()
    torch.save({"a": torch.zeros(1)}, file)
    return file.getvalue()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (pickle.dumps({"model": 1}), "got no TorchScript archive"),
        (b"", "got no TorchScript archive"),
        (damaged_archive(), "got no TorchScript archive, or a damaged one; expected TorchScript"),
        (saved_pickle(), "got a pickle, which can execute any code; expected TorchScript"),
    ],
)
def test_archive_is_checked(data, message):
    with pytest.raises(ConfigError, match=message):
        checked_archive(data)


def test_archive_with_damaged_weights_is_rejected():
    data, rng = archive(Mixes()), Random(0)
    with zipfile.ZipFile(io.BytesIO(data)) as zipped:
        (weights,) = (f for f in zipped.infolist() if f.filename.endswith("data/0"))
    start = data.index(zipped_bytes(data, weights))
    for _ in range(40):
        damaged = bytearray(data)
        damaged[start + rng.randrange(weights.file_size)] ^= 1 << rng.randrange(8)
        with pytest.raises(ConfigError, match="or a damaged one"):
            checked_archive(bytes(damaged))


def zipped_bytes(data, info):
    with zipfile.ZipFile(io.BytesIO(data)) as zipped:
        return zipped.read(info)


def test_robots_may_not_influence_each_other(save):
    with pytest.raises(ConfigError, match=r"policy\.pt is not a policy: .*robots influence each"):
        PolicyFile(save(archive(Mixes())))


# Escapes. Each was seen to write a file in plain torch (benchmarks/verify_escapes.py).


@pytest.fixture
def targets(tmp_path):
    """Return the archive of each escape that writes, by the file that it writes."""
    archives = {}
    for index, escape in enumerate(WRITES.values()):
        target = tmp_path / f"{index}"
        if index % 2:  # the others create it
            target.write_bytes(KEPT)
        archives[target] = escape.archive(target)
    return archives


def unchanged(targets):
    folder = next(iter(targets)).parent
    assert len(list(folder.iterdir())) == len(targets) // 2
    return all(path.read_bytes() == KEPT for path in folder.iterdir())


def test_escapes_are_refused_by_their_operators(targets):
    found = run_in_process(refusals, list(targets.values()))["messages"].tolist()
    refused = "got code with", "got constants of"
    reasons = dict(zip(WRITES, found, strict=True))
    assert {name for name, reason in reasons.items() if not reason.startswith(refused)} == set()
    assert len(found) >= 56
    assert unchanged(targets)


@pytest.mark.skipif(sys.platform != "linux", reason="TorchScript is refused elsewhere")
def test_escapes_change_no_file_if_operators_are_not_checked(targets):
    run_in_process(call_scripts, list(targets.values()), True)
    assert unchanged(targets)
    run_in_process(call_scripts, list(targets.values()), False)  # without the sandbox, they do
    changed = [path for path in targets if path.exists() and path.read_bytes() != KEPT]
    assert len(changed) > 0.9 * len(targets)


def test_endless_loop_for_more_robots_is_an_error(save, monkeypatch):
    monkeypatch.setattr(policy_file, "LIMITS", ProcessLimits(seconds=10.0))
    policy = PolicyFile(save(ESCAPES["list-comprehension-if-rows"].archive("")))
    assert policy(torch.zeros(2, 8)).shape == (2, 3)
    with pytest.raises(ConfigError, match=r"policy\.pt: takes more than 10 s"):
        policy(torch.zeros(4, 8))


def test_growing_memory_is_an_error(save):
    policy = PolicyFile(save(ESCAPES["tensor-if-rows"].archive("")))
    with pytest.raises(ConfigError, match=r"policy\.pt: .*"):
        policy(torch.zeros(4, 8))


@pytest.mark.parametrize("name", ["warn", "print", "comment-of-failing-line", "raise"])
def test_what_a_policy_prints_is_discarded(save, capfd, name):
    path = save(ESCAPES[name].archive(""))
    if name in ("warn", "print"):
        PolicyFile(path)
    else:
        with pytest.raises(ConfigError) as caught:
            PolicyFile(path)
        assert str(caught.value).isprintable()
    assert capfd.readouterr() == ("", "")


def test_crash_is_an_error(save):
    with pytest.raises(ConfigError, match="is not a policy: the process crashed"):
        PolicyFile(save(ESCAPES["nested-types"].archive("")))


def test_torchscript_needs_the_sandbox(monkeypatch):
    monkeypatch.setattr("platform.machine", lambda: "riscv64")
    with pytest.raises(ConfigError, match="TorchScript can execute code, and is run on Linux"):
        next(policy_file.run_script(iter(()), b""))
