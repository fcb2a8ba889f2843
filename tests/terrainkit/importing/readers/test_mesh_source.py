import json
import struct
from contextlib import nullcontext

import numpy as np
import pytest
import trimesh

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.readers import height_source, mesh_source
from terrainkit.importing.readers.import_options import ReadOptions
from terrainkit.importing.readers.mesh_source import read
from tests.meshes import box
from tests.tables import read_table


def wedge():
    """Return a mesh of 4 m x 2 m whose height is x / 4 + 3 m on its left half, y < 1 m."""
    mesh = box((4, 2, 3), (2, 1, 1.5))
    mesh.vertices[:, 2] += np.where(mesh.vertices[:, 2] > 1, mesh.vertices[:, 0] / 4, 0)
    return trimesh.util.concatenate([mesh, box((1, 1, 3.9), (0.5, 1.5, 1.95))])


def split_gltf(folder, *uris):
    """Write a .gltf whose buffers have the URIs, and a file "a b.bin" with their data."""
    files = box((4, 5, 6), (0, 0, 0)).export(file_type="gltf")
    tree = json.loads(files.pop("model.gltf"))
    data = b"".join(files[each["uri"]] for each in tree["buffers"])
    start = 0
    for view in tree["bufferViews"]:
        view.update(buffer=0, byteOffset=start)
        start += -(-view["byteLength"] // 4) * 4
    (folder / "a b.bin").write_bytes(data)
    tree["buffers"] = [{"uri": uri, "byteLength": len(data)} for uri in uris]
    (folder / "model.gltf").write_text(json.dumps(tree))
    return folder / "model.gltf"


@pytest.mark.parametrize("uri", ["a%20b.bin", "a b.bin"])
def test_gltf_may_have_its_data_beside_it(tmp_path, uri):
    source = read(split_gltf(tmp_path, uri), ReadOptions())
    np.testing.assert_allclose(np.ptp(source.vertices, axis=0), [4, 6, 5])


@pytest.mark.parametrize(
    "uri",
    [
        *("../a b.bin", "..%2Fa b.bin", "x/a b.bin", "/a b.bin", "..%5ca b.bin", "..", "."),
        *("file:a b.bin", "http://a/a b.bin", "c:a b.bin", "a b.bin%00", ""),
    ],
)
def test_mesh_file_opens_no_files_elsewhere(tmp_path, uri):
    (tmp_path / "x").mkdir()
    path = split_gltf(tmp_path, uri).rename(tmp_path / "x/model.gltf")
    (tmp_path / "x/a b.bin").write_bytes((tmp_path / "a b.bin").read_bytes())
    with pytest.raises(HeightFileError, match=r"in another file, '.*', which is not opened"):
        read(path, ReadOptions())


def test_gltf_data_beside_it_are_limited(tmp_path, monkeypatch):
    with pytest.raises(HeightFileError, match=r"model\.gltf: .*no file .*c\.bin"):
        read(split_gltf(tmp_path, "c.bin"), ReadOptions())
    (tmp_path / "c.bin").mkdir()
    with pytest.raises(HeightFileError, match=r"model\.gltf: .*c\.bin: got a special file"):
        read(split_gltf(tmp_path, "c.bin"), ReadOptions())
    path = split_gltf(tmp_path, "a b.bin")
    size = (tmp_path / "a b.bin").stat().st_size
    monkeypatch.setattr(height_source, "MAX_FILE_BYTES", size - 1)
    with pytest.raises(HeightFileError, match=rf"a b\.bin: got {size} bytes"):
        mesh_source._embed_buffers(path, path.read_bytes())


@pytest.mark.parametrize(
    ("old", "new", "scale", "axis"),
    [
        (b"", b"", 1.0, 1),
        (b"<up_axis>Y_UP", b"<up_axis>Z_UP", 1.0, 2),
        (b"<up_axis>", b'<unit name="cm" meter="0.01"/><up_axis>', 0.01, 1),
    ],
)
def test_dae_states_its_unit_and_axis(tmp_path, old, new, scale, axis):
    data = box((4, 5, 6), (0, 0, 0)).export(file_type="dae")
    assert old in data
    (tmp_path / "a.dae").write_bytes(data.replace(old, new))
    source = read(tmp_path / "a.dae", ReadOptions())
    expected = np.array([4, 6 if axis == 1 else 5, 5 if axis == 1 else 6]) * scale
    np.testing.assert_allclose(np.ptp(source.vertices, axis=0), expected)
    (tmp_path / "a.dae").write_bytes(b"<!DOCTYPE a>" + data)
    with pytest.raises(HeightFileError, match="got a document type declaration"):
        read(tmp_path / "a.dae", ReadOptions())


@pytest.mark.filterwarnings("ignore:.*lying on its side")  # a wedge is no ground
@pytest.mark.parametrize(("suffix", "options"), read_table(__file__, "mesh_file_heights_and_axes"))
def test_mesh_file_heights_and_axes(tmp_path, suffix, options):
    mesh = wedge()
    # glTF has y up, and so has COLLADA, unless the file states another axis.
    if options.get("up", "y" if suffix in ("glb", "dae") else "z") == "y":
        mesh.vertices = mesh.vertices[:, [0, 2, 1]] * [1, 1, -1]  # x stays, z becomes y
    mesh.vertices /= options.get("scale", 1.0)
    mesh.export(tmp_path / f"a.{suffix}")
    source = read(tmp_path / f"a.{suffix}", ReadOptions(**options))
    assert source.is_metric == (suffix not in ("obj", "stl") or "scale" in options)
    assert [*source.lower, *source.upper] == pytest.approx([0.0, 0.0, 4.0, 2.0], abs=1e-6)
    found = source.heights(np.arange(-1.5, 6, 1.0), np.array([0.5, 1.5]))
    # Before 0 and after 4, the heights half a step inside. The post is at x < 1 m, y > 1 m.
    slope = np.array([3.125, 3.125, 3.125, 3.375, 3.625, 3.875, 3.875, 3.875])
    expected = np.stack([slope, np.where(np.arange(8) < 3, 3.9, slope)], axis=1)
    np.testing.assert_allclose(found, expected, atol=1e-3)


def test_mesh_file_scene_is_one_mesh(tmp_path):
    scene = trimesh.Scene()
    cube = trimesh.creation.box((1, 1, 1))
    for x in (0.5, 2.5):
        scene.add_geometry(cube, transform=trimesh.transformations.translation_matrix((x, 0, x)))
    scene.export(tmp_path / "a.glb")
    source = read(tmp_path / "a.glb", ReadOptions(up="z"))
    found = source.heights(np.array([0.5, 1.5, 2.5]), np.array([-0.2, 0.2]))
    np.testing.assert_allclose(found, [[1.0, 1.0], [np.nan, np.nan], [3.0, 3.0]])


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "glb"])
@pytest.mark.parametrize("length", [0, 20, 400])
def test_mesh_file_truncated_is_rejected(tmp_path, suffix, length):
    path = tmp_path / f"a.{suffix}"
    trimesh.creation.icosphere(3).export(path)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(HeightFileError, match=str(path)) as caught:
        read(path, ReadOptions())
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("real_child")
def test_mesh_file_claiming_large_arrays_is_rejected(tmp_path):
    path = tmp_path / "a.ply"
    trimesh.creation.box().export(path)
    path.write_bytes(path.read_bytes().replace(b"element vertex 8", b"element vertex 900000000000"))
    with pytest.raises(HeightFileError, match=str(path)):
        read(path, ReadOptions())
    # Without a buffer view, an accessor of glTF is an array of zeros of any size.
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "count": 3 * 10**10, "type": "VEC3"}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    path = tmp_path / "a.glb"
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunk)) + chunk)
    with pytest.raises(HeightFileError, match=str(path)):
        read(path, ReadOptions())


