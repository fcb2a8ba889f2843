"""Compare written robot files with their source: link poses, masses and joint inertias.

This package computes the kinematics of the source, and MuJoCo the kinematics of the written files.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.bodies.link_poses import link_poses, random_positions
from terrainkit_robots.analysis.bodies.mimic_joints import mimic_positions
from terrainkit_robots.analysis.inertia.composite_inertia import composite_inertias
from terrainkit_robots.analysis.legs.standing_pose import joint_range
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import Matrix, pose_error

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

NUM_POSES = 100
"""Number of random poses at which links are compared."""

_MAX_POSITION = np.pi
"""Random positions of joints without limits are at most this far from 0 [rad]."""

_MAX_DISTANCE, _MAX_ANGLE, _MAX_RELATIVE_MASS = 1e-4, 1e-3, 1e-3
"""Tolerances of link positions [m] and orientations [rad], and of masses and inertias."""


@dataclass(frozen=True, kw_only=True)
class Equivalence:
    """The differences between a written file and its source."""

    file: str
    """Name of the written file."""

    mass: float
    """Relative error of the total mass."""

    inertia: float
    """Largest relative error of the inertia about a joint axis, with all joints at 0."""

    joint: str
    """The joint with the largest inertia error; empty without joints."""

    distance: float
    """Largest position error of a link frame [m]."""

    link: str
    """The link with the largest position error."""

    angle: float
    """Largest orientation error of a link frame [rad]."""

    angle_link: str
    """The link with the largest orientation error."""

    @property
    def failures(self) -> tuple[str, ...]:
        """The differences that exceed the tolerances; empty if the robots are equivalent."""
        checks = {
            f"the position of {self.link} is off by {1000 * self.distance:.3g} mm": self.distance
            <= _MAX_DISTANCE,
            f"the orientation of {self.angle_link} is off by "
            f"{math.degrees(self.angle):.3g} degrees": self.angle <= _MAX_ANGLE,
            f"the mass is off by {self.mass:.2%}": abs(self.mass) <= _MAX_RELATIVE_MASS,
            f"the inertia about {self.joint} is off by {self.inertia:.2%}": self.inertia
            <= _MAX_RELATIVE_MASS,
        }
        return tuple(text for text, passed in checks.items() if not passed)


@dataclass(frozen=True, kw_only=True, eq=False)
class ReferenceKinematics:
    """The poses, masses and inertias that written files must reproduce."""

    mass: float
    """Total mass [kg]."""

    base: str
    """Name of the base link in the written files."""

    positions: Mapping[str, Matrix]
    """Positions of each joint, by its written name, shape (NUM_POSES,) [rad] or [m]."""

    link_poses: Mapping[str, Matrix]
    """Pose of each link in the base frame, shape (NUM_POSES, 4, 4) [m]."""

    zero: Mapping[str, float]
    """Positions with all joints at 0, except that followers are at their offsets [rad] or [m]."""

    inertia: Mapping[str, float]
    """Inertia about each joint axis in `zero`, by written name [kg m2] or [kg]."""


def reference_kinematics(source: "Facts", written: "Facts") -> ReferenceKinematics:
    """Return what the written files of a robot must reproduce, at seeded random poses.

    Args:
        source: The source robot, with known masses.
        written: The written robot, whose joints may have other names.
    """
    source_names = {joint.child: joint.name for joint in source.joints}
    renamed = {
        joint.name: source_names[joint.child]
        for joint in written.joints
        if joint.child in source_names
    }
    inertias = {
        body.joint.name: inertia
        for body, inertia in zip(source.bodies, composite_inertias(source.bodies), strict=True)
        if body.joint is not None and math.isfinite(inertia) and inertia > 0
    }
    ranges = {
        joint.name: tuple(np.clip(joint_range(joint), -_MAX_POSITION, _MAX_POSITION))
        for joint in written.joints
    }
    positions = random_positions(ranges, written.joints, count=NUM_POSES, seed=0)
    zero = {joint.name: 0.0 for joint in written.joints}
    source_positions = {renamed[name]: q for name, q in positions.items() if name in renamed}
    return ReferenceKinematics(
        mass=source.total_mass,
        base=written.bodies[0].top.name,
        positions=positions,
        link_poses=link_poses(source.bodies, source_positions, count=NUM_POSES),
        zero=zero | {name: float(q) for name, q in mimic_positions(written.joints, zero).items()},
        inertia={n: inertias[name] for n, name in renamed.items() if name in inertias},
    )


def compare_models(
    reference: ReferenceKinematics, models: Mapping[str, Any]
) -> tuple[Equivalence, ...]:
    """Return the differences of compiled models from the reference.

    Args:
        reference: What the models must reproduce.
        models: The `mujoco.MjModel` of each written file, by file name.
    """
    with quiet_mujoco():
        return tuple(_compare(file, model, reference) for file, model in models.items())


def _compare(file: str, model: Any, reference: ReferenceKinematics) -> Equivalence:
    errors = {
        name: pose_error(reference.link_poses[name], poses)
        for name, poses in _mujoco_link_poses(model, reference).items()
    }
    distances = {name: float(distance.max()) for name, (distance, _) in errors.items()}
    angles = {name: float(angle.max()) for name, (_, angle) in errors.items()}
    inertias = {
        name: abs(inertia / reference.inertia[name] - 1)
        for name, inertia in _mujoco_joint_inertia(model, reference.zero).items()
        if name in reference.inertia
    }
    link, angle_link, joint = (
        max(errors, key=errors.__getitem__, default="") for errors in (distances, angles, inertias)
    )
    mass = float(model.body_mass.sum())
    return Equivalence(
        file=file,
        mass=mass / reference.mass - 1 if reference.mass else mass,
        inertia=inertias.get(joint, 0.0),
        joint=joint,
        distance=distances.get(link, 0.0),
        link=link,
        angle=angles.get(angle_link, 0.0),
        angle_link=angle_link,
    )


def _mujoco_link_poses(model: Any, reference: ReferenceKinematics) -> dict[str, Matrix]:
    """Return poses in the base frame of the links that are bodies or sites in MuJoCo."""
    import mujoco

    positions, links = reference.positions, reference.link_poses
    data = mujoco.MjData(model)
    body_type, site_type = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE
    # The URDF reader makes the base a part of the world, at its origin.
    base = max(mujoco.mj_name2id(model, body_type, reference.base), 0)
    bodies = {name: mujoco.mj_name2id(model, body_type, name) for name in links}
    sites = {name: mujoco.mj_name2id(model, site_type, name) for name in links}
    bodies = {name: index for name, index in bodies.items() if index > 0}
    sites = {n: index for n, index in sites.items() if index >= 0 and n not in bodies}
    body_ids, site_ids = list(bodies.values()), list(sites.values())
    addresses = [int(model.joint(name).qposadr[0]) for name in positions]
    qpos = np.array(list(positions.values())).reshape(len(positions), NUM_POSES).T
    poses = np.tile(np.eye(4), (NUM_POSES, len(bodies) + len(sites), 1, 1))
    for pose, q in zip(poses, qpos, strict=True):
        data.qpos[addresses] = q
        mujoco.mj_kinematics(model, data)
        rotation = data.xmat[base].reshape(3, 3)
        xpos = np.concatenate([data.xpos[body_ids], data.site_xpos[site_ids]])
        xmat = np.concatenate([data.xmat[body_ids], data.site_xmat[site_ids]]).reshape(-1, 3, 3)
        pose[:, :3, 3] = (xpos - data.xpos[base]) @ rotation
        pose[:, :3, :3] = rotation.T @ xmat
    return {name: poses[:, index] for index, name in enumerate([*bodies, *sites])}


def _mujoco_joint_inertia(model: Any, positions: Mapping[str, float]) -> dict[str, float]:
    """Return the inertia about each joint axis without armature, at positions by joint name."""
    import mujoco

    data = mujoco.MjData(model)
    for name, position in positions.items():
        data.qpos[int(model.joint(name).qposadr[0])] = position
    mujoco.mj_fwdPosition(model, data)
    row, inertias = np.zeros(model.nv), {}
    for name in positions:
        dof = int(model.joint(name).dofadr[0])
        mujoco.mj_mulM(model, data, row, np.eye(model.nv)[dof])
        inertias[name] = float(row[dof] - model.dof_armature[dof])
    return inertias
