import dataclasses
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import trimesh

import terrainkit as tk
from terrainkit.errors import ExportError
from terrainkit.geometry.solids import Solids, make_boxes, make_cylinders, make_hulls
from tests.terrainkit.maps import plot

TETRAHEDRON = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [0, 0, 2]], dtype=float)
HULLS = [TETRAHEDRON, np.add(TETRAHEDRON, [2, 0, 0]), 2 * TETRAHEDRON]


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Return the file of a map with solids of each kind, some of which collide or are visible."""
    parts = [
        make_boxes([[1, 2, 3]], [[0.2, 0.4, 0.6]], rpy=[0.3, -0.4, 1.2], friction=0.3),
        make_boxes([[2, 2, 3]], [[0.2, 0.4, 0.6]], collides=False),
        make_cylinders([[-1, -2, 1]], 0.1, 0.8, visible=False),
        make_hulls(HULLS, friction=[0.5, np.nan, 0.5]),
    ]
    heights = np.zeros((4, 3))
    heights[0, 0] = 0.5
    flat = plot(heights, static_friction=0.8, restitution=0.25)
    path = tmp_path_factory.mktemp("sdf") / "map.sdf"
    return dataclasses.replace(flat, solids=Solids.concatenate(parts)).save(path)


def described(element):
    """Return name, geometry, pose, friction and restitution of a collision or a visual."""
    (shape,) = element.find("geometry")
    pose = [float(number) for number in element.findtext("pose", "").split()]
    surface = [
        element.findtext(f"surface/{path}") for path in ("friction/ode/mu", "friction/ode/mu2")
    ]
    bounce = element.findtext("surface/bounce/restitution_coefficient")
    texts = [shape.tag, *(f"{each.tag} {each.text}" for each in shape)]
    return element.get("name"), texts, pose, [*surface, bounce]


def test_sdf_is_a_static_link_of_ground_shapes_and_hulls(saved):
    root = ET.parse(saved).getroot()
    (model,) = root
    assert (root.attrib, model.attrib) == ({"version": "1.9"}, {"name": "terrain"})
    assert model.findtext("static") == "true"
    link = model.find("link")
    turned = pytest.approx([1, 2, 3, 0.3, -0.4, 1.2], abs=1e-5)  # about fixed axes
    size, map_friction = "size 0.2 0.4 0.6", ["0.8", "0.8", "0.25"]
    post = ["cylinder", "radius 0.1", "length 0.8"]
    assert [described(each) for each in link.findall("collision")] == [
        ("ground_collision", ["mesh", "uri map.stl"], [], map_friction),
        ("solid_0_collision", ["box", size], turned, ["0.3", "0.3", "0.25"]),
        ("solid_2_collision", post, [-1, -2, 1, 0, 0, 0], map_friction),
        ("hulls_0_collision", ["mesh", "uri map_hulls_0.stl"], [], ["0.5", "0.5", "0.25"]),
        ("hulls_1_collision", ["mesh", "uri map_hulls_1.stl"], [], map_friction),
    ]
    none = [None] * 3
    assert [described(each) for each in link.findall("visual")] == [
        ("ground_visual", ["mesh", "uri map.stl"], [], none),
        ("solid_0_visual", ["box", size], turned, none),
        ("solid_1_visual", ["box", size], [2, 2, 3, 0, 0, 0], none),
        ("hulls_0_visual", ["mesh", "uri map_hulls_0.stl"], [], none),
        ("hulls_1_visual", ["mesh", "uri map_hulls_1.stl"], [], none),
    ]


def test_sdf_meshes_are_ground_and_hulls_by_friction(saved):
    names = ("map.stl", "map_hulls_0.stl", "map_hulls_1.stl")
    ground, *hulls = (trimesh.load_mesh(saved.with_name(name)) for name in names)
    # The raised cell of 0.1 m has two walls.
    assert ground.area == pytest.approx(0.4 * 0.3 + 2 * 0.1 * 0.5)
    assert [hull.volume for hull in hulls] == pytest.approx([9 / 6, 1 / 6])


@pytest.mark.parametrize("suffix", [".sdf", ".usda"])
def test_export_rejects_ground_with_several_frictions(tmp_path, suffix):
    slippery = tk.SubTerrain(terrain="flat", friction=0.2)
    terrain_map = tk.generate(tk.MapConfig(rows=1, cols=1, terrains=(slippery,)))
    with pytest.raises(ExportError, match="ground with several friction"):
        terrain_map.save(tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())
