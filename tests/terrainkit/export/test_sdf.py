from xml.etree import ElementTree as ET

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.errors import ExportError
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders, make_hulls


@pytest.fixture(scope="module")
def solid_map():
    rough = tk.SubTerrain(terrain="rough")
    flat = tk.generate(tk.MapConfig(rows=1, cols=1, border=0.0, terrains=(rough,), centered=True))
    tetrahedron = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [0, 0, 2]], dtype=float)
    parts = [
        make_boxes([[1, 2, 3]], [[0.2, 0.4, 0.6]], rpy=[0, 0, np.pi / 4], friction=0.3),
        make_cylinders([[-1, -2, 1]], 0.1, 0.8),
        make_hulls([tetrahedron, np.add(tetrahedron, [2, 0, 0])], friction=[0.5, np.nan]),
    ]
    return flat.edited(solids=Solids.concatenate(parts))


@pytest.fixture(scope="module")
def link(solid_map, tmp_path_factory):
    path = solid_map.save(tmp_path_factory.mktemp("sdf") / "map.sdf")
    found = ET.parse(path).getroot().find("model/link")
    found.set("folder", str(path.parent))
    return found


def test_sdf_shapes_have_pose_size_and_friction(link):
    box, cylinder = (link.find(f"collision[@name='solid_{k}_collision']") for k in (0, 1))
    pose = [float(each) for each in box.find("pose").text.split()]
    assert pose == pytest.approx([1, 2, 3, 0, 0, np.pi / 4], abs=1e-5)
    assert box.find("geometry/box/size").text == "0.2 0.4 0.6"
    assert box.find("surface/friction/ode/mu").text == "0.3"
    assert cylinder.find("geometry/cylinder/radius").text == "0.1"
    assert cylinder.find("geometry/cylinder/length").text == "0.8"
    assert cylinder.find("surface/friction/ode/mu").text == "1"


def test_sdf_meshes_are_ground_and_hulls_by_friction(link, solid_map):
    uris = [each.find("geometry/mesh/uri") for each in link.findall("collision")]
    files = [each.text for each in uris if each is not None]
    assert files == ["map.stl", "map_hulls_0.stl", "map_hulls_1.stl"]
    ground, *hulls = (trimesh.load_mesh(f"{link.get('folder')}/{name}") for name in files)
    np.testing.assert_allclose(ground.area, trimesh.Trimesh(*_arrays(solid_map)).area, rtol=1e-5)
    assert [hull.volume for hull in hulls] == pytest.approx([1 / 6, 1 / 6])


def _arrays(terrain_map):
    mesh = terrain_map.ground_mesh()
    return mesh.vertices, mesh.triangles


def test_sdf_pose_angles_are_about_fixed_axes(solid_map, tmp_path):
    box = make_boxes([[0, 0, 2]], [[0.2, 0.4, 0.6]], rpy=[0.3, -0.4, 1.2])
    path = solid_map.edited(solids=box).save(tmp_path / "a.sdf")
    pose = ET.parse(path).getroot().find(".//pose").text.split()
    assert [float(each) for each in pose[3:]] == pytest.approx([0.3, -0.4, 1.2], abs=1e-5)


@pytest.mark.parametrize("suffix", [".sdf", ".usda"])
def test_export_rejects_ground_with_several_frictions(tmp_path, suffix):
    slippery = tk.SubTerrain(terrain="flat", friction=0.2)
    terrain_map = tk.generate(tk.MapConfig(rows=1, cols=1, terrains=(slippery,)))
    with pytest.raises(ExportError, match="ground with several friction"):
        terrain_map.save(tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())
