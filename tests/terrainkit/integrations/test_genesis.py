from dataclasses import replace

import numpy as np
import pytest

from terrainkit.errors import ExportError
from tests.terrainkit.integrations.stand_ins import Cfg


@pytest.fixture
def genesis(load_adapter):
    def shape(kind):
        return lambda **fields: Cfg(kind=kind, **fields)

    morphs = Cfg(**{kind: shape(kind) for kind in ("Terrain", "Mesh", "Box", "Cylinder")})
    modules = {
        "genesis": Cfg(
            np_float=np.float32,
            tc_float=None,
            device=None,
            morphs=morphs,
            materials=Cfg(Rigid=Cfg),
        ),
        "torch": Cfg(as_tensor=lambda heights, **_: heights),  # torch takes seconds to import
    }
    return load_adapter("genesis", modules)


def test_genesis_ground_has_bounds_around_its_heights(genesis):
    heights = np.full((5, 33), 0.5, np.float32)
    heights[2, 3], heights[4, 1] = 0.25, 2.0
    # 0.4 m x 3.2 m in cells of 3.2 m / 16, with three more nodes on each axis.
    expected = np.full((2 + 3, 16 + 3), 0.249)
    expected[-1, -1] = 2.0
    bounds, scale = genesis._bounds(heights, 0.1)
    np.testing.assert_allclose(bounds, expected)
    assert scale == pytest.approx(0.2)


class Scene:
    def __init__(self):
        self.entities = []

    def add_entity(self, morph, material):
        self.entities.append((morph, material))
        return Cfg(_desc=Cfg(), _morph=Cfg())


@pytest.mark.parametrize("visualization", [True, False])
def test_genesis_has_ground_mesh_and_solids(genesis, solid_map, visualization):
    scene = Scene()
    terrain = genesis.add_map(scene, solid_map, visualization=visualization)
    np.testing.assert_array_equal(terrain._desc.terrain_hf, solid_map.heights)
    np.testing.assert_array_equal(terrain._terrain_height_field, solid_map.heights)
    assert terrain._desc.terrain_scale.tolist() == pytest.approx([0.1, 1.0])
    assert terrain._morph.horizontal_scale == 0.1
    meshes = ["Mesh"] if visualization else []
    kinds = ["Terrain", *meshes, "Box", "Box", "Cylinder", "Mesh"]
    assert [morph.kind for morph, _ in scene.entities] == kinds
    ground, *solids = [morph for morph, _ in scene.entities]
    assert ground.pos == pytest.approx((-0.45, -0.45, 0.0))
    assert (ground.visualization, ground.vertical_scale) == (False, 1.0)
    solids = solids[len(meshes) :]
    flags = [(each.collision, each.visualization, each.fixed) for each in solids]
    assert flags == [(True, True, True), (False, True, True), (True, False, True), (True,) * 3]
    frictions = [
        material.friction for _, material in scene.entities if "friction" in vars(material)
    ]
    assert frictions == pytest.approx([1.0, 0.3, 1.0, 1.0, 1.0])
    box, cylinder = solids[0], solids[2]
    np.testing.assert_allclose([box.pos, box.size], [(1, 6, 0.5), (0.5, 2, 0.2)], rtol=1e-6)
    turned = np.cos(0.15), 0, 0, np.sin(0.15)
    np.testing.assert_allclose([box.quat, cylinder.quat], [turned, (1, 0, 0, 0)], atol=1e-6)
    assert [*cylinder.pos, cylinder.radius, cylinder.height] == pytest.approx([2, 6, 0.3, 0.2, 0.8])
    none = np.zeros(4, bool)
    unused = replace(solid_map, solids=replace(solid_map.solids, collides=none, visible=none))
    genesis.add_map(scene := Scene(), unused, visualization=visualization)
    assert len(scene.entities) == 1 + visualization


def test_genesis_rejects_several_frictions_of_ground(genesis, parkour):
    friction = parkour.friction.copy()
    friction[:10] = 0.3
    with pytest.raises(ExportError, match="friction"):
        genesis.add_map(Scene(), replace(parkour, friction=friction))
