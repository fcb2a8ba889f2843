import dataclasses
import io
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from terrainkit import MapConfig, SubTerrain, TerrainMap, generate
from terrainkit.errors import MapFileError, MemoryLimitError
from terrainkit.export.npz import read_mesh
from terrainkit.export.requirements import has_one_friction
from terrainkit.geometry.solids import Solids
from terrainkit.map.validate import validate


@pytest.fixture(scope="module")
def path(terrain_map, tmp_path_factory):
    return terrain_map.save(tmp_path_factory.mktemp("npz") / "map.npz")


@pytest.fixture(scope="module")
def arrays(path):
    with np.load(path, allow_pickle=False) as archive:
        return dict(archive)


# ---- what is in it -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "dtype", "shape"),
    [
        ("format_version", "int64", ()),
        ("heights", "float32", (184, 144)),
        ("cell", "float64", ()),
        ("lower", "float64", (2,)),
        ("border", "float64", ()),
        ("patch_size", "float64", (2,)),
        ("env_origins", "float32", (2, 3, 3)),
        ("spawns", "float32", (2, 3, 1, 4)),
        ("terrain_types", "int32", (2, 3)),
        ("difficulty", "float32", (2, 3)),
        ("boxes", "float32", (0, 10)),
    ],
)
def test_npz_arrays_have_dtype_and_shape(arrays, key, dtype, shape):
    assert arrays[key].dtype == dtype
    assert arrays[key].shape == shape


@pytest.mark.parametrize(("key", "dtype"), [("vertices", "float32"), ("triangles", "int32")])
def test_npz_trimesh_has_three_columns(arrays, key, dtype):
    assert arrays[key].dtype == dtype
    assert arrays[key].shape[1:] == (3,)


@pytest.mark.parametrize(("key", "shape"), [("terrain_names", (3,)), ("config", ())])
def test_npz_text_is_no_object(arrays, key, shape):
    assert arrays[key].dtype.kind == "U"
    assert arrays[key].shape == shape


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("format_version", 1),
        ("cell", 0.1),
        ("lower", [-1.2, -1.2]),
        ("border", 1.2),
        ("patch_size", [8.0, 4.0]),
        ("terrain_types", [[0, 1, 2]] * 2),
        ("terrain_names", ["stairs", "obstacles", "rough_slope"]),
        ("difficulty", [[0.0] * 3, [1.0] * 3]),
        ("friction", [0.8, 0.6]),
        ("restitution", 0.1),
    ],
)
def test_npz_arrays_describe_the_map(arrays, key, value):
    assert arrays[key].tolist() == value


def test_npz_heights_match_cell_and_lower(arrays, terrain_map):
    i, j = np.indices(arrays["heights"].shape)
    xy = arrays["lower"] + (np.stack([i, j], axis=-1) + 0.5) * arrays["cell"]
    np.testing.assert_allclose(terrain_map.height(xy), arrays["heights"], atol=1e-3)


def test_npz_trimesh_is_the_surface(arrays, terrain_map, ray_down):
    vertices, triangles = arrays["vertices"].astype(float), arrays["triangles"]
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > -1e-9).all()
    grid = terrain_map.grid
    xy = np.random.default_rng(0).uniform(grid.lower, grid.upper, size=(500, 2))
    found = ray_down(vertices, triangles, xy)
    np.testing.assert_allclose(found, terrain_map.height(xy), atol=1e-3)


def test_npz_loads_with_numpy_without_pickle(path):
    script = (
        "import sys, numpy\n"
        "with numpy.load(sys.argv[1], allow_pickle=False) as archive:\n"
        "    print(sum(archive[key].nbytes for key in archive) > 0)\n"
        "print(any(name.startswith('terrainkit') for name in sys.modules))\n"
    )
    done = subprocess.run(
        [sys.executable, "-I", "-c", script, path], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["True", "False"]


def test_npz_config_generates_the_same_bytes(arrays, path, tmp_path):
    again = generate(MapConfig.from_toml(str(arrays["config"])))
    assert again.save(tmp_path / "again.npz").read_bytes() == path.read_bytes()


def test_npz_round_trip(path, terrain_map):
    read = TerrainMap.load(path)
    for field in dataclasses.fields(TerrainMap):
        found, wanted = (getattr(each, field.name) for each in (read, terrain_map))
        if isinstance(wanted, Solids):
            for part in dataclasses.fields(Solids):
                values, expected = getattr(found, part.name), getattr(wanted, part.name)
                assert (values.dtype, values.tobytes()) == (expected.dtype, expected.tobytes())
        elif isinstance(wanted, np.ndarray) and wanted.dtype != object:
            assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape)
            assert found.tobytes() == wanted.tobytes()
        else:
            assert np.array_equal(found, wanted)


