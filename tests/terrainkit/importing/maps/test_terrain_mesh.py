import numpy as np
import pytest
import trimesh

from terrainkit.errors import ConfigError, HeightFileError
from terrainkit.importing import ImportOptions, import_terrain_mesh
from terrainkit.map.validate import validate

SIZE = (4.0, 3.0)
ORIGINS = np.array([[(-2, -1.5, 0), (-2, 1.5, 0)], [(2, -1.5, 0.4), (2, 1.5, 0)]], float)


def slab(lower, upper):
    """Return a box between two corners."""
    box = trimesh.creation.box(extents=np.subtract(upper, lower))
    return box.apply_translation(np.add(lower, upper) / 2)


GROUND = slab((-5, -4, -1), (5, 4, 0))
BLOCK, BEAM = slab((0, -3, 0), (4, 0, 0.4)), slab((-3.5, 1, 1.5), (-3, 2, 1.7))
MESH = trimesh.util.concatenate([GROUND, BLOCK, BEAM])
"""2 x 2 patches of 4 m x 3 m with a border of 1 m, centered at the origin.

Patch (1, 0) is a block 0.4 m high. A beam hangs over patch (0, 1), 1.5 m above the ground."""


def load(mesh=MESH, origins=ORIGINS, **options):
    return import_terrain_mesh(mesh.vertices, mesh.faces, origins, SIZE, border=1.0, **options)


def test_map_has_heights_origins_names_and_overhangs():
    imported = load(terrain_names=("a", "b"))
    found = imported.terrain_map
    assert (found.grid.lower, found.grid.upper) == ((-5.0, -4.0), (5.0, 4.0))
    np.testing.assert_allclose(found.env_origins, ORIGINS, atol=1e-6)
    assert found.patch_names.tolist() == [["a", "b"], ["a", "b"]]
    assert load().terrain_map.patch_names.tolist() == [["imported"] * 2] * 2
    # The wall is where it is in the mesh.
    xy = [[2.0, -1.5], [2.0, 1.5], [-4.5, 0.0], [0.01, -1.0], [-0.01, -1.0]]
    assert found.height(xy).tolist() == pytest.approx([0.4, 0, 0, 0.4, 0])
    assert found.solids.patch.tolist() == [[0, 1]]
    assert found.scan([-3.25, 1.5, 5.0]) == pytest.approx(1.7, abs=1e-3)
    assert found.clearance([-3.25, 1.5]) == pytest.approx(1.5, abs=1e-3)
    assert imported.report.lost_area == 0
    assert validate(found) == []


def test_occupied_origin_is_replaced_by_nearest_disk():
    origins = ORIGINS.copy()
    origins[1, 0] = (0.1, -1.5, 0.4)  # at the edge of the block
    x, y, z = load(origins=origins).terrain_map.env_origins[1, 0]
    assert z == pytest.approx(0.4)
    assert x >= 0.3
    assert np.hypot(x - 0.1, y + 1.5) < 0.6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"origins": np.zeros((2, 3))}, r"origins: got shape \(2, 3\); expected \(rows, cols, 3\)"),
        ({"origins": np.zeros((1, 1, 3)), "patch_size": (0.0, 3.0)}, "patch_size"),
        ({"terrain_names": ("a", "b", "c")}, "terrain_names: got 3; expected 1 or 2"),
        ({"faces": np.zeros((0, 3))}, "mesh: got vertices of shape"),
        ({"origins": np.full((2, 2, 3), 9.0)}, r"origin of patch \(0, 0\): got \(9, 9\)"),
        (
            {"origins": np.add(ORIGINS, [-2.01, 0, 0])},
            r"patch \(0, 0\): .* from \(-4, -3\) to \(0, 0\)",
        ),
        (
            {"origins": np.add(ORIGINS, [0, 1.51, 0])},
            r"origin of patch \(0, 0\): got \(-2, 0\.01\)",
        ),
    ],
)
def test_invalid_arguments_are_rejected(change, message):
    values = {"vertices": MESH.vertices, "faces": MESH.faces, "origins": ORIGINS}
    with pytest.raises(ConfigError, match=message):
        import_terrain_mesh(**{"patch_size": SIZE} | values | change)


def test_hole_is_filled_unless_rejected():
    hole = GROUND.copy()
    hole.update_faces(np.arange(len(hole.faces)) != np.argmax(hole.triangles_center[:, 2]))
    imported = load(hole, options=ImportOptions(missing="lowest", spawn_radius=0.3))
    assert imported.report.num_missing == 0  # the other side of the slab is the ground there
    surface = trimesh.Trimesh([[-5, -4, 0], [5, -4, 0], [-5, 4, 0]], [[0, 1, 2]], process=False)
    with pytest.raises(HeightFileError, match=r"the mesh: \d+ of 8000 heights are missing"):
        load(surface, options=ImportOptions(missing="reject"))
    assert load(surface).report.num_missing > 3000
