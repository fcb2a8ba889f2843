"""Agreement: whether what was written is the robot that was read.

The source is followed by our own kinematics, the two files by MuJoCo's readers of URDF and MJCF.
`check-robot --against` compares by yourdfpy, too, whose import would take half as long as the rest.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.mimic_joints import mimic_positions
from terrainkit_robots.analysis.inertia.composite_inertia import composite_inertias
from terrainkit_robots.analysis.legs.standing_pose import joint_range
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

POSES = 100
"""Poses at which links are compared."""

_WIDEST = np.pi
"""A joint without limits is turned by up to this [rad]."""

_SAME_PLACE = 1e-4
_SAME_TURN = 1e-3
_SAME_MASS = 1e-3
"""A written robot is the one that was read up to such a distance [m] and angle [rad] of its links,
and such a share of its mass, and of the inertia that each joint carries."""


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How far a written file is from the source."""

    file: str
    """The file."""

    mass: float
    """Its mass over that of the source, less 1."""

    inertia: float
    """Largest such difference of the inertia that a joint carries, all joints at 0."""

    joint: str
    """The joint that has it; empty without joints."""

    distance: float
    """Largest distance of a link's frame from where it is in the source [m]."""

    link: str
    """The link that is farthest away."""

    angle: float
    """Largest angle between a link's frame and that in the source [rad]."""

    turned: str
    """The link that is turned the most."""

    @property
    def faults(self) -> tuple[str, ...]:
        """Return what makes it another robot; nothing if it is the same."""
        found = {
            f"{self.link} is {1000 * self.distance:.3g} mm away": self.distance <= _SAME_PLACE,
            f"{self.turned} is turned by {math.degrees(self.angle):.3g} degrees": self.angle
            <= _SAME_TURN,
            f"the mass is off by {self.mass:.2%}": abs(self.mass) <= _SAME_MASS,
            f"what {self.joint} carries is off by {self.inertia:.2%}": self.inertia <= _SAME_MASS,
        }
        return tuple(text for text, same in found.items() if not same)


@dataclass(frozen=True, kw_only=True, eq=False)
class Expected:
    """What a written file has to show."""

    mass: float
    """Mass of the robot [kg]."""

    base: str
    """Its base, in the written files."""

    draws: Mapping[str, Matrix]
    """Positions of each joint, as it is written, shape (POSES,) [rad] or [m]."""

    places: Mapping[str, Matrix]
    """Pose of each link in the frame of the base, shapes (POSES, 4, 4) [m]."""

    carried: Mapping[str, float]
    """Inertia that each joint, as it is written, carries at 0 [kg m2] or [kg]."""


def expected(source: "Facts", written: "Facts") -> Expected:
    """Return what the files of a robot have to show, over POSES seeded poses.

    Args:
        source: The robot as it was read, its masses known.
        written: The robot as it is written, whose joints may have other names.
    """
    draws, renamed = _draws(written), _renamed(source, written)
    inertias = {
        body.joint.name: inertia
        for body, inertia in zip(
            source.bodies, composite_inertias(source.bodies, source.zero_poses), strict=True
        )
        if body.joint is not None and math.isfinite(inertia) and inertia > 0
    }
    return Expected(
        mass=source.total_mass,
        base=written.bodies[0].top.name,
        draws=draws,
        places=_places(source, {renamed[name]: q for name, q in draws.items() if name in renamed}),
        carried={n: inertias[name] for n, name in renamed.items() if name in inertias},
    )


def agreement(wanted: Expected, models: Mapping[str, Any]) -> tuple[Agreement, ...]:
    """Return how far written files are from their source.

    Args:
        wanted: What they have to show.
        models: What MuJoCo made of them, by their names.
    """
    with quiet_mujoco():
        return tuple(_compared(file, model, wanted) for file, model in models.items())


def _draws(facts: "Facts") -> dict[str, Matrix]:
    """Return positions of each joint within its limits, shape (POSES,), of followers as well."""
    rng = np.random.default_rng(0)
    drawn: dict[str, Matrix] = {}
    for joint in facts.joints:
        lower, upper = np.clip(joint_range(joint), -_WIDEST, _WIDEST)
        drawn[joint.name] = rng.uniform(lower, upper, POSES)
    return drawn | mimic_positions(facts.joints, drawn)


def _renamed(source: "Facts", written: "Facts") -> dict[str, str]:
    """Return what the source calls each joint."""
    before = {joint.child: joint.name for joint in source.joints}
    return {joint.name: before[joint.child] for joint in written.joints if joint.child in before}