def test_npz_solids_round_trip(solid_map, tmp_path):
    read = TerrainMap.load(solid_map.save(tmp_path / "solids.npz"))
    for part in dataclasses.fields(Solids):
        values, expected = (getattr(each.solids, part.name) for each in (read, solid_map))
        assert (values.dtype, values.tobytes()) == (expected.dtype, expected.tobytes())
    assert read.goals.tobytes() == solid_map.goals.tobytes()
    assert len(read.patch(0, 0).solids) == 0
    assert len(read.patch(0, 1).solids) == 4
    assert read.patch(0, 1).goals.tolist() == [[3, 6, 0, 0], [5.5, 6, 0, 1]]


def test_npz_loaded_map_saves_the_same_bytes(path, tmp_path):
    again = TerrainMap.load(str(path)).save(tmp_path / "again.npz")
    assert again.read_bytes() == path.read_bytes()


def test_npz_mesh_round_trip(path, terrain_map):
    read, wanted = read_mesh(path), terrain_map.mesh()
    assert read.vertices.tobytes() == wanted.vertices.tobytes()
    assert read.triangles.tobytes() == wanted.triangles.tobytes()


def test_npz_without_a_mesh_has_all_other_arrays(path, terrain_map, arrays, tmp_path):
    small = terrain_map.save(tmp_path / "small.npz", mesh=False)
    with np.load(small, allow_pickle=False) as archive:
        assert set(arrays) - set(archive) == {"vertices", "triangles"}
        assert all(archive[key].tobytes() == arrays[key].tobytes() for key in archive)
    assert read_mesh(small) is None
    again = TerrainMap.load(small).save(tmp_path / "again.npz")
    assert again.read_bytes() == path.read_bytes()


# ---- what is no map ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small_map():
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


def config_with(good, old, new):
    with np.load(good) as archive:
        text = str(archive["config"])
    assert old in text
    return npy(text.replace(old, new))