TRIANGLE = [[0, 0, 0], [1, 0, 2], [0, 3, 0]]


@pytest.fixture
def decoded(monkeypatch, tmp_path):
    """Return a function that reads arrays as if they were in a file."""

    def run(vertices, faces, **options):
        arrays = {"vertices": vertices, "faces": faces}
        monkeypatch.setattr(mesh_source, "decode", lambda *_: arrays)
        return read(tmp_path / "a.ply", ReadOptions(**options))

    return run


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (TRIANGLE, [[0, 1, 3]], "a face with a vertex that does not exist"),
        (TRIANGLE, [[0, 1, -1]], "a face with a vertex that does not exist"),
        (TRIANGLE, np.empty((0, 3)), "a file without triangles"),
        ([*TRIANGLE[:2], [0, np.nan, 0]], [[0, 1, 2]], "vertices that are not finite"),
        ([*TRIANGLE[:2], [0, 1e300, 0]], [[0, 1, 2]], "vertices that are not finite"),
    ],
)
def test_invalid_arrays_of_a_mesh_are_rejected(decoded, vertices, faces, message):
    with pytest.raises(HeightFileError, match=f"got {message}"):
        decoded(vertices, faces)


def test_unused_vertices_are_dropped_and_the_rest_scaled_and_turned(decoded):
    mesh = decoded([[9, 9, np.inf], *TRIANGLE], [[1, 2, 3]], scale=0.5, up="y")
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert mesh.vertices.tolist() == [[0, 0, 0], [0.5, -1, 0], [0, 0, 1.5]]


def test_bodies_that_touch_up_to_rounding_have_no_gap(decoded):
    blocks = [box((1, 1, 1), (0.5, 0.5, 0.5)), box((1, 1, 1), (1.5 + 1e-9, 0.5, 0.5))]
    mesh = trimesh.util.concatenate([*blocks, box((2, 1, 0.1), (1, 0.5, -0.05))])
    source = decoded(mesh.vertices, mesh.faces)
    found = source.heights(np.array([0.5, 1.0, 1.5]) + 5e-10, np.array([0.25, 0.75]))
    np.testing.assert_allclose(found, 1.0)


@pytest.mark.parametrize(
    ("size", "is_warned"),
    [((10, 1, 10), True), ((10, 5.1, 10), False), ((10, 4, 8), False), ((10, 1, 2), False)],
)
@pytest.mark.parametrize(("suffix", "other"), [("stl", "y"), ("glb", "z")])
def test_mesh_that_lies_on_its_side_is_warned_of(tmp_path, size, is_warned, suffix, other):
    size = size if suffix == "stl" else [size[0], size[2], size[1]]
    box(size, (0, 0, 0)).export(tmp_path / f"a.{suffix}")
    message = rf"10 m high and 1 m wide.*`up='{other}'`$"
    with pytest.warns(TerrainkitWarning, match=message) if is_warned else nullcontext():
        read(tmp_path / f"a.{suffix}", ReadOptions())


@pytest.mark.parametrize(("height", "is_warned"), [(6.6, True), (6.4, False)])
def test_obj_with_more_area_to_one_side_is_warned_of(tmp_path, height, is_warned):
    # The side of 9 x 6.6 faces y; the top has an area of 9 x 5, and 1.3 times this is 9 x 6.5.
    box((9, 5, height), (0, 0, 0)).export(tmp_path / "a.obj")
    message = "lying on its side.*`up='y'`$"
    with pytest.warns(TerrainkitWarning, match=message) if is_warned else nullcontext():
        read(tmp_path / "a.obj", ReadOptions())
