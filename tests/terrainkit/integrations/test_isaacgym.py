import sys
from dataclasses import replace
from types import ModuleType, SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

import terrainkit as tk
from terrainkit.errors import ExportError


@pytest.fixture
def isaacgym(monkeypatch):
    """The adapter with a stand-in for Isaac Gym, which cannot be installed from a package index."""
    package = ModuleType("isaacgym")
    package.gymapi = SimpleNamespace(
        TriangleMeshParams=SimpleNamespace,
        HeightFieldParams=lambda: SimpleNamespace(transform=SimpleNamespace(p=SimpleNamespace())),
    )
    monkeypatch.setitem(sys.modules, "isaacgym", package)
    monkeypatch.delitem(sys.modules, "terrainkit.integrations.isaacgym", raising=False)
    import terrainkit.integrations.isaacgym as adapter

    yield adapter
    del sys.modules["terrainkit.integrations.isaacgym"]


@pytest.fixture(scope="module")
def terrain_map():
    config = tk.MapConfig(rows=2, cols=4, patch_size=(8.0, 6.0), border=1.0, preset="stairs")
    return tk.generate(config)


def test_add_trimesh_passes_flat_buffers(isaacgym, terrain_map):
    gym = MagicMock()
    isaacgym.add_trimesh(gym, 0, terrain_map)
    (_, vertices, triangles, params), _ = gym.add_triangle_mesh.call_args
    assert (vertices.dtype, triangles.dtype) == (np.float32, np.uint32)
    assert len(vertices) == 3 * params.nb_vertices
    assert len(triangles) == 3 * params.nb_triangles
    assert (params.static_friction, params.restitution) == (1.0, 0.0)


def test_add_heightfield_buffer_is_column_major(isaacgym, terrain_map):
    gym = MagicMock()
    isaacgym.add_heightfield(gym, 0, terrain_map)
    (_, buffer, params), _ = gym.add_heightfield.call_args
    # Sample (row, column) is at column * nbRows + row.
    column, row = np.divmod(np.arange(0, len(buffer), 37), params.nbRows)
    x = params.transform.p.x + column * params.column_scale
    y = params.transform.p.y + row * params.row_scale
    found = buffer[::37] * params.vertical_scale
    assert found == pytest.approx(terrain_map.height(np.column_stack([x, y])), abs=0.0026)


def test_add_trimesh_rejects_solids_that_are_only_visible(isaacgym, solid_map):
    solids = replace(solid_map.solids, friction=np.full(4, np.nan, np.float32))
    with pytest.raises(ExportError, match="2 solids that only collide or are only visible"):
        isaacgym.add_trimesh(MagicMock(), 0, replace(solid_map, solids=solids))


def test_add_heightfield_rejects_solids(isaacgym, solid_map):
    solids = replace(solid_map.solids, friction=np.full(4, np.nan, np.float32))
    with pytest.raises(ExportError, match="4 solids, which a heightfield cannot represent"):
        isaacgym.add_heightfield(MagicMock(), 0, replace(solid_map, solids=solids))