def refusal(path, read=TerrainMap.load):
    with pytest.raises(MapFileError) as error:
        read(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_npz_missing_file_is_rejected(tmp_path):
    assert refusal(tmp_path / "none.npz").startswith("no file ")


def test_npz_folder_is_rejected(tmp_path):
    assert "got a special file or folder" in refusal(tmp_path)


def test_npz_fifo_does_not_block(tmp_path):
    os.mkfifo(tmp_path / "map.npz")
    assert "got a special file or folder" in refusal(tmp_path / "map.npz")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no /dev/zero on this system")
def test_npz_device_is_rejected():
    assert "got a special file or folder" in refusal(Path("/dev/zero"))


@pytest.mark.parametrize("data", [b"", b"hello\n", b"PK\x03\x04", b"\x93NUMPY", bytes(5000)])
def test_npz_other_file_is_rejected(bad, data):
    bad.write_bytes(data)
    assert "not an .npz file" in refusal(bad)


def test_npz_other_zip_is_rejected(bad):
    with zipfile.ZipFile(bad, "w") as archive:
        archive.writestr("readme.txt", "hello")
    assert "not a terrainkit map; format_version is missing" in refusal(bad)


def test_npz_other_npz_is_rejected(bad):
    np.savez(bad, heights=np.zeros((3, 3)))
    assert "not a terrainkit map; format_version is missing" in refusal(bad)


@pytest.mark.parametrize("read", [TerrainMap.load, read_mesh])
@given(share=st.floats(0.0, 1.0, exclude_max=True))
@settings(deadline=None, derandomize=True, max_examples=40)
def test_npz_truncated_file_is_rejected(good, bad, read, share):
    data = good.read_bytes()
    bad.write_bytes(data[: int(share * len(data))])
    refusal(bad, read)


@given(share=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
@settings(deadline=None, derandomize=True, max_examples=200)
def test_npz_flipped_byte_is_detected_or_harmless(good, bad, small_map, share, flip):
    data = bytearray(good.read_bytes())
    data[int(share * len(data))] ^= flip
    bad.write_bytes(data)
    try:
        read = TerrainMap.load(bad)
    except MapFileError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert read.heights.tobytes() == small_map.heights.tobytes()
        assert read.env_origins.tobytes() == small_map.env_origins.tobytes()
        assert read.config == small_map.config


@pytest.mark.parametrize("compression", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_npz_compressed_map_loads_unless_damaged(good, bad, small_map, compression):
    repack(good, bad, {}, compression)
    assert TerrainMap.load(bad).heights.tobytes() == small_map.heights.tobytes()
    data = bytearray(bad.read_bytes())
    data[80:100] = bytes(20)  # within the first member
    bad.write_bytes(data)
    refusal(bad)


def test_npz_invalid_member_name_is_rejected(good, bad):
    data = good.read_bytes()
    with zipfile.ZipFile(good) as archive:
        directory = archive.start_dir
    entry = bytearray(data[directory:])
    entry[9] |= 0x08  # says that the name is UTF-8
    entry[46] = 0xFF
    bad.write_bytes(data[:directory] + entry)
    refusal(bad)


class Bomb:
    def __init__(self, target):
        self.target = target

    def __reduce__(self):
        return Path.touch, (self.target,)


@pytest.mark.parametrize("key", ["heights", "config", "terrain_names", "format_version"])
def test_npz_pickled_object_is_not_unpickled(good, bad, tmp_path, key):
    touched = tmp_path / "touched"
    repack(good, bad, {key: npy(np.array(Bomb(touched), dtype=object))})
    assert f"{key}: got dtype object" in refusal(bad)
    assert not touched.exists()


@pytest.mark.parametrize(
    "key",
    [
        "heights",
        "cell",
        "lower",
        "border",
        "patch_size",
        "env_origins",
        "terrain_types",
        "terrain_names",
        "difficulty",
        "boxes",
        "config",
        "parameters",
        "friction",
        "restitution",
    ],
)
def test_npz_missing_array_is_named(good, bad, key):
    repack(good, bad, {key: None})
    assert f"has no {key}" in refusal(bad)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("friction", [1.0, 0.5], r"friction: got [1.0, 0.5]; expected (1.0, 1.0) by its config"),
        ("friction", [np.nan, 1.0], r"friction: got [nan, 1.0]; expected (1.0, 1.0)"),
        ("restitution", np.nan, r"restitution: got nan; expected 0.0 by its config"),
        ("restitution", 0.5, r"restitution: got 0.5; expected 0.0 by its config"),
    ],
)
def test_npz_contact_values_must_match_config(good, bad, key, value, message):
    repack(good, bad, {key: npy(np.array(value))})
    assert message in refusal(bad)


@pytest.mark.parametrize("key", ["vertices", "triangles"])
def test_npz_missing_mesh_array_is_named(good, bad, key):
    repack(good, bad, {key: None})
    assert f"has no {key}" in refusal(bad, read_mesh)


@pytest.mark.parametrize(
    ("key", "shape", "wanted"),
    [
        ("heights", (12, 42), r"expected (42, 12)"),  # x and y swapped
        ("heights", (42 * 12,), r"expected (42, 12)"),
        ("env_origins", (1, 2, 3), r"expected (2, 1, 3)"),
        ("difficulty", (2,), r"expected (2, 1)"),
        ("lower", (3,), r"expected (2)"),
        ("cell", (1,), r"expected ()"),
    ],
)
def test_npz_wrong_shape_is_named(good, bad, key, shape, wanted):
    with np.load(good) as archive:
        repack(good, bad, {key: npy(np.zeros(shape, dtype=archive[key].dtype))})
    message = refusal(bad)
    assert f"{key}: got shape {shape}" in message
    assert wanted in message


@pytest.mark.parametrize(
    ("key", "dtype"),
    [
        ("heights", "int32"),
        ("heights", "float64"),
        ("heights", "complex64"),
        ("env_origins", "float64"),
        ("terrain_types", "float32"),
        ("terrain_types", "int64"),
        ("difficulty", "bool"),
    ],
)
def test_npz_wrong_dtype_is_named(good, bad, key, dtype):
    with np.load(good) as archive:
        repack(good, bad, {key: npy(archive[key].astype(dtype))})
    assert f"{key}: got dtype {dtype}" in refusal(bad)


def test_npz_other_format_version_is_rejected(good, bad):
    repack(good, bad, {"format_version": npy(2)})
    assert "got format version 2; expected 1" in refusal(bad)


@pytest.mark.parametrize("kind", [-1, 1, 1000])
def test_npz_terrain_type_out_of_range_is_rejected(good, bad, kind):
    repack(good, bad, {"terrain_types": npy(np.array([[0], [kind]], dtype=np.int32))})
    message = refusal(bad)
    assert message.endswith("terrain_types: got an index out of range; expected 0 to 0"), message


@pytest.mark.parametrize(
    ("key", "value"), [("cell", 0.2), ("border", 0.0), ("lower", [0.0, 0.0]), ("cell", np.nan)]
)
def test_npz_values_must_match_the_config(good, bad, key, value):
    repack(good, bad, {key: npy(value)})
    assert f"{key}: got {value}; expected" in refusal(bad)


@pytest.mark.parametrize("corner", [-1, 1000])
def test_npz_triangle_out_of_range_is_rejected(good, bad, corner):
    repack(good, bad, {"triangles": npy(np.array([[0, 1, corner]], dtype=np.int32))})
    assert "triangles" in refusal(bad, read_mesh)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("boxes", np.zeros((2, 10), np.float32)),
        ("solid_friction", np.zeros(3, np.float32)),
        ("hull_counts", np.array([8], np.int32)),
        ("solid_patch", np.zeros((0, 3), np.int32)),
    ],
)
def test_npz_inconsistent_solids_are_rejected(good, bad, key, value):
    repack(good, bad, {key: npy(value)})
    assert "expected" in refusal(bad)