def _places(facts: "Facts", positions: Mapping[str, Matrix]) -> dict[str, Matrix]:
    """Return the pose of each link in the frame of the base, shapes (POSES, 4, 4) [m]."""
    poses = body_poses(facts.bodies, positions)
    return {
        link.name: np.broadcast_to(pose @ local, (POSES, 4, 4))
        for body, pose in zip(facts.bodies, poses, strict=True)
        for link, local in zip(body.links, body.poses, strict=True)
    }


def _followed(model: Any, wanted: Expected) -> dict[str, Matrix]:
    """Return the poses of those links that MuJoCo has as bodies or sites, as `_places` does."""
    import mujoco

    draws, links = wanted.draws, wanted.places
    data = mujoco.MjData(model)
    body, site = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_SITE
    # The URDF reader makes the base a part of the world, at its origin.
    root = max(mujoco.mj_name2id(model, body, wanted.base), 0)
    bodies = {name: mujoco.mj_name2id(model, body, name) for name in links}
    sites = {name: mujoco.mj_name2id(model, site, name) for name in links}
    bodies = {name: index for name, index in bodies.items() if index > 0}
    sites = {n: index for n, index in sites.items() if index >= 0 and n not in bodies}
    here, there = list(bodies.values()), list(sites.values())
    address = [int(model.joint(name).qposadr[0]) for name in draws]
    positions = np.array(list(draws.values())).reshape(len(draws), POSES).T
    poses = np.tile(np.eye(4), (POSES, len(bodies) + len(sites), 1, 1))
    for pose, q in zip(poses, positions, strict=True):
        data.qpos[address] = q
        mujoco.mj_kinematics(model, data)
        turn = data.xmat[root].reshape(3, 3)
        places = np.concatenate([data.xpos[here], data.site_xpos[there]])
        turns = np.concatenate([data.xmat[here], data.site_xmat[there]]).reshape(-1, 3, 3)
        pose[:, :3, 3] = (places - data.xpos[root]) @ turn
        pose[:, :3, :3] = turn.T @ turns
    return {name: poses[:, index] for index, name in enumerate([*bodies, *sites])}


def _carried(model: Any, draws: Mapping[str, Matrix]) -> dict[str, float]:
    """Return the inertia that each joint carries in MuJoCo, all joints at 0, without armature."""
    import mujoco

    data = mujoco.MjData(model)
    dofs = {name: int(model.joint(name).dofadr[0]) for name in draws}
    for name in draws:
        data.qpos[int(model.joint(name).qposadr[0])] = 0.0
    mujoco.mj_fwdPosition(model, data)
    row, found = np.zeros(model.nv), {}
    for name, dof in dofs.items():
        mujoco.mj_mulM(model, data, row, np.eye(model.nv)[dof])
        found[name] = float(row[dof] - model.dof_armature[dof])
    return found


def _compared(file: str, model: Any, wanted: Expected) -> Agreement:
    there, here = wanted.places, _followed(model, wanted)
    shares = {
        name: abs(inertia / wanted.carried[name] - 1)
        for name, inertia in _carried(model, wanted.draws).items()
        if name in wanted.carried
    }
    apart = {
        name: float(np.linalg.norm(there[name][:, :3, 3] - pose[:, :3, 3], axis=1).max())
        for name, pose in here.items()
    }
    angles = {name: _angle(there[name], pose) for name, pose in here.items()}
    farthest, turned, joint = (
        max(d, key=d.__getitem__, default="") for d in (apart, angles, shares)
    )
    mass = float(model.body_mass.sum())
    return Agreement(
        file=file,
        mass=mass / wanted.mass - 1 if wanted.mass else mass,
        inertia=shares.get(joint, 0.0),
        joint=joint,
        distance=apart.get(farthest, 0.0),
        link=farthest,
        angle=angles.get(turned, 0.0),
        turned=turned,
    )


def _angle(one: Matrix, other: Matrix) -> float:
    """Return the largest angle between rotations, which are close, shapes (..., 4, 4) [rad]."""
    apart = np.swapaxes(one[..., :3, :3], -1, -2) @ other[..., :3, :3]
    # Of a small angle the sine is exact where the cosine is all rounding.
    sine = np.linalg.norm(apart - np.swapaxes(apart, -1, -2), axis=(-2, -1)) / math.sqrt(8)
    cosine = (np.trace(apart, axis1=-2, axis2=-1) - 1) / 2
    return float(np.arctan2(sine, cosine).max())
