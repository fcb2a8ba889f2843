import sys
from dataclasses import replace
from unittest.mock import MagicMock

import numpy as np
import pytest

from terrainkit.errors import ExportError


@pytest.fixture
def add_map(monkeypatch):
    """The adapter with a stand-in for PyBullet; tests/frameworks runs the real one."""
    monkeypatch.setitem(sys.modules, "pybullet", MagicMock())
    monkeypatch.delitem(sys.modules, "terrainkit.integrations.pybullet", raising=False)
    from terrainkit.integrations.pybullet import add_map

    yield add_map
    del sys.modules["terrainkit.integrations.pybullet"]


def test_add_map_rejects_what_a_body_cannot_represent(add_map, solid_map):
    with pytest.raises(ExportError, match="several friction coefficients"):
        add_map(solid_map)
    solids = replace(solid_map.solids, friction=np.full(4, np.nan, np.float32))
    with pytest.raises(ExportError, match="only collide or are only visible"):
        add_map(replace(solid_map, solids=solids))
