import importlib
import sys

import pytest

import terrainkit as tk


@pytest.fixture
def load_adapter(monkeypatch):
    """Import an adapter with stand-ins for its framework; tests/frameworks runs the real ones."""
    loaded = []

    def load(name, modules):
        for module, stand_in in modules.items():
            monkeypatch.setitem(sys.modules, module, stand_in)
        loaded.append(f"terrainkit.integrations.{name}")
        sys.modules.pop(loaded[-1], None)
        return importlib.import_module(loaded[-1])

    yield load
    for name in loaded:
        sys.modules.pop(name, None)


@pytest.fixture(scope="session")
def parkour():
    config = tk.MapConfig(rows=2, cols=7, patch_size=(8.0, 6.0), border=1.0, preset="parkour")
    return tk.generate(config)


@pytest.fixture(scope="session")
def parkour_path(parkour, tmp_path_factory):
    return parkour.save(tmp_path_factory.mktemp("parkour") / "map.npz")
