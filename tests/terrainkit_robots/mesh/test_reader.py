import contextlib
import struct

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit_robots.mesh.reader import read_mesh
from terrainkit_robots.mesh.sniff import header_of
from terrainkit_robots.mesh.surface import MeshError

BOX = trimesh.creation.box(
    [1, 2, 3], transform=trimesh.transformations.rotation_matrix(1, [1, 2, 3])
)
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")


def exported(kind):
    data = BOX.export(file_type=kind)
    return data.encode() if isinstance(data, str) else data


def msh(points, faces=(), normals=0, textures=0):
    counts = struct.pack("<4i", len(points), normals, textures, len(faces))
    rest = bytes(12 * normals + 8 * textures)
    return counts + np.asarray(points, "<f4").tobytes() + rest + np.asarray(faces, "<i4").tobytes()


def triangles(kind, data):
    surface = read_mesh(kind, data)
    return surface.points[surface.faces]


SUFFIXES = {"ascii-stl": ".stl"}
SAMPLES = {
    "stl": exported("stl"),
    "ascii-stl": exported("stl_ascii"),
    "obj": exported("obj"),
    "ply": exported("ply"),
    "glb": exported("glb"),
    "msh": msh(BOX.vertices, BOX.faces, 3, 5),
    "dae": b"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
      <library_geometries><geometry id="g"><mesh><source id="p">
      <float_array>0 0 0 1 0 0 0 1 0</float_array><technique_common><accessor stride="3"/>
      </technique_common></source>
      <vertices id="v"><input semantic="POSITION" source="#p"/></vertices><polylist>
      <input semantic="VERTEX" source="#v" offset="0"/><vcount>3</vcount><p>0 1 2</p></polylist>
      </mesh></geometry></library_geometries><library_visual_scenes><visual_scene><node>
      <scale>1 2 3</scale><instance_geometry url="#g"/></node></visual_scene>
      </library_visual_scenes></COLLADA>""",
}


@pytest.mark.parametrize("kind", [kind for kind in SAMPLES if kind != "dae"])
def test_box_in_every_format(kind):
    assert np.allclose(triangles(kind, SAMPLES[kind]), BOX.triangles, atol=1e-6)


def test_points_without_faces_become_hull():
    surface = read_mesh("msh", msh(TETRAHEDRON))
    assert len(surface.faces) == 4
    with pytest.raises(MeshError, match="is flat"):
        read_mesh("msh", msh(TETRAHEDRON[:3]))


POINTS = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("text", "faces"),
    [
        pytest.param(b"f 1/9/9 2//9 3/9\n", [[0, 1, 2]], id="textures and normals"),
        pytest.param(b"f -4 -3 -2\n", [[0, 1, 2]], id="negative indices"),
        pytest.param(
            b"f 1 2 3 4\nf 1 2\nf 4 3 2\n", [[0, 1, 2], [0, 2, 3], [3, 2, 1]], id="polygons"
        ),
        pytest.param(b"f 1 2 \\\r\n 3\r\n", [[0, 1, 2]], id="continued lines of Windows"),
    ],
)
def test_faces_of_obj(text, faces):
    assert read_mesh("obj", POINTS + text).faces.tolist() == faces


def test_weights_and_colors_of_obj_are_ignored():
    data = b"v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 2 0 1 0 0\nvn 1 2 3\nvt 1 1\nf 1 2 3\n"
    assert read_mesh("obj", data).points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 2, 0]]


@pytest.mark.parametrize(
    ("kind", "data", "problem"),
    [
        pytest.param("obj", POINTS, "no triangles", id="no faces"),
        pytest.param("obj", b"f 1 2 3\n", "no vertices", id="no points"),
        pytest.param("obj", POINTS + b"f 1 2 5\n", "vertex index 4; expected 0 to 3", id="beyond"),
        pytest.param("obj", POINTS + b"f 1 2 -5\n", "vertex index -1", id="before"),
        pytest.param("obj", POINTS + b"f 0 1 2\n", "vertex index -1", id="counted from 0"),
        pytest.param("obj", POINTS + b"f 1 2 1e300\n", "index", id="far beyond"),
        pytest.param("obj", POINTS + b"f one two three\n", "text instead of numbers", id="words"),
        pytest.param("obj", b"v 0 0\nv 1 1\nf 1 2 1\n", "three numbers", id="two numbers"),
        pytest.param("obj", b"v 0 0 0\nv 1 1\nf 1 2 1\n", "three numbers", id="two of three"),
        pytest.param("obj", b"v nan 0 0\nv 1e999 1 1\nf 1 2 1\n", "2 vertices that are", id="nan"),
        pytest.param("ascii-stl", b"vertex 0 0 0\n" * 2, "three per face", id="two corners"),
        pytest.param("ascii-stl", b"vertex 0 0 x\n" * 3, "text instead of numbers", id="a word"),
        pytest.param("ascii-stl", b"facet\n", "no triangles", id="none"),
        pytest.param("stl", bytes(84), "no triangles", id="no faces of an STL"),
        pytest.param("stl", bytes(84) + b"\xff" * 50, "3 vertices that are not finite", id="NaN"),
        pytest.param("msh", msh(np.inf + TETRAHEDRON), "vertices that are not", id="infinite MSH"),
        pytest.param("msh", msh(TETRAHEDRON, [[0, 1, 4]]), "vertex index 4", id="beyond MSH"),
        pytest.param("other", b"", "unsupported format", id="another format"),
        pytest.param("ply", b"ply\n", "cannot be read", id="an empty PLY"),
        pytest.param(
            "ply",
            b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n"
            b"property float y\nproperty float z\nend_header\n",
            "cannot be read",
            id="a PLY that claims 4 billion corners",
        ),
    ],
)
def test_broken_files(kind, data, problem):
    with pytest.raises(MeshError, match=problem):
        read_mesh(kind, data)


@settings(max_examples=60, deadline=None)
@given(
    kind=st.sampled_from(["stl", "ascii-stl", "obj", "dae", "msh", "ply", "glb"]),
    where=st.floats(0, 1),
    noise=st.binary(max_size=12) | st.sampled_from([b"", b"-1", b"1e999", b"nan", b"99999999999"]),
)
def test_damaged_files_raise_mesh_error(kind, where, noise):
    data = SAMPLES[kind]
    at = int(where * len(data))
    data = data[:at] + noise + data[at + len(noise) :]
    header = header_of(SUFFIXES.get(kind, f".{kind}"), data)
    assert header.state in ("fine", "broken")
    with contextlib.suppress(MeshError), np.errstate(all="ignore"):
        surface = read_mesh(header.format, data)
        assert np.isfinite(surface.points[surface.faces]).all()


def test_external_files_are_not_read(tmp_path, monkeypatch):
    # A GLB may name its data by another file.
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data.bin").write_bytes(TETRAHEDRON.tobytes())
    text = (
        b'{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],'
        b'"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],'
        b'"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],'
        b'"bufferViews":[{"buffer":0,"byteLength":36}],'
        b'"buffers":[{"uri":"data.bin","byteLength":36}]}'
    )
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    with pytest.raises(MeshError):
        read_mesh("glb", b"glTF" + struct.pack("<II", 2, 12 + len(chunk)) + chunk)


def test_unused_points_are_removed():
    """Modelers leave them behind; a1's hip.dae reaches 2 cm farther with them."""
    points = [[9, 9, 9], *TETRAHEDRON[:2], [np.nan, 0, 0], *TETRAHEDRON[2:]]
    surface = read_mesh("msh", msh(points, [[1, 2, 4], [1, 4, 5], [1, 5, 2], [2, 5, 4]]))
    np.testing.assert_array_equal(surface.points, TETRAHEDRON)
    assert surface.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
