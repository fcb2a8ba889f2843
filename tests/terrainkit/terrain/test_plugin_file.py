import sys

import pytest

from terrainkit.errors import ConfigError, PluginError
from terrainkit.terrain import registry
from terrainkit.terrain.plugin_file import load_plugin, plugin_files

BUMP = """
from dataclasses import dataclass
import numpy as np
from terrainkit import parameter
from terrainkit.terrain import Terrain
from terrainkit.terrains.stairs import Stairs  # not registered: it is built in
from terrainkit.overlays.mirror import Mirror
{more}

class Shared(Terrain):
    def heights(self, grid, rng):
        return np.zeros(grid.shape)

@dataclass(frozen=True, kw_only=True)
class Bump(Shared):
    height: float = parameter.height(0.05, 0.3)

    def heights(self, grid, rng):
        return np.full(grid.shape, self.height)

@dataclass(frozen=True, kw_only=True)
class Tilted(Mirror):
    pass

class Unfinished(Terrain):
    pass
"""


@pytest.fixture
def write(tmp_path, monkeypatch, own_registry):  # noqa: ARG001
    """Return a function that writes a plugin file; what it imports is forgotten."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    modules = {*sys.modules}

    def write(name, text):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    yield write
    for name in {*sys.modules} - modules:
        del sys.modules[name]


def test_load_plugin_registers_terrains_and_overlays(write):
    write("beside.py", BUMP.format(more="").replace("Bump", "Dip"))
    path = write("bump.py", BUMP.format(more="from beside import Dip"))
    load_plugin(path)
    load_plugin(path.parent / ".." / path.parent.name / "bump.py")  # not a second time
    assert plugin_files() == (path,)
    assert sorted(registry.registered_names(registry.TERRAINS)) == ["bump", "dip"]
    assert registry.registered_names(registry.OVERLAYS) == ("tilted",)
    assert registry.plugin_name(registry.get_terrain("bump")) == "terrain bump (plugin_bump:Bump)"
    assert sys.path[-1] == str(path.parent)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("raise SystemExit", "SystemExit"),
        ("def f(:", "SyntaxError: invalid syntax"),
        ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
        (
            BUMP.format(more="").replace("@dataclass(frozen=True, kw_only=True)", ""),
            "Bump lacks @da",
        ),
        (BUMP.format(more="").replace("Bump", "Stairs"), "is taken by terrainkit.terrains.stairs"),
    ],
)
def test_load_plugin_reports_what_fails_in_one_line(write, text, problem):
    path = write("bump.py", text)
    with pytest.raises(PluginError) as error:
        load_plugin(path)
    assert str(error.value).startswith(f"--plugin {path}: ")
    assert problem in str(error.value)
    assert "\n" not in str(error.value)
    assert plugin_files() == ()


@pytest.mark.parametrize("name", ["missing.py", "", "\0.py", "x" * 5000 + ".py", "bump.txt", "."])
def test_load_plugin_rejects_what_is_no_python_file(write, tmp_path, name):
    write("bump.txt", BUMP.format(more=""))
    with pytest.raises(ConfigError, match=r"^--plugin: got .*; expected a Python file, such as b"):
        load_plugin(f"{tmp_path}/{name}" if name else "")


def test_load_plugin_rejects_two_files_of_one_name(write):
    load_plugin(write("a/bump.py", ""))
    with pytest.raises(ConfigError, match=r"bump\.py; expected different names"):
        load_plugin(write("b/bump.py", ""))
