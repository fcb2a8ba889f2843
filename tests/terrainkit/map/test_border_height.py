import mujoco
import numpy as np
import pytest

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate
from terrainkit.errors import ConfigError
from terrainkit.map.patch_edges import PatchEdges
from terrainkit.map.validate import validate
from tests.rays import cast_rays
from tests.tables import read_table
from tests.terrainkit.maps import contents

# The patch extends from (0, 0) to (8, 6), the border from (-1, -1) to (9, 7).
OFFSETS = np.array([-0.99, -0.31, -0.29, -0.01, 0.01, 0.5])
LINE = np.column_stack([OFFSETS, np.full(6, 3.0)])
LINES = np.concatenate([LINE, [8.0, 0.0] - LINE * [1, -1], LINE[:, ::-1] + [1.0, 0.0]])
"""Points across the lower and the upper edge along x, and across the lower edge along y."""


def bordered(terrain="flat", **values):
    config = {"rows": 1, "cols": 1, "patch_size": (8.0, 6.0), "border": 1.0} | values
    return generate(MapConfig(terrains=(SubTerrain(terrain=terrain),), **config))


@pytest.mark.parametrize(("values", "expected"), read_table(__file__, "border_has_its_height"))
def test_border_has_its_height_up_to_exact_edges(tmp_path, values, expected):
    terrain_map = bordered(**values)
    xy = LINES + terrain_map.grid.lower + [1.0, 1.0]
    above = np.column_stack([xy, np.full(18, 9.0)])
    assert terrain_map.height(xy).tolist() == expected * 3
    assert validate(terrain_map) == []
    mesh = terrain_map.mesh()
    assert {*mesh.vertices[:, 2].tolist()} == {*expected}
    loaded = TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    again = generate(MapConfig.from_toml(loaded.config.to_toml()))
    assert contents(again) == contents(loaded) == contents(terrain_map)
    # The walls of a heightfield are slopes over one cell.
    for collision, index in (("boxes", range(6)), ("hfield", (0, 5))):
        path = terrain_map.save(tmp_path / f"{collision}.xml", collision=collision)
        z, _ = cast_rays(mujoco.MjModel.from_xml_path(str(path)), above)
        for found in z.reshape(3, 6):
            assert found[[*index]] == pytest.approx([expected[k] for k in index], abs=1e-4)


def test_border_with_a_height_is_no_cliff():
    size = {"patch_size": (8.0, 8.0), "mode": "selected"}
    with pytest.warns(UserWarning, match="1.61 m between stairs .* and the border"):
        rim = bordered("stairs", **size, border_height=2.0, border_rim=0.1)
    wall = bordered("stairs", **size, border_height=2.0)
    edges = [PatchEdges(terrain_map=each) for each in (rim, wall)]
    assert [len(each.cliffs()) for each in edges] == [2, 0]
    assert [each.max().height for each in edges] == pytest.approx([1.61, 2.0])


@pytest.mark.parametrize(("values", "problem"), read_table(__file__, "border_height_rejects"))
def test_border_height_rejects_invalid_values(values, problem):
    with pytest.raises(ConfigError, match=problem):
        bordered(**values)
