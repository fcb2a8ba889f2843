"""Create the sites of the feet and the IMU."""

from collections.abc import Sequence

import numpy as np

from terrainkit_robots.analysis.bodies.bodies import Body, BodyShape
from terrainkit_robots.analysis.bodies.contact import MAX_SOLE_DEPTH
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.shapes import bounds, has_bounds, min_height
from terrainkit_robots.analysis.facts import Facts
from terrainkit_robots.analysis.legs.legs import Leg
from terrainkit_robots.export.mjcf import Site
from terrainkit_robots.transforms import Matrix, invert_poses

_MARGIN = 0.002
"""Margin by which a foot site exceeds its geometry on each side, so that it contains contacts [m].
"""


def foot_sites(facts: Facts, feet: Sequence[str] = ()) -> tuple[Site, ...]:
    """Return a site for each leg that encloses the geometry in contact with the ground.

    Args:
        facts: The robot.
        feet: Names of the feet, links that are fixed to them; empty to use the detected feet.
    """
    poses = body_poses(facts.bodies, facts.default_pose)
    foot_names = {facts.body_of[name].index: name for name in feet}
    return tuple(
        _foot_site(leg, foot_names.get(leg.limb.chain[-1], leg.foot), facts, poses)
        for leg in facts.legs
    )


def _foot_site(leg: Leg, foot: str, facts: Facts, poses: Sequence[Matrix]) -> Site:
    body = facts.bodies[leg.limb.chain[-1]]
    local = pose_in_body(body, foot)
    box = bounds(_ground_contacts(body, poses[body.index], facts), facts.meshes)
    if box is None:
        return Site(name=foot, body=foot, pose=np.eye(4))
    center = np.eye(4)
    center[:3, 3] = box.mean(axis=0)
    # MuJoCo's touch sensors count contacts inside of the site only.
    half = np.ptp(box, axis=0) / 2 + _MARGIN
    pose = invert_poses(local) @ center
    return Site(name=foot, body=foot, pose=pose, half_size=tuple(half.tolist()))


def _ground_contacts(body: Body, pose: Matrix, facts: Facts) -> list[BodyShape]:
    """Return the lowest collision geometry of a body."""
    shapes = [s for s in body.collisions if has_bounds(s.geometry, facts.meshes)]
    depths = [min_height(shape, pose, facts.meshes) for shape in shapes]
    return [
        s for s, depth in zip(shapes, depths, strict=True) if depth <= min(depths) + MAX_SOLE_DEPTH
    ]


def imu_site(facts: Facts) -> Site:
    """Return the site of the IMU: as defined in the file, or at a link of the base named imu.

    Otherwise it is at the origin of the base, and `imu_changes` says so.
    """
    body, pose = _imu(facts) or (_base(facts), np.eye(4))
    return Site(name="imu", body=body.top.name, pose=pose)


def imu_changes(facts: Facts) -> tuple[str, ...]:
    """Return the change if a robot with a free base does not define its IMU."""
    if _imu(facts) is not None or facts.model.floating is False:
        return ()
    base = _base(facts).top.name
    return (f"placed the IMU at the origin of {base}: no sensor, site or link defines it",)


def _imu(facts: Facts) -> tuple[Body, Matrix] | None:
    """Return the body of the IMU and the pose in its frame; None if it is not defined."""
    imu = facts.model.imu
    if imu is not None and imu[0] in facts.body_of:
        body = facts.body_of[imu[0]]
        return body, pose_in_body(body, imu[0]) @ imu[1]
    base = _base(facts)
    for link, pose in zip(base.links, base.poses, strict=True):
        if "imu" in link.name.lower():
            return base, pose
    return None


def _base(facts: Facts) -> Body:
    return next((body for body in facts.bodies if not body.virtual), facts.bodies[0])


def pose_in_body(body: Body, link: str) -> Matrix:
    """Return the pose of a link in the frame of its body."""
    names = [part.name for part in body.links]
    return body.poses[names.index(link)]
