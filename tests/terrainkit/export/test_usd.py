import dataclasses
import resource
import sys

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade, UsdValidation

from terrainkit.errors import ExportError
from terrainkit.geometry.mesh.solid_mesh import solid_meshes


@pytest.fixture(scope="module")
def static_map(solid_map):
    config = dataclasses.replace(solid_map.config, dynamic_friction=0.5, restitution=0.25)
    return dataclasses.replace(solid_map, config=config)


@pytest.fixture(scope="module")
def stage(static_map, tmp_path_factory):
    path = static_map.save(tmp_path_factory.mktemp("usd") / "map.usdc")
    return Usd.Stage.Open(str(path))


def test_usd_ground_is_the_mesh(stage, static_map):
    ground, mesh = UsdGeom.Mesh.Get(stage, "/terrain/ground"), static_map.ground_mesh()
    np.testing.assert_array_equal(np.array(ground.GetPointsAttr().Get()), mesh.vertices)
    indices = np.array(ground.GetFaceVertexIndicesAttr().Get())
    np.testing.assert_array_equal(indices.reshape(-1, 3), mesh.triangles)
    assert set(ground.GetFaceVertexCountsAttr().Get()) == {3}
    assert ground.GetSubdivisionSchemeAttr().Get() == "none"
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Z", 1.0)
    assert stage.GetDefaultPrim().GetPath() == "/terrain"
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetKind() == "component"


def test_usd_solids_have_the_same_bounds(stage, static_map):
    purposes = [UsdGeom.Tokens.default_, UsdGeom.Tokens.guide]
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), purposes)
    for k, mesh in enumerate(solid_meshes(static_map.solids)):
        prim = stage.GetPrimAtPath(f"/terrain/solids/solid_{k}")
        box = cache.ComputeWorldBound(prim).ComputeAlignedBox()
        np.testing.assert_allclose(box.GetMin(), mesh.vertices.min(axis=0), atol=1e-3)
        np.testing.assert_allclose(box.GetMax(), mesh.vertices.max(axis=0), atol=1e-3)


def test_usd_solids_are_colliders_with_friction(stage):
    found = []
    for path in ("ground", *(f"solids/solid_{k}" for k in range(4))):
        prim = stage.GetPrimAtPath(f"/terrain/{path}")
        binding = UsdShade.MaterialBindingAPI(prim).GetDirectBinding("physics")
        purpose, is_collider = prim.GetAttribute("purpose"), prim.HasAPI(UsdPhysics.CollisionAPI)
        approximation = prim.GetAttribute("physics:approximation").Get()
        material = binding.GetMaterialPath().name if is_collider else None
        found.append((prim.GetTypeName(), purpose.Get(), approximation, material))
    assert found == [
        ("Mesh", "default", "none", "ground_material"),
        ("Cube", "default", None, "friction_0_3"),
        ("Cube", "default", None, None),
        ("Cylinder", "guide", None, "ground_material"),
        ("Mesh", "default", "convexHull", "ground_material"),
    ]


def test_usd_materials_have_friction_and_restitution(stage):
    names = ("staticFriction", "dynamicFriction", "restitution")
    values = {
        prim.GetName(): [prim.GetAttribute(f"physics:{name}").Get() for name in names]
        for prim in stage.GetPrimAtPath("/terrain/materials").GetChildren()
    }
    assert values == {
        "ground_material": [1.0, 0.5, 0.25],
        "friction_0_3": pytest.approx([0.3, 0.3, 0.25]),
    }


def test_usd_points_are_spawns_and_goals(stage, static_map):
    for name, number in (("spawns", 2), ("goals", 2)):
        expected = getattr(static_map, name)[..., :3].reshape(-1, 3)
        expected = expected[~np.isnan(expected).any(axis=1)]
        prim = UsdGeom.Points.Get(stage, f"/terrain/{name}")
        np.testing.assert_array_equal(np.array(prim.GetPointsAttr().Get()), expected)
        assert prim.GetWidthsAttr().Get() == pytest.approx([0.1] * number)
        assert prim.GetPurposeAttr().Get() == "guide"


def test_usd_passes_all_validators(stage):
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert len(validators) > 10
    assert [error.GetMessage() for error in errors] == []


def test_usd_without_usd_core_is_one_line(static_map, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ExportError, match=r"pip install '\.\[usd\]'"):
        static_map.save(tmp_path / "map.usda")
    assert not list(tmp_path.iterdir())


def test_full_disk_is_one_line_without_the_temporary_path(terrain_map, tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.prlimit(0, resource.RLIMIT_FSIZE, (2000, limits[1]))  # fixtures replace setrlimit
    try:
        message = r"cannot write .*/map\.usdc: usd-core failed; the disk may be full$"
        with pytest.raises(ExportError, match=message):
            terrain_map.save(tmp_path / "map.usdc")
    finally:
        resource.prlimit(0, resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())
