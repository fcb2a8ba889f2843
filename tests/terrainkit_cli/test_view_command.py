import re
import signal
import subprocess
import sys
from urllib.request import urlopen

import pytest

import terrainkit as tk


@pytest.fixture
def map_file(tmp_path):
    config = tk.MapConfig(rows=1, cols=3, border=1.0, preset="stairs")
    return tk.generate(config).save(tmp_path / "map.npz")


def test_view_serves_until_it_is_ended(map_file):
    command = [sys.executable, "-m", "terrainkit_cli.main", "view", map_file]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        line = run.stdout.readline()
        address = re.match(r"http://localhost:\d+(?= shows .*map\.npz)", line)
        assert address, line
        with urlopen(address.group(), timeout=10) as response:
            assert response.status == 200
        run.terminate()
        _, errors = run.communicate(timeout=30)
    assert run.returncode == 128 + signal.SIGTERM
    assert errors == "terrainkit: error: ended by SIGTERM\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("missing.npz",), "missing.npz"),
        (("map.npz", "--port", 0), "--port: got 0; expected 1 to 65535"),
        (("map.npz", "--host", "no.such.host.invalid"), "no.such.host.invalid"),
    ],
)
@pytest.mark.usefixtures("map_file")
def test_view_rejects_invalid_input(terrainkit, words, message):
    run = terrainkit("view", *words)
    assert run.returncode == 2
    assert message in run.stderr
    assert run.stderr.count("\n") == 1


@pytest.mark.usefixtures("map_file")
def test_view_without_viser_names_the_extra(terrainkit, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    run = terrainkit("view", "map.npz")
    assert run.returncode == 2
    assert "pip install terrainkit[view]" in run.stderr
