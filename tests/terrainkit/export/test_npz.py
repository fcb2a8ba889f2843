import dataclasses
import io
import os
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate
from terrainkit.errors import MapFileError
from terrainkit.export.npz import read_mesh
from terrainkit.export.requirements import has_one_friction
from terrainkit.settings.type_hint import MAX_VALUE
from tests.tables import read_table
from tests.terrainkit.maps import contents

NAN = float("nan")


def arrays_of(path):
    with np.load(path, allow_pickle=False) as archive:
        return dict(archive)


@pytest.fixture(scope="module")
def path(terrain_map, tmp_path_factory):
    return terrain_map.save(tmp_path_factory.mktemp("npz") / "map.npz")


@pytest.fixture(scope="module")
def icy_map():
    ice = SubTerrain(terrain="crawl", friction=(0.8, 0.2))
    flat = SubTerrain(terrain="flat")
    return generate(
        MapConfig(rows=2, cols=2, border=1.0, spawns_per_patch=20, terrains=(ice, flat))
    )


def test_npz_has_these_arrays(path, terrain_map):
    mesh = terrain_map.mesh()
    found = {key: [each.dtype.str, *each.shape] for key, each in arrays_of(path).items()}
    texts = {key: found.pop(key) for key in ("terrain_names", "config", "parameters")}
    meshes = {
        "vertices": ["<f4", *mesh.vertices.shape],
        "triangles": ["<i4", *mesh.triangles.shape],
    }
    assert found == read_table(__file__, "arrays") | meshes
    assert {dtype[:2] for dtype, *_ in texts.values()} == {"<U"}
    assert [shape for _, *shape in texts.values()] == [[3], [], []]


def test_npz_config_generates_the_same_bytes(path, tmp_path):
    again = generate(MapConfig.from_toml(str(arrays_of(path)["config"])))
    assert again.save(tmp_path / "again.npz").read_bytes() == path.read_bytes()


@pytest.mark.parametrize("name", ["terrain_map", "solid_map", "icy_map"])
def test_npz_round_trip(request, tmp_path, name):
    """A plain map, solids of each kind, and frictions with patches of 1 and of 20 spawns."""
    terrain_map = request.getfixturevalue(name)
    path = terrain_map.save(tmp_path / "map.npz")
    loaded = TerrainMap.load(str(path))
    assert contents(loaded) == contents(terrain_map)
    assert contents(read_mesh(path)) == contents(terrain_map.mesh())
    assert loaded.save(tmp_path / "again.npz").read_bytes() == path.read_bytes()


def test_npz_without_a_mesh_has_all_other_arrays(path, terrain_map, tmp_path):
    small = terrain_map.save(tmp_path / "small.npz", mesh=False)
    wanted = arrays_of(path)
    del wanted["vertices"], wanted["triangles"]
    found = arrays_of(small)
    assert list(found) == list(wanted)
    assert all(found[key].tobytes() == wanted[key].tobytes() for key in wanted)
    assert read_mesh(small) is None


def test_npz_has_friction_of_each_cell(icy_map, tmp_path):
    path = icy_map.save(tmp_path / "map.npz")
    expected = np.ones((180, 180), np.float32)
    expected[10:90, 10:90], expected[90:170, 10:90] = 0.8, 0.2
    assert arrays_of(path)["ground_friction"].tobytes() == expected.tobytes()
    loaded = TerrainMap.load(path)
    assert loaded.friction.tobytes() == expected.tobytes()
    assert set(loaded.solids.friction.tolist()) == {np.float32(0.8), np.float32(0.2)}
    assert np.isnan(loaded.spawns).any()


def test_has_one_friction_compares_ground_and_solids(terrain_map, solid_map):
    def own_friction(*values):
        solids = dataclasses.replace(solid_map.solids, friction=np.array(values, np.float32))
        return has_one_friction(dataclasses.replace(solid_map, solids=solids))

    assert own_friction(NAN, 1.0, NAN, NAN)
    assert not own_friction(NAN, 0.5, NAN, NAN)
    friction = terrain_map.friction.copy()
    assert has_one_friction(terrain_map)
    friction[-1, -1] = 0.7
    assert not has_one_friction(dataclasses.replace(terrain_map, friction=friction))


@pytest.fixture(scope="module")
def small_map():
    """A map of 2 x 1 patches of 20 x 10 cells, 42 x 12 with its border."""
    pit = SubTerrain(terrain="pit", parameters={"side": 0.6})
    return generate(
        MapConfig(
            rows=2, cols=1, patch_size=(2.0, 1.0), border=0.1, spawn_radius=0.1, terrains=(pit,)
        )
    )


@pytest.fixture(scope="module")
def good(small_map, tmp_path_factory):
    return small_map.save(tmp_path_factory.mktemp("good") / "map.npz")


@pytest.fixture(scope="module")
def bad(tmp_path_factory):
    return tmp_path_factory.mktemp("bad") / "map.npz"


