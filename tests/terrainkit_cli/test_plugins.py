from pathlib import Path

import pytest

from terrainkit.terrain import registry
from tests.tables import read_table

DOCS = Path(__file__).parents[2] / "docs"

MODULE = """
import os, sys
from dataclasses import dataclass
import numpy as np
from terrainkit.terrain import Terrain, parameter

if os.environ.get("FAIL") == "import":
    sys.exit(0)

@dataclass(frozen=True, kw_only=True)
class Dunes(Terrain):
    height: float = parameter.height(0.0, 0.1)

    def heights(self, grid, rng):
        if os.environ.get("FAIL") == "heights":
            sys.exit(0)
        return np.full(grid.shape, self.height)
"""

ENTRY_POINTS = """
[terrainkit.terrains]
dunes = dune_pack:Dunes
[terrainkit.overlays]
ripples = dune_pack:Dunes
[terrainkit.tasks]
rover = dune_pack
[terrainkit.rules]
DUN = dune_pack
"""


@pytest.fixture
def dune_pack(tmp_path, monkeypatch):
    """Install a package for child processes; the environment variable FAIL says where it fails."""
    site = tmp_path / "site"
    info = site / "dune_pack-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "dune_pack.py").write_text(MODULE)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: dune_pack\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.setenv("PYTHONPATH", str(site), prepend=":")


SMALL = ("--rows", 2, "--cols", 2, "--border", 0, "--terrain", "dunes", "-o", "map.npz")
IMPORT = "terrain dunes (dune_pack:Dunes) cannot be loaded: SystemExit: 0"
BUILD = "patch (0, 0): terrain dunes (dune_pack:Dunes): SystemExit: 0"


@pytest.mark.usefixtures("dune_pack")
@pytest.mark.parametrize(("fails", "words", "told"), read_table(__file__, "failing_plugin"))
def test_failing_plugin_is_one_line(terrainkit_process, monkeypatch, tmp_path, fails, words, told):
    monkeypatch.setenv("FAIL", fails)
    run = terrainkit_process(*words)
    expected = (2, "", f"terrainkit: error: {told}\n")
    assert (run.returncode, run.stdout, run.stderr) == expected
    assert not (tmp_path / "map.npz").exists()


@pytest.mark.usefixtures("dune_pack")
def test_plugin_that_fails_later_is_one_line(terrainkit_process, monkeypatch):
    assert terrainkit_process("generate", *SMALL).returncode == 0
    monkeypatch.setenv("FAIL", "heights")
    run = terrainkit_process("check-map", "map.npz")
    assert (run.returncode, run.stderr) == (2, f"terrainkit: error: {BUILD}\n")
    monkeypatch.setenv("FAIL", "import")
    run = terrainkit_process("check-map", "map.npz")
    assert run.returncode == 2
    assert run.stderr == f"terrainkit: error: map.npz: config: terrains[0]: {IMPORT}\n"


# python_api.md defines the class in a script.
BLOCKS = [
    part.partition("```")[0] for part in (DOCS / "python_api.md").read_text().split("```python\n")
]
(SCRIPT,) = (block for block in BLOCKS if "class SideStep(" in block)


@pytest.mark.usefixtures("own_registry")
def test_map_of_a_class_in_the_docs(terrainkit, terrainkit_process, tmp_path):
    script = tmp_path / "side_step.py"
    script.write_text(SCRIPT.replace("MapConfig(", "MapConfig(rows=2, cols=1, border=1.0, "))
    plugin = ("--plugin", "side_step.py")
    size = ("--rows", 2, "--cols", 2, "--border", 0, "--jobs", 2)
    made = terrainkit_process("generate", "-o", "map.npz", *plugin, "--terrain", "side_step", *size)
    assert (made.returncode, made.stderr) == (0, "")
    for options in ((), plugin):
        for words in (
            ("preview", "map.npz", "-o", "map.png", "--overwrite"),
            ("info", "map.npz"),
            ("check-map", "map.npz"),
            ("feasibility", "map.npz", "--robot", "quadruped"),
            ("export", "map.npz", "-o", "map.xml", "--overwrite"),
            ("diff", "map.npz", "map.npz"),
        ):
            run = terrainkit(*words, *options)
            assert run.returncode == 0, run.stderr
            warned = 0 if options else words.count("map.npz")
            assert run.stderr.count("no terrain 'side_step'") == warned
        again = terrainkit("generate", "-o", "again.npz", "--config", "map.npz", *options)
        if not options:
            assert again.returncode == 2
            assert (
                "map.npz: config: terrains[0]: no terrain 'side_step' is built in" in again.stderr
            )
            assert "--plugin FILE.py" in again.stderr
            # Nothing but the option imports the file, which has the name of the class.
            assert not registry.registered_names(registry.TERRAINS)
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "map.npz").read_bytes()