def test_npz_degenerate_hull_is_rejected(solid_map, bad, tmp_path):
    good = solid_map.save(tmp_path / "good.npz")
    flat = solid_map.solids.hull_vertices * np.float32([1, 1, 0])
    repack(good, bad, {"hull_vertices": npy(flat)})
    assert "hull: got points in one plane; expected points with a volume" in refusal(bad)


def test_npz_spawns_round_trip(tmp_path):
    terrains = (SubTerrain(terrain="flat"), SubTerrain(terrain="pit"))
    config = MapConfig(rows=2, cols=2, border=0.0, spawns_per_patch=20, terrains=terrains)
    terrain_map = generate(config)
    read = TerrainMap.load(terrain_map.save(tmp_path / "map.npz"))
    assert np.isnan(read.spawns).any()
    assert read.spawns.tobytes() == terrain_map.spawns.tobytes()


def test_npz_env_origins_are_the_first_spawns(good, bad):
    with np.load(good) as archive:
        origins = archive["env_origins"] + np.float32(0.25)
    repack(good, bad, {"env_origins": npy(origins)})
    assert TerrainMap.load(bad).spawns[:, :, 0, :3].tolist() == origins.tolist()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.zeros((2, 1, 0, 4)), "spawns: got none; expected one or more for each patch"),
        (np.full((2, 1, 1, 4), np.inf), "spawns: got values that are not finite"),
        (np.array([[[[1, 2, 3, np.nan]]]] * 2), "spawns: got values that are not finite"),
        (np.array([[[[np.nan] * 4, [0] * 4]]] * 2), "spawns: got a gap; expected NaN at the end"),
        (np.zeros((1, 2, 1, 4)), "spawns: got shape (1, 2, 1, 4)"),
    ],
)
def test_npz_invalid_spawns_are_rejected(good, bad, value, message):
    repack(good, bad, {"spawns": npy(value.astype(np.float32))})
    assert message in refusal(bad)


@pytest.mark.parametrize("text", ["{{{", "hello", "rows = ", "a\0b", '"a\nb" = 1'])
def test_npz_invalid_toml_config_is_rejected(good, bad, text):
    repack(good, bad, {"config": npy(text)})
    assert "config: not a TOML file" in refusal(bad)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("rows = 2", "rows = 0", "rows"),
        ("rows = 2", "rows = 2\nlayers = 3", "layers"),
        ("rows = 2", 'rows = 2\n"a\\nb" = 3', "config"),
        ('"curriculum"', "[1]", "mode"),
        ('"pit"', '"moat"', "moat"),
        ('"pit"', "[1]", "terrain"),
        ("proportion = 1.0", "proportion = 'much'", "proportion"),
        ("side = 0.6", "side = {a = 1}", "side"),
        ("side = 0.6", f"side = {'9' * 400}", "side"),
        ("cell = 0.1", "cell = nan", "cell"),
    ],
)
def test_npz_invalid_config_is_rejected(good, bad, old, new, named):
    repack(good, bad, {"config": config_with(good, old, new)})
    assert named in refusal(bad)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[]",
        "[[1], [2]]",
        "[[{}], [{}]]",
        '[[{"requested": {"depth": "deep"}, "realized": {}}], []]',
        '[[{"requested": {}, "realized": {"side": [1, 2, 3]}}], []]',
        "[" * 30_000,
        "1" * 5000,
    ],
    ids=["none", "table", "empty", "numbers", "bare", "text", "triple", "deep", "long"],
)
def test_npz_invalid_parameters_are_rejected(good, bad, text):
    repack(good, bad, {"parameters": npy(text)})
    assert "parameters cannot be read" in refusal(bad)


