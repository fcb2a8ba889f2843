import io
import pickle
import zipfile

import pytest
import torch

from terrainkit.errors import ConfigError
from terrainkit_robots.policy.torchscript import ScriptPolicy, check_code, load_script, try_script


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


class Loop(torch.nn.Module):
    def forward(self, x):
        while x.sum() < 1:
            x = x + 0
        return x


class Writes(torch.nn.Module):
    def forward(self, x):
        torch.save(x, "written")
        return x


class Mixes(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.layer = torch.nn.Linear(3, 2)

    def forward(self, x):
        return self.layer(x - x.mean(0))


def archive(module):
    file = io.BytesIO()
    torch.jit.save(torch.jit.script(module), file)
    return file.getvalue()


pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")


def test_state_is_kept_for_each_robot(tmp_path):
    torch.manual_seed(0)
    data = archive(Recurrent())
    (tmp_path / "policy.pt").write_bytes(data)
    policy, obs = ScriptPolicy(tmp_path / "policy.pt"), torch.randn(5, 3)
    assert (policy.num_obs, policy.num_actions) == (3, 4)
    first = policy(obs)
    assert not torch.allclose(policy(obs), first)
    policy.reset(torch.tensor([False, True, False, False, False]))
    again = policy(obs)
    torch.testing.assert_close(again[1], first[1])
    alone = load_script(data)
    steps = [alone(obs[:1]) for _ in range(3)]
    torch.testing.assert_close(again[:1], steps[2])


def damaged_archive():
    """Return an archive whose code cannot be decompressed."""
    name, file = "model/code/a.py", io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as zipped:
        zipped.writestr(name, "x = 1\n" * 100)
    data = bytearray(file.getvalue())
    start = 30 + len(name)  # after the header of the file in the archive
    data[start : start + 8] = b"\xff" * 8
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (Loop(), "got code with a loop; expected a network"),
        (Writes(), r"got code with torch\.save; expected a network"),
        (pickle.dumps({"model": 1}), "got no TorchScript archive"),
        (b"", "got no TorchScript archive"),
        (damaged_archive(), "got no TorchScript archive"),
    ],
)
def test_code_is_read_before_it_is_loaded(data, message):
    with pytest.raises(ConfigError, match=message):
        check_code(data if isinstance(data, bytes) else archive(data))


def test_pickles_are_refused(tmp_path):
    torch.save({"a": torch.zeros(1)}, tmp_path / "model_1.pt")
    with pytest.raises(ConfigError, match="got a pickle, which can execute any code; expected"):
        ScriptPolicy(tmp_path / "model_1.pt")


def test_robots_may_not_influence_each_other():
    with pytest.raises(ConfigError, match="robots influence each other"):
        try_script(archive(Mixes()))
