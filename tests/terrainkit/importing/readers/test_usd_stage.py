import os
import socket

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

from terrainkit.errors import HeightFileError, TerrainkitWarning
from terrainkit.importing.readers import usd_stage
from terrainkit.importing.readers.height_source import open_source
from terrainkit.importing.readers.import_options import ReadOptions
from tests.tables import read_table


def save(folder, text, name="a.usda"):
    (folder / name).write_text("#usda 1.0\n" + text.replace(" }", "\n}"))
    return folder / name


def height(source, x, y):
    return float(source.heights(np.array([x]), np.array([y]))[0, 0])


METERS = "(metersPerUnit = 1\nupAxis = 'Z')\n"


@pytest.mark.parametrize(("text", "expected"), read_table(__file__, "shapes_have_their_heights"))
def test_stage_shapes_have_their_heights(tmp_path, text, expected):
    source = open_source(save(tmp_path, METERS + text), ReadOptions())
    assert source.is_metric
    for x, y, z in expected:
        # Cylinders and spheres are within 0.3 % of their radius.
        assert height(source, x, y) == pytest.approx(z, abs=3e-3, nan_ok=True), (x, y)


TRIANGLE = """def Mesh "a" {
    point3f[] points = [(0, 100, 0), (300, 100, 0), (0, 400, -300)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
}"""


@pytest.mark.parametrize(
    ("header", "options", "upper"),
    [
        ("(metersPerUnit = 0.01\nupAxis = 'Y')", {}, (3, 3)),
        ("(metersPerUnit = 0.01\nupAxis = 'Z')", {}, (3, 4)),
        ("(metersPerUnit = 0.01\nupAxis = 'Z')", {"up": "y", "scale": 0.1}, (30, 30)),
        ("(upAxis = 'Z')", {"scale": 1.0}, (300, 400)),
    ],
)
def test_stage_has_its_unit_and_axis(tmp_path, header, options, upper):
    source = open_source(save(tmp_path, header + TRIANGLE), ReadOptions(**options))
    assert source.is_metric
    assert source.upper == pytest.approx(upper)


def test_stage_without_unit_is_in_meters(tmp_path):
    path = save(tmp_path, "(upAxis = 'Z')" + TRIANGLE)
    with pytest.warns(TerrainkitWarning, match=r"no metersPerUnit: taken as meters; `scale=0\.01`"):
        source = open_source(path, ReadOptions())
    assert (source.upper, source.is_metric) == ((300, 400), False)


def test_stage_has_copies(tmp_path):
    save(tmp_path, METERS + 'def Xform "part" { def Cube "c" {} }', "part.usda")
    instances = "".join(
        f'def "i{k}" (instanceable = true\nreferences = @part.usda@</part>) '
        f"{{ double3 xformOp:translate = ({4 * k}, 0, {k})\n"
        "float3 xformOp:scale = (1, -1, 1)\n"
        'token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"] }\n'
        for k in range(2)
    )
    path = save(tmp_path, METERS + f'def Xform "w" {{ {instances} }}')
    stage = Usd.Stage.Open(str(path))
    copies = UsdGeom.PointInstancer.Define(stage, "/copies")
    copies.AddTranslateOp().Set(Gf.Vec3d(0, 10, 0))
    sphere = UsdGeom.Sphere.Define(stage, "/copies/all/sphere")
    sphere.AddTranslateOp().Set(Gf.Vec3d(0, 0, 5))
    copies.CreatePrototypesRel().SetTargets(["/copies/all"])
    copies.CreateProtoIndicesAttr([0, 0, 0])
    copies.CreatePositionsAttr([(0, 0, 0), (4, 0, 0), (8, 0, 0)])
    copies.CreateScalesAttr([(1, 1, 2)] * 3)
    copies.DeactivateId(1)
    stage.Save()
    source = open_source(path, ReadOptions())
    expected = [(0, 0, 1), (4, 0, 2), (0, 10, 12), (4, 10, np.nan), (8, 10, 12)]
    for x, y, z in expected:
        assert height(source, x, y) == pytest.approx(z, nan_ok=True)
    _, y, z = source.vertices[source.faces[:12]].mean(axis=1).T  # of a mirrored cube
    a, b, c = np.moveaxis(source.vertices[source.faces[:12]], 1, 0)
    normals = np.cross(b - a, c - a)
    assert (normals[z > 0.9, 2] > 0).all()
    assert (normals[y > 0.9, 1] > 0).all()