def npy(value):
    data = io.BytesIO()
    np.lib.format.write_array(data, np.asarray(value), allow_pickle=True)
    return data.getvalue()


def npy_header(text):
    data = text.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(data).to_bytes(2, "little") + data


def npy_that_declares(dtype, shape):
    return npy_header(f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}")


def repack(source, target, changes, compression=zipfile.ZIP_STORED):
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", compression) as new:
        members = {name: old.read(name) for name in old.namelist()}
        for key, data in changes.items():
            members[f"{key}.npy"] = data
        for name, data in members.items():
            if data is not None:
                new.writestr(name, data)


def refusal(path, read=TerrainMap.load):
    with pytest.raises(MapFileError) as error:
        read(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_npz_missing_and_special_files_are_rejected(tmp_path):
    os.mkfifo(tmp_path / "pipe.npz")
    assert refusal(tmp_path / "none.npz").startswith("no file ")
    for special in (tmp_path, tmp_path / "pipe.npz"):
        assert "got a special file or folder" in refusal(special)


def test_npz_other_file_is_rejected(bad):
    for data in (b"", b"hello\n", b"PK\x03\x04", b"\x93NUMPY", bytes(5000)):
        bad.write_bytes(data)
        assert "not an .npz file" in refusal(bad)
    np.savez(bad, heights=np.zeros((3, 3)))
    assert "not a terrainkit map; format_version is missing" in refusal(bad)


@given(share=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
@settings(deadline=None, derandomize=True, max_examples=100)
def test_npz_flipped_byte_is_detected_or_harmless(good, bad, small_map, share, flip):
    data = bytearray(good.read_bytes())
    data[int(share * len(data))] ^= flip
    bad.write_bytes(data)
    try:
        read = TerrainMap.load(bad)
    except MapFileError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert contents(read) == contents(small_map)


@pytest.mark.parametrize("compression", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_npz_compressed_map_loads_unless_damaged(good, bad, small_map, compression):
    repack(good, bad, {}, compression)
    assert contents(TerrainMap.load(bad)) == contents(small_map)
    data = bytearray(bad.read_bytes())
    data[80:100] = bytes(20)  # within the first member
    bad.write_bytes(data)
    refusal(bad)


def test_npz_missing_array_is_named(good, bad):
    meshes = ("vertices", "triangles")
    for key in arrays_of(good).keys() - {"format_version"}:
        repack(good, bad, {key: None})
        assert f"has no {key}" in refusal(bad, read_mesh if key in meshes else TerrainMap.load)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("format_version", 2, "got format version 2; expected 1"),
        ("heights", np.zeros((12, 42), "f4"), "heights: got shape (12, 42); expected (42, 12)"),
        ("heights", np.array({"pickled": 1}), "heights: got dtype object"),
        ("difficulty", np.zeros((2, 1), bool), "difficulty: got dtype bool"),
        ("lower", [0.0, 0.0], "lower: got [0.0, 0.0]; expected (-0.1, -0.1)"),
        ("cell", 0.2, "cell: got 0.2; expected 0.1"),
        ("border", 0.0, "border: got 0.0; expected 0.1"),
        ("patch_size", [2.0, 2.0], "patch_size: got [2.0, 2.0]; expected (2.0, 1.0)"),
        ("restitution", 0.5, "restitution: got 0.5; expected 0.0 by its config"),
        ("terrain_types", np.zeros((2, 1)), "terrain_types: got dtype float64"),
        (
            "terrain_types",
            np.array([[0], [-1]], "i4"),
            "got an index out of range; expected 0 to 0",
        ),
        ("terrain_types", np.array([[0], [1]], "i4"), "got an index out of range; expected 0 to 0"),
        ("boxes", np.zeros((2, 10), "f4"), "solid_friction: got shape (0,); expected (2)"),
        ("solid_patch", np.zeros((0, 3), "i4"), "solid_patch: got shape (0, 3); expected (0, 2)"),
        (
            "ground_friction",
            np.ones((2, 2), "f4"),
            "got shape (2, 2); expected (42, 12), or (1, 1)",
        ),
        ("ground_friction", np.full((1, 1), -1e-9, "f4"), "got values out of range; expected 0 to"),
        ("ground_friction", np.full((1, 1), 1.001e6, "f4"), "ground_friction: got values out of"),
        ("spawns", np.zeros((2, 1, 0, 4), "f4"), "spawns: got none; expected one or more"),
        ("spawns", np.full((2, 1, 1, 4), 1.001e6, "f4"), "spawns: got values that are not finite"),
        ("spawns", np.full((2, 1, 1, 4), [1, 2, 3, NAN], "f4"), "spawns: got values that are not"),
        ("spawns", np.full((2, 1, 2, 4), [[NAN], [0]], "f4"), "spawns: got a gap; expected NaN at"),
        ("goals", np.full((2, 1, 2, 4), [[NAN], [0]], "f4"), "goals: got a gap; expected NaN at"),
    ],
)
def test_npz_invalid_array_is_rejected(good, bad, key, value, message):
    repack(good, bad, {key: npy(value)})
    assert message in refusal(bad)


def test_npz_largest_and_smallest_values_are_read(good, bad):
    changes = {
        "ground_friction": np.full((1, 1), MAX_VALUE, "f4"),
        "spawns": np.full((2, 1, 1, 4), -MAX_VALUE, "f4"),
        "goals": np.full((2, 1, 2, 4), [[MAX_VALUE], [NAN]], "f4"),
        "env_origins": np.full((2, 1, 3), 0.25, "f4"),
    }
    repack(good, bad, {key: npy(value) for key, value in changes.items()})
    read = TerrainMap.load(bad)
    assert read.friction.max() == MAX_VALUE
    # The origins, which other programs read, replace those of the first spawns.
    assert read.spawns.tolist() == [[[[0.25, 0.25, 0.25, -MAX_VALUE]]]] * 2
    assert read.goals[:, :, 0].tolist() == [[[MAX_VALUE] * 4]] * 2
    repack(good, bad, {"ground_friction": npy(np.zeros((1, 1), "f4"))})
    assert TerrainMap.load(bad).friction.max() == 0


@pytest.mark.parametrize(("corner", "is_valid"), [(-1, False), (0, True), (-2, True), (-3, False)])
def test_npz_triangles_have_vertices(good, bad, corner, is_valid):
    number = len(arrays_of(good)["vertices"])
    corner = {-2: number - 1, -3: number}.get(corner, corner)
    repack(good, bad, {"triangles": npy(np.array([[0, 1, corner]], np.int32))})
    if is_valid:
        assert read_mesh(bad).triangles.tolist() == [[0, 1, corner]]
    else:
        message = f"triangles: got an index out of range; expected 0 to {number - 1}"
        assert message in refusal(bad, read_mesh)


def test_npz_solids_are_checked(solid_map, bad, tmp_path):
    """The map has 1 x 2 patches."""
    good, solids = solid_map.save(tmp_path / "good.npz"), solid_map.solids
    flat = solids.hull_vertices * np.float32([1, 1, 0])
    repack(good, bad, {"hull_vertices": npy(flat)})
    assert "hull: got points in one plane; expected points with a volume" in refusal(bad)
    for patch in ((1, 1), (0, 2), (0, -1)):
        repack(good, bad, {"solid_patch": npy(np.tile(np.array(patch, "i4"), (4, 1)))})
        assert "solid_patch: got invalid values or sizes" in refusal(bad)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (None, '"a\nb" = 1', "config: not a TOML file"),
        ("rows = 2", "rows = 0", "config: rows: got 0"),
        ('"curriculum"', "[1]", "mode"),
        ('"pit"', "5", "terrain: got 5; expected a string"),
        ("side = 0.6", f"side = {'9' * 400}", "side"),
    ],
    ids=["two lines", "range", "type", "terrain", "digits"],
)
def test_npz_invalid_config_is_rejected(good, bad, old, new, message):
    text = str(arrays_of(good)["config"])
    repack(good, bad, {"config": npy(text.replace(old, new) if old else new)})
    assert message in refusal(bad)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '[[{"requested": {"depth": "deep"}, "realized": {}}], []]',
        '[[{"requested": {"depth": 1, "side": 1}, "realized": {"side": [1, 2, 3]}}], []]',
        "[" * 30_000,
        "1" * 5000,
    ],
    ids=["none", "empty", "text", "triple", "deep", "long"],
)
def test_npz_invalid_parameters_are_rejected(good, bad, text):
    repack(good, bad, {"parameters": npy(text)})
    assert "parameters cannot be read" in refusal(bad)


@pytest.mark.parametrize(
    "text", ["", "{}", '[{"max_error": "far"}]', "[" * 2000, '[{"max_error_at": [1]}]']
)
def test_npz_invalid_import_report_is_rejected(good, bad, text):
    repack(good, bad, {"import_reports": npy(text)})
    assert "import_reports cannot be read" in refusal(bad)


@pytest.mark.parametrize(
    "header",
    ["", "(" * 500, "{'descr': 'x', 'fortran_order': False, 'shape': ()}", "x" * 20_000],
    ids=["none", "deep", "no dtype", "long"],
)
def test_npz_invalid_header_is_rejected(good, bad, header):
    repack(good, bad, {"heights": npy_header(header)})
    assert "heights cannot be read" in refusal(bad)


@pytest.mark.parametrize(("key", "dtype", "shape", "limit"), read_table(__file__, "npz_oversized"))
def test_npz_oversized_array_is_not_read(good, bad, key, dtype, shape, limit):
    repack(good, bad, {key: npy_that_declares(dtype, tuple(shape))})
    read = read_mesh if key in ("vertices", "triangles") else TerrainMap.load
    assert refusal(bad, read).endswith(f" bytes; expected at most {limit}")
