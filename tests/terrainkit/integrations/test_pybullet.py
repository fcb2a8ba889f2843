from dataclasses import replace
from unittest.mock import ANY, MagicMock, call

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.errors import ExportError


def test_pybullet_has_a_static_mesh(load_adapter, solid_map):
    pybullet = MagicMock()
    triangles = []

    def read(*_, fileName, **_options):  # noqa: N803
        triangles.append(len(trimesh.load_mesh(fileName).faces))
        return 5

    pybullet.createCollisionShape.side_effect = read
    pybullet.createMultiBody.return_value = 7
    adapter = load_adapter("pybullet", {"pybullet": pybullet})
    config = tk.MapConfig(
        rows=1,
        cols=1,
        terrains=(tk.SubTerrain(terrain="flat"),),
        static_friction=0.8,
        restitution=0.1,
    )
    flat = tk.generate(config)
    assert adapter.add_map(flat, client=3) == 7
    assert triangles == [len(flat.mesh().triangles)]
    flags = pybullet.GEOM_FORCE_CONCAVE_TRIMESH
    assert pybullet.method_calls == [
        call.createCollisionShape(pybullet.GEOM_MESH, fileName=ANY, flags=flags, physicsClientId=3),
        call.createMultiBody(0, 5, physicsClientId=3),
        call.changeDynamics(7, -1, lateralFriction=0.8, restitution=0.1, physicsClientId=3),
    ]
    with pytest.raises(ExportError, match="several friction coefficients"):
        adapter.add_map(solid_map)
    solids = replace(solid_map.solids, friction=np.full(4, np.nan, np.float32))
    with pytest.raises(ExportError, match="only collide or are only visible"):
        adapter.add_map(replace(solid_map, solids=solids))