@pytest.mark.filterwarnings("ignore:.*visible shapes that do not collide")
@pytest.mark.parametrize("suffix", [".usd", ".usda", ".usdc"])
def test_stage_of_an_exported_map_has_its_heights(tmp_path, solid_map, suffix):
    source = open_source(solid_map.save(tmp_path / f"map{suffix}"), ReadOptions())
    # The box that does not collide is no ground.
    expected = [(2.5, 2, 0), (1, 6, 0.6), (5, 6, 0), (2, 6, 0.7), (4.1, 6.1, 0.4)]
    for x, y, z in expected:
        assert height(source, x, y) == pytest.approx(z, abs=1e-5), (x, y)


def test_stage_has_the_ground_of_an_exported_map(tmp_path, terrain_map):
    source = open_source(terrain_map.save(tmp_path / "map.usdc"), ReadOptions())
    grid = terrain_map.grid
    x, y = (
        low + (np.arange(n) + 0.5) * grid.cell
        for low, n in zip(grid.lower, grid.shape, strict=True)
    )
    found = source.heights(x[1:-2], y[1:-2])
    points = np.stack(np.meshgrid(x[1:-2], y[1:-2], indexing="ij"), axis=-1)
    np.testing.assert_allclose(found, terrain_map.height(points), atol=2e-3)


@pytest.mark.parametrize(("text", "kept", "warning"), read_table(__file__, "left_out"))
def test_stage_leaves_out_what_is_no_ground(tmp_path, text, kept, warning):
    with pytest.warns(TerrainkitWarning, match=f"a.usda: {warning}$"):
        source = open_source(save(tmp_path, METERS + text), ReadOptions())
    assert source.upper == pytest.approx((kept, 1.0))


@pytest.mark.filterwarnings("ignore:.*shapes of type Points are left out")
@pytest.mark.parametrize(("text", "message"), read_table(__file__, "rejected"))
def test_stage_without_ground_is_rejected(tmp_path, text, message):
    with pytest.raises(HeightFileError, match=rf"a\.usda: .*{message}"):
        open_source(save(tmp_path, METERS + text), ReadOptions())


def test_stage_of_many_copies_is_rejected(tmp_path, monkeypatch):
    monkeypatch.setattr(usd_stage, "MAX_VERTICES", 3000 * 642 - 1)
    text = 'def PointInstancer "p" {{ rel prototypes = </p/s>\nint[] protoIndices = [{}]\n'
    text += 'point3f[] positions = [{}]\ndef Sphere "s" {{}} }}'
    path = save(tmp_path, METERS + text.format("0," * 3000, "(0,0,0)," * 3000))
    with pytest.raises(HeightFileError, match="got more than 1925999 vertices, copies included"):
        open_source(path, ReadOptions())


@pytest.mark.usefixtures("real_child")
def test_stage_is_read_without_connecting(tmp_path):
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        server.setblocking(False)
        address = f"http://127.0.0.1:{server.getsockname()[1]}/a.usda"
        path = save(tmp_path, METERS + f'def "a" (references = @{address}@) {{}}')
        with pytest.raises(HeightFileError, match=r"a part cannot be opened.*127"):
            open_source(path, ReadOptions())
        with pytest.raises(BlockingIOError):
            server.accept()


@pytest.mark.usefixtures("real_child")
def test_stage_damaged_is_rejected(tmp_path):
    (tmp_path / "a.usdc").write_bytes(b"PXR-USDC" + os.urandom(300))
    with pytest.raises(HeightFileError, match=r"a\.usdc: cannot be read"):
        open_source(tmp_path / "a.usdc", ReadOptions())
