from pathlib import Path

import numpy as np
import pytest

from terrainkit_robots.description.model import Geometry, MeshFile, Source
from terrainkit_robots.export.urdf_shapes import to_elements

SOURCE = Source(file=Path("robot.xml"), line=1)


def elements(shape, size=(), **options):
    """Return the tag and the attributes of each element of a geometry."""
    geometry = Geometry(source=SOURCE, shape=shape, size=size, **options)
    return [(tag, attributes) for _, tag, attributes in to_elements(geometry)]


def test_sizes_are_whole_lengths():
    assert elements("box", (0.5, 0.25, 2)) == [("box", {"size": "1 0.5 4"})]
    assert elements("sphere", (0.5,)) == [("sphere", {"radius": "0.5"})]
    assert elements("cylinder", (0.5, 2)) == [("cylinder", {"radius": "0.5", "length": "4"})]


def test_capsule_is_a_cylinder_with_a_sphere_at_each_end():
    along_x = np.array([[0.0, 0, 1, 0.1], [0, 1, 0, 0.2], [-1, 0, 0, 0.3], [0, 0, 0, 1]])
    capsule = Geometry(source=SOURCE, shape="capsule", size=(0.5, 2.0), origin=along_x)
    (pose, *body), (top, *cap), (bottom, *other) = to_elements(capsule)
    assert body == ["cylinder", {"radius": "0.5", "length": "4"}]
    assert cap == other == ["sphere", {"radius": "0.5"}]
    assert pose[:3, 3].tolist() == [0.1, 0.2, 0.3]
    assert top[:3, 3] == pytest.approx([2.1, 0.2, 0.3])
    assert bottom[:3, 3] == pytest.approx([-1.9, 0.2, 0.3])


def test_ellipsoid_is_a_sphere_or_its_mesh():
    mesh = MeshFile(source=SOURCE, filename="ball.stl", path=Path("ball.stl"))
    assert elements("ellipsoid", (0.5, 0.5, 0.5), mesh=mesh) == [("sphere", {"radius": "0.5"})]
    assert elements("ellipsoid", (0.5, 0.5, 1), mesh=mesh) == [("mesh", {"filename": "ball.stl"})]
    with pytest.raises(ValueError, match="shape: got ellipsoid; expected one that URDF supports"):
        elements("ellipsoid", (0.5, 0.5, 1))


@pytest.mark.parametrize(
    ("scale", "written"), [((1.0, 1.0, 1.0), {}), ((1.0, 1.0, -1.0), {"scale": "1 1 -1"})]
)
def test_mesh_has_a_scale_unless_it_is_1(scale, written):
    mesh = MeshFile(source=SOURCE, filename="a.stl", path=Path("a.stl"), scale=scale)
    assert elements("mesh", mesh=mesh) == [("mesh", {"filename": "a.stl"} | written)]
