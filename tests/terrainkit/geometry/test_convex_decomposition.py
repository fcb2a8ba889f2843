import numpy as np
import pytest
import trimesh

from terrainkit.errors import TerrainkitError
from terrainkit.geometry.convex_decomposition import convex_decomposition


def test_angle_is_two_boxes():
    polygon = trimesh.path.polygons.Polygon([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)])
    angle = trimesh.creation.extrude_polygon(polygon, 1.0)
    parts = convex_decomposition(angle.vertices, angle.faces, {"threshold": 0.05, "seed": 0})
    volumes = sorted(trimesh.Trimesh(vertices, faces).volume for vertices, faces in parts)
    assert volumes == pytest.approx([2, 3], rel=0.05)


def test_unknown_parameter_is_an_error():
    box = trimesh.creation.box()
    with pytest.raises(TerrainkitError, match="no_such_parameter"):
        convex_decomposition(np.asarray(box.vertices), box.faces, {"no_such_parameter": 1})