@pytest.mark.parametrize(
    "header",
    ["", "{", "(" * 500, "[]", "{'descr': 'x', 'fortran_order': False, 'shape': ()}", "x" * 20_000],
    ids=["none", "open", "deep", "list", "no dtype", "long"],
)
def test_npz_invalid_header_is_rejected(good, bad, header):
    repack(good, bad, {"heights": npy_header(header)})
    assert "heights cannot be read" in refusal(bad)


def test_npz_invalid_unicode_is_rejected(good, bad):
    repack(good, bad, {"config": npy_that_declares("<U2", ()) + b"\xff" * 8})
    assert "config" in refusal(bad)


# ---- what is too large -------------------------------------------------------------------------


def test_npz_oversized_heights_are_not_read(good, bad):
    repack(good, bad, {"heights": npy_that_declares("<f4", (10**6, 10**6))})
    assert "heights: got shape (1000000, 1000000); expected (42, 12)" in refusal(bad)


@pytest.mark.parametrize("key", ["config", "parameters"])
def test_npz_oversized_text_is_not_read(good, bad, key):
    repack(good, bad, {key: npy_that_declares("<U400000000", ())})
    assert f"{key}: got 1600000000 bytes" in refusal(bad)


@pytest.mark.parametrize(("key", "dtype"), [("vertices", "<f4"), ("triangles", "<i4")])
def test_npz_oversized_mesh_is_not_read(good, bad, key, dtype):
    repack(good, bad, {key: npy_that_declares(dtype, (10**12, 3))})
    assert f"{key}: got {10**12 * 12} bytes" in refusal(bad, read_mesh)


def test_npz_map_beyond_memory_is_not_read(good, bad):
    with np.load(good) as archive:
        config = str(archive["config"]).replace("rows = 2", "rows = 1")
    old = config[config.index("patch_size") : config.index("cell")]
    changes = {
        "config": npy(config.replace(old, "patch_size = [90000.0, 90000.0]\n")),
        "patch_size": npy([90000.0, 90000.0]),
        "terrain_types": npy(np.zeros((1, 1), dtype=np.int32)),
        "heights": npy_that_declares("<f4", (900_002, 900_002)),
    }
    repack(good, bad, changes)
    with pytest.raises(MemoryLimitError, match=r"heights in .* needs .* GB of memory"):
        TerrainMap.load(bad)


# ---- friction ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def icy_map():
    ice = SubTerrain(terrain="crawl", friction=(0.8, 0.2))
    rest = SubTerrain(terrain="flat")
    return generate(MapConfig(rows=2, cols=2, border=1.0, terrains=(ice, rest)))


def test_npz_has_friction_of_each_cell(icy_map, tmp_path):
    path = icy_map.save(tmp_path / "map.npz")
    friction = np.load(path)["ground_friction"]
    expected = np.ones((180, 180), np.float32)
    expected[10:90, 10:90], expected[90:170, 10:90] = 0.8, 0.2
    assert friction.tobytes() == expected.tobytes()
    loaded = TerrainMap.load(path)
    assert loaded.friction.tobytes() == expected.tobytes()
    assert set(loaded.solids.friction.tolist()) == {np.float32(0.8), np.float32(0.2)}
    assert not has_one_friction(loaded)


def test_npz_has_one_friction_of_a_uniform_map(terrain_map, path, arrays):
    assert arrays["ground_friction"].tolist() == [[np.float32(0.8)]]
    loaded = TerrainMap.load(path)
    assert has_one_friction(loaded)
    assert loaded.friction.shape == loaded.heights.shape == terrain_map.friction.shape


@pytest.mark.parametrize(
    ("friction", "message"),
    [
        (np.ones((2, 2), np.float32), r"got shape \(2, 2\); expected \(184, 144\), or \(1, 1\)"),
        (np.full((1, 1), -1, np.float32), "ground_friction: got values out of range"),
        (np.full((1, 1), np.nan, np.float32), "ground_friction: got values out of range"),
    ],
)
def test_npz_invalid_friction_is_rejected(arrays, tmp_path, friction, message):
    np.savez(tmp_path / "map.npz", **arrays | {"ground_friction": friction})
    with pytest.raises(MapFileError, match=message):
        TerrainMap.load(tmp_path / "map.npz")


def test_validate_reports_edited_friction(icy_map):
    friction = icy_map.friction.copy()
    friction[20, 20] = 0.5
    (issue,) = validate(dataclasses.replace(icy_map, friction=friction))
    assert issue.message.startswith("patch (0, 0): the friction coefficients differ from")
