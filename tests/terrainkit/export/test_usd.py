import resource
import sys

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade, UsdValidation

import terrainkit as tk
from terrainkit.errors import ExportError
from terrainkit.geometry.mesh.solid_mesh import solid_meshes


@pytest.fixture(scope="module")
def parkour():
    config = tk.MapConfig(rows=2, cols=7, patch_size=(8.0, 6.0), border=1.0, preset="parkour")
    return tk.generate(config)


@pytest.fixture(scope="module")
def stage(parkour, tmp_path_factory):
    path = parkour.save(tmp_path_factory.mktemp("usd") / "map.usdc")
    return Usd.Stage.Open(str(path))


def test_usd_ground_is_the_mesh(stage, parkour):
    ground = UsdGeom.Mesh.Get(stage, "/terrain/ground")
    mesh = parkour.ground_mesh()
    np.testing.assert_array_equal(np.array(ground.GetPointsAttr().Get()), mesh.vertices)
    indices = np.array(ground.GetFaceVertexIndicesAttr().Get())
    np.testing.assert_array_equal(indices.reshape(-1, 3), mesh.triangles)
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetDefaultPrim().GetPath() == "/terrain"


def test_usd_solids_have_the_same_bounds(stage, parkour):
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    meshes = list(solid_meshes(parkour.solids))
    assert len(meshes) > 10
    for k, mesh in enumerate(meshes):
        bounds = cache.ComputeWorldBound(stage.GetPrimAtPath(f"/terrain/solids/solid_{k}"))
        box = bounds.ComputeAlignedRange()
        np.testing.assert_allclose(box.GetMin(), mesh.vertices.min(axis=0), atol=1e-3)
        np.testing.assert_allclose(box.GetMax(), mesh.vertices.max(axis=0), atol=1e-3)


def test_usd_colliders_have_friction(stage, parkour):
    prims = [each for each in stage.Traverse() if each.HasAPI(UsdPhysics.CollisionAPI)]
    assert len(prims) == 1 + int(parkour.solids.collides.sum())
    for prim in prims:
        material = UsdShade.MaterialBindingAPI(prim).GetDirectBinding("physics").GetMaterial()
        friction = UsdPhysics.MaterialAPI(material).GetStaticFrictionAttr().Get()
        assert friction == pytest.approx(1.0)


def test_usd_points_are_spawns_and_goals(stage, parkour):
    for name in ("spawns", "goals"):
        expected = getattr(parkour, name)[..., :3].reshape(-1, 3)
        expected = expected[~np.isnan(expected).any(axis=1)]
        points = UsdGeom.Points.Get(stage, f"/terrain/{name}").GetPointsAttr().Get()
        np.testing.assert_array_equal(np.array(points), expected)


def test_usd_passes_all_validators(stage):
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert len(validators) > 10
    assert [error.GetMessage() for error in errors] == []


def test_usd_without_usd_core_is_one_line(parkour, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ExportError, match=r"pip install '\.\[usd\]'"):
        parkour.save(tmp_path / "map.usda")
    assert not list(tmp_path.iterdir())


def test_full_disk_is_one_line_without_the_temporary_path(parkour, tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.prlimit(0, resource.RLIMIT_FSIZE, (2000, limits[1]))  # fixtures replace setrlimit
    try:
        message = r"cannot write .*/map\.usdc: usd-core failed; the disk may be full$"
        with pytest.raises(ExportError, match=message):
            parkour.save(tmp_path / "map.usdc")
    finally:
        resource.prlimit(0, resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())
