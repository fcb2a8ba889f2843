"""Load an exported SDF model in Drake, and drop balls on it; `make integrations` runs it.

Gazebo is in no package index. Drake parses SDF with libsdformat, too, but reads no STL files, so
the meshes are converted to OBJ. Hydroelastic contact has the triangles of a mesh; point contact
would have their convex hull.
"""

import sys
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import trimesh
from parkour import CONFIG, RADIUS, ball_starts, rest_error
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    ProximityProperties,
    SceneGraphConfig,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

import terrainkit

terrain_map = terrainkit.generate(CONFIG)
friction = np.where(np.arange(len(terrain_map.solids)) % 2, 0.3, np.nan).astype(np.float32)
terrain_map = replace(terrain_map, solids=replace(terrain_map.solids, friction=friction))
starts = ball_starts(terrain_map)
path = terrain_map.save(Path(sys.argv[1]) / "map.sdf")
for file in path.parent.glob("*.stl"):
    trimesh.load_mesh(file).export(file.with_suffix(".obj"))
path.write_text(path.read_text().replace(".stl<", ".obj<"))

start = time.process_time()
builder = DiagramBuilder()
plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=0.005)
(model,) = Parser(plant).AddModels(str(path))
cpu = time.process_time() - start
balls = []
for k in range(len(starts)):
    inertia = SpatialInertia.SolidSphereWithMass(1.0, RADIUS)
    balls.append(plant.AddRigidBody(f"ball_{k}", plant.AddModelInstance(f"{k}"), inertia))
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(0.03, 1e7, properties)
    AddContactMaterial(friction=CoulombFriction(1.0, 1.0), properties=properties)
    plant.RegisterCollisionGeometry(
        balls[-1], RigidTransform(), Sphere(RADIUS), "sphere", properties
    )
plant.Finalize()
config = SceneGraphConfig()
config.default_proximity_properties.compliance_type = "rigid"
scene_graph.set_config(config)

inspector = scene_graph.model_inspector()
(link,) = plant.GetBodyIndices(model)
found = {
    inspector.GetName(each).split("::")[-1]: inspector.GetProximityProperties(each)
    for each in plant.GetCollisionGeometriesForBody(plant.get_body(link))
}
for k, own in enumerate(friction[: len(terrain_map.solids.boxes)]):
    expected = CONFIG.static_friction if np.isnan(own) else own
    value = found[f"solid_{k}_collision"].GetProperty("material", "coulomb_friction")
    assert abs(value.static_friction() - expected) < 1e-6, (k, value.static_friction())

simulator = Simulator(builder.Build())
context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
for ball, position in zip(balls, starts, strict=True):
    plant.SetFreeBodyPose(context, ball, RigidTransform(position))
simulator.AdvanceTo(0.3)
poses = [plant.EvalBodyPoseInWorld(context, ball).translation() for ball in balls]
error = rest_error(terrain_map, starts, poses)
assert error < 2e-3, error
print(
    f"Drake {version('drake')}: map.sdf read in {cpu:.1f} s, all balls within {error * 1e3:.1f} mm"
)
