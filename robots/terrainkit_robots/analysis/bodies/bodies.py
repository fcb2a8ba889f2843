"""Merge links that fixed joints connect into rigid bodies, with their mass and shapes.

A placeholder link, such as the frame of a camera or an IMU of one gram, is thus judged as a part
of the body that it is fixed to.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from terrainkit_robots.analysis.bodies.kinematics import BodyFrame, body_poses
from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.analysis.inertia.merged_inertia import parallel_axis
from terrainkit_robots.analysis.inertia.physical import MAX_INERTIA
from terrainkit_robots.description.model import Geometry, Link
from terrainkit_robots.transforms import Matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyShape:
    """A shape in the frame of a body."""

    geometry: Geometry
    link: str
    """Name of the link that the shape belongs to."""

    pose: Matrix
    """Pose in the frame of the body, shape (4, 4) [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Body(BodyFrame):
    """Links that move as one. The frame of a body is the frame of its top link."""

    index: int
    """Index in the list of bodies."""

    zero_pose: Matrix
    """Pose in the frame of the trunk, all joints at 0, shape (4, 4) [m]."""

    links: tuple[Link, ...]
    """Its links, the top link first."""

    poses: tuple[Matrix, ...]
    """Pose of each link in the frame of the body, shape (4, 4) [m]."""

    @property
    def name(self) -> str:
        """Return the name of the link with the most mass."""
        return self.main_link.name

    @property
    def main_link(self) -> Link:
        """Return the link with the most mass."""
        return max(self.links, key=_mass)

    @property
    def top(self) -> Link:
        """Return the link directly below the joint."""
        return self.links[0]

    @property
    def virtual(self) -> bool:
        """Whether it only separates two joints of one MJCF body."""
        return all(link.virtual for link in self.links)

    @cached_property
    def mass(self) -> float:
        """Sum of the masses of its links [kg]. Missing and non-finite masses count as zero."""
        return sum(_mass(link) for link in self.links)

    @cached_property
    def center(self) -> Matrix:
        """Center of mass in the frame of the body, shape (3,) [m]. Zero for a massless body."""
        if self.mass <= 0:
            return np.zeros(3)
        weighted = [mass * pose[:3, 3] for _, mass, pose, _ in self.parts()]
        center: Matrix = np.sum(weighted, axis=0) / self.mass
        return center

    @property
    def zero_center(self) -> Matrix:
        """Return the center of mass in the frame of the trunk, all joints at 0, shape (3,) [m]."""
        return np.asarray(self.zero_pose[:3, :3] @ self.center + self.zero_pose[:3, 3])

    @cached_property
    def inertia(self) -> Matrix:
        """Inertia about the center of mass, in the axes of the body, shape (3, 3) [kg m2]."""
        total = np.zeros((3, 3))
        for _, mass, pose, inertia in self.parts():
            total += pose[:3, :3] @ inertia @ pose[:3, :3].T
            total += parallel_axis(mass, pose[:3, 3] - self.center)
        return total

    @cached_property
    def principal(self) -> Matrix:
        """Principal moments of inertia, ascending, shape (3,) [kg m2]."""
        principal: Matrix = np.linalg.eigvalsh(self.inertia).astype(np.float64)
        return principal

    @cached_property
    def collisions(self) -> tuple[BodyShape, ...]:
        """Its collision shapes."""
        return tuple(self._shapes("collisions"))

    @cached_property
    def visuals(self) -> tuple[BodyShape, ...]:
        """Its visual shapes."""
        return tuple(self._shapes("visuals"))

    @property
    def has_contacts(self) -> bool:
        """Whether one of its collision shapes can collide with anything."""
        return any(shape.geometry.contacts for shape in self.collisions)

    def parts(self) -> Iterator[tuple[Link, float, Matrix, Matrix]]:
        """Yield each link with mass: mass [kg], inertial frame [m] and inertia [kg m2]."""
        for link, pose in zip(self.links, self.poses, strict=True):
            if _mass(link):
                assert link.inertial is not None
                inertia = link.inertial.inertia
                if inertia is None or not (np.abs(inertia) < MAX_INERTIA).all():
                    inertia = np.zeros((3, 3))
                yield link, _mass(link), pose @ link.inertial.origin, inertia

    def _shapes(self, kind: str) -> Iterator[BodyShape]:
        for link, pose in zip(self.links, self.poses, strict=True):
            for geometry in getattr(link, kind):
                yield BodyShape(geometry=geometry, link=link.name, pose=pose @ geometry.origin)


def _mass(link: Link) -> float:
    mass = link.inertial.mass if link.inertial else None
    return mass if mass is not None and abs(mass) < MAX_INERTIA else 0.0


def merge_bodies(tree: Tree) -> tuple[Body, ...]:
    """Return the bodies of the main tree, the trunk first and each after its parent.

    A joint of unknown type counts as fixed. A floating, planar or ball joint inside the tree
    starts a new body that is held in place, because nothing actuates it.
    """
    if not tree.order:
        return ()
    root, joints = tree.links[tree.order[0]], tree.child_joints[tree.order[0]]
    is_empty = root.inertial is None and not root.collisions
    # An empty root above a floating joint is the world, not the base.
    has_world = is_empty and len(joints) == 1 and joints[0].kind == "floating"
    order = tree.order[1:] if has_world else tree.order
    index_of: dict[str, int] = {order[0]: 0}
    link_poses: list[dict[str, Matrix]] = [{order[0]: np.eye(4)}]
    body_frames = [BodyFrame(parent=None, joint=None, origin=np.eye(4))]
    for name in order[1:]:
        joint = tree.parent_joint[name]
        if joint.parent not in index_of:
            continue  # a sibling of the base below a world link
        parent = index_of[joint.parent]
        origin = link_poses[parent][joint.parent] @ joint.origin
        if joint.moves or joint.kind in ("floating", "planar", "ball"):
            index_of[name] = len(body_frames)
            body_frames.append(BodyFrame(parent=parent, joint=joint, origin=origin))
            link_poses.append({name: np.eye(4)})
        else:
            index_of[name] = parent
            link_poses[parent][name] = origin
    return tuple(
        Body(
            index=index,
            **vars(frame),
            zero_pose=zero_pose,
            links=tuple(tree.links[name] for name in poses),
            poses=tuple(poses.values()),
        )
        for index, (frame, zero_pose, poses) in enumerate(
            zip(body_frames, body_poses(body_frames, {}), link_poses, strict=True)
        )
    )


def physical_parent(bodies: Sequence[Body], body: Body) -> Body | None:
    """Return the nearest ancestor of a body that is not virtual. None for the trunk."""
    parent = body.parent
    while parent is not None and bodies[parent].virtual:
        parent = bodies[parent].parent
    return None if parent is None else bodies[parent]


def center_of_mass(bodies: Sequence[Body], poses: Sequence[Matrix]) -> Matrix:
    """Return the common center of mass of bodies.

    Args:
        bodies: The bodies.
        poses: Pose of each body in one frame, each of shape (4, 4) [m].

    Returns:
        Center of mass in this frame [m], shape (3,). Without mass, the origin of the first body.
    """
    total = sum(body.mass for body in bodies)
    if total <= 0:
        return poses[0][:3, 3]
    centers = [pose[:3, :3] @ b.center + pose[:3, 3] for b, pose in zip(bodies, poses, strict=True)]
    return np.asarray(
        sum((b.mass * c for b, c in zip(bodies, centers, strict=True)), np.zeros(3)) / total
    )


def subtree_of(bodies: Sequence[Body], index: int) -> set[int]:
    """Return the indices of a body and its descendants."""
    found = {index}
    for body in bodies[index + 1 :]:  # parents come first
        if body.parent in found:
            found.add(body.index)
    return found
