import sys
from dataclasses import replace
from unittest.mock import MagicMock

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError


@pytest.fixture
def genesis(monkeypatch):
    """The adapter with a stand-in for Genesis; tests/frameworks runs the real one."""
    package = MagicMock(np_float=np.float32, tc_float=None, device=None)
    monkeypatch.setitem(sys.modules, "genesis", package)
    monkeypatch.setitem(sys.modules, "torch", MagicMock())  # takes seconds to import
    monkeypatch.delitem(sys.modules, "terrainkit.integrations.genesis", raising=False)
    import terrainkit.integrations.genesis as adapter

    yield adapter
    del sys.modules["terrainkit.integrations.genesis"]


@pytest.fixture(scope="module")
def parkour():
    config = tk.MapConfig(rows=1, cols=7, patch_size=(8.0, 6.0), border=1.0, preset="parkour")
    return tk.generate(config)


def test_bounds_are_under_ground_and_contain_it(genesis, parkour):
    cell = parkour.config.cell
    bounds, scale = genesis._bounds(parkour.heights, cell)
    inside = np.ceil((np.array(parkour.heights.shape) - 1) * cell / scale).astype(int)
    assert (np.array(bounds.shape) > inside + 1).all()
    assert (bounds[: inside[0] + 1, : inside[1] + 1] < parkour.heights.min()).all()
    assert bounds.max() == parkour.heights.max()
    assert bounds.size < 1000


def test_add_map_adds_ground_mesh_and_solids(genesis, parkour):
    scene = MagicMock()
    terrain = genesis.add_map(scene, parkour)
    np.testing.assert_array_equal(terrain._desc.terrain_hf, parkour.heights)
    used = parkour.solids.collides | parkour.solids.visible
    assert scene.add_entity.call_count == 2 + used.sum()
    genesis.add_map(scene := MagicMock(), parkour, visualization=False)
    assert scene.add_entity.call_count == 1 + used.sum()


def test_add_map_rejects_several_frictions_of_ground(genesis, parkour):
    friction = parkour.friction.copy()
    friction[:10] = 0.3
    with pytest.raises(ExportError, match="friction"):
        genesis.add_map(MagicMock(), replace(parkour, friction=friction))
