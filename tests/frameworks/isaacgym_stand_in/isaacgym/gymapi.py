import os
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import torch

SIM_FLEX, SIM_PHYSX = 0, 1


class Vec3:
    def __init__(self, x=0.0, y=0.0, z=0.0):
        self.x, self.y, self.z = float(x), float(y), float(z)


class Transform:
    def __init__(self):
        self.p = Vec3()


class TerrainParams:
    def __init__(self):
        self.transform = Transform()


class SimParams:
    def __init__(self):
        self.physx = SimpleNamespace()


AssetOptions = SimpleNamespace
TriangleMeshParams = HeightFieldParams = PlaneParams = TerrainParams


class Asset:
    """The bodies and the moving joints of a URDF, depth first."""

    def __init__(self, path, options):
        robot = ElementTree.parse(path).getroot()
        joints = robot.findall("joint")
        children = {joint.find("child").get("link") for joint in joints}
        (root,) = (
            each.get("name") for each in robot.findall("link") if each.get("name") not in children
        )
        self.bodies, self.joints = [root], []
        self._add(root, joints, options.collapse_fixed_joints)

    def _add(self, parent, joints, collapse):
        found = [joint for joint in joints if joint.find("parent").get("link") == parent]
        for joint in sorted(found, key=lambda each: each.find("child").get("link")):
            is_fixed = joint.get("type") == "fixed"
            if not (is_fixed and collapse and joint.get("dont_collapse") != "true"):
                self.bodies.append(joint.find("child").get("link"))
            if not is_fixed:
                self.joints.append(joint)
            self._add(joint.find("child").get("link"), joints, collapse)


class Gym:
    """The functions that LeggedRobot calls; the others have no effect."""

    def __init__(self):
        self.asset, self.starts, self.terrain = None, [], None

    def __getattr__(self, name):
        return lambda *args, **options: None

    def add_triangle_mesh(self, sim, vertices, triangles, params):
        self.terrain = (vertices, triangles, params)

    def load_asset(self, sim, root, file, options):
        self.asset = Asset(os.path.join(root, file), options)
        return self.asset

    def get_asset_dof_count(self, asset):
        return len(asset.joints)

    def get_asset_rigid_body_count(self, asset):
        return len(asset.bodies)

    def get_asset_rigid_body_names(self, asset):
        return asset.bodies

    def get_asset_dof_names(self, asset):
        return [joint.get("name") for joint in asset.joints]

    def get_asset_dof_properties(self, asset):
        names = ("lower", "upper", "velocity", "effort")
        rows = [
            tuple(float(joint.find("limit").get(name)) for name in names) for joint in asset.joints
        ]
        return np.array(rows, dtype=[(name, "f4") for name in names])

    def get_asset_rigid_shape_properties(self, asset):
        return [SimpleNamespace(friction=1.0)]

    def get_actor_rigid_body_properties(self, env, actor):
        return [SimpleNamespace(mass=1.0) for _ in self.asset.bodies]

    def create_actor(self, env, asset, pose, *args):
        self.starts.append([pose.p.x, pose.p.y, pose.p.z])

    def find_actor_rigid_body_handle(self, env, actor, name):
        return self.asset.bodies.index(name)

    def acquire_actor_root_state_tensor(self, sim):
        states = torch.zeros(len(self.starts), 13)
        states[:, :3], states[:, 6] = torch.tensor(self.starts), 1.0
        return states

    def acquire_dof_state_tensor(self, sim):
        return torch.zeros(len(self.starts) * len(self.asset.joints), 2)

    def acquire_net_contact_force_tensor(self, sim):
        return torch.zeros(len(self.starts) * len(self.asset.bodies), 3)


def acquire_gym():
    return Gym()
