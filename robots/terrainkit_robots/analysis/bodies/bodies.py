"""Bodies: links that fixed joints hold together, as one, with their mass and shapes.

Placeholder links (a camera's frame, an IMU of one gram) are judged as what they are: a part of the
body that they are fixed to.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from terrainkit_robots.analysis.bodies.tree import Tree
from terrainkit_robots.analysis.inertia.physical import LARGEST
from terrainkit_robots.description.model import Geometry, Inertial, Joint, Link
from terrainkit_robots.transforms import Matrix


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A shape in the frame of a body."""

    geometry: Geometry
    link: str
    """The link it is on."""

    pose: Matrix
    """Its pose in the body's frame, shape (4, 4) [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """Links that move as one. Its frame is that of its top link."""

    index: int
    """Place in the list of bodies; a parent comes before its children."""

    parent: int | None
    """Index of the parent; None for the trunk."""

    joint: Joint | None
    """The joint that moves it, of whatever kind; None for the trunk."""

    mount: Matrix
    """Frame of the joint's child at its reference in the parent body's, shape (4, 4) [m]."""

    links: tuple[Link, ...]
    """Its links, the top one first."""

    poses: tuple[Matrix, ...]
    """Pose of each link in the body's frame, shape (4, 4) [m]."""

    @property
    def name(self) -> str:
        """Return the name of the link that stands for it: the one with the most mass."""
        return max(self.links, key=_mass_of).name

    @property
    def top(self) -> Link:
        """Return the link right below the joint."""
        return self.links[0]

    @property
    def virtual(self) -> bool:
        """Whether it only stands between two joints of one MJCF body."""
        return all(link.virtual for link in self.links)

    @cached_property
    def mass(self) -> float:
        """Sum of the masses of its links [kg]; what is missing or not finite counts as none."""
        return sum(_mass_of(link) for link in self.links)

    @cached_property
    def center(self) -> Matrix:
        """Centre of mass in the body's frame, shape (3,) [m]; the origin where there is no mass."""
        if self.mass <= 0:
            return np.zeros(3)
        weighted = [mass * pose[:3, 3] for mass, pose, _ in self._parts()]
        center: Matrix = np.sum(weighted, axis=0) / self.mass
        return center

    @cached_property
    def inertia(self) -> Matrix:
        """Inertia about the centre of mass, axes of the body's frame, shape (3, 3) [kg m2]."""
        total = np.zeros((3, 3))
        for mass, pose, inertia in self._parts():
            arm = pose[:3, 3] - self.center
            total += pose[:3, :3] @ inertia @ pose[:3, :3].T
            total += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))  # parallel axes
        return total

    @cached_property
    def principal(self) -> Matrix:
        """Principal moments of inertia, ascending, shape (3,) [kg m2]."""
        principal: Matrix = np.linalg.eigvalsh(self.inertia).astype(np.float64)
        return principal

    @cached_property
    def collisions(self) -> tuple[Placed, ...]:
        """Its collision shapes."""
        return tuple(self._placed("collisions"))

    @cached_property
    def visuals(self) -> tuple[Placed, ...]:
        """Its visual shapes."""
        return tuple(self._placed("visuals"))

    def _parts(self) -> Iterator[tuple[float, Matrix, Matrix]]:
        """Yield mass, pose of the frame of inertia, and inertia in it, of each link with mass."""
        for link, pose in zip(self.links, self.poses, strict=True):
            if _mass_of(link):
                assert link.inertial is not None
                yield _mass_of(link), pose @ link.inertial.origin, _inertia_of(link.inertial)

    def _placed(self, kind: str) -> Iterator[Placed]:
        for link, pose in zip(self.links, self.poses, strict=True):
            for geometry in getattr(link, kind):
                yield Placed(geometry=geometry, link=link.name, pose=pose @ geometry.origin)


def _mass_of(link: Link) -> float:
    mass = link.inertial.mass if link.inertial else None
    return mass if mass is not None and abs(mass) < LARGEST else 0.0


def _inertia_of(inertial: Inertial) -> Matrix:
    inertia = inertial.inertia
    sound = inertia is not None and (np.abs(inertia) < LARGEST).all()
    return inertia if inertia is not None and sound else np.zeros((3, 3))


def merge_bodies(tree: Tree) -> tuple[Body, ...]:
    """Return the bodies of the main tree, the trunk first and each after its parent.

    A joint of a type that is not known is taken as fixed. A floating, planar or ball joint inside
    the tree starts a body that is held as if it were fixed, since nothing drives it.
    """
    if not tree.order:
        return ()
    order = tree.order[_first_link(tree) :]
    home: dict[str, int] = {order[0]: 0}
    frames: list[dict[str, Matrix]] = [{order[0]: np.eye(4)}]
    made: list[tuple[int | None, Joint | None, Matrix]] = [(None, None, np.eye(4))]
    for name in order[1:]:
        joint = tree.above[name]
        if joint.parent not in home:
            continue  # beside the base, under a world link
        parent = home[joint.parent]
        mount = frames[parent][joint.parent] @ joint.origin
        if joint.moves or joint.kind in ("floating", "planar", "ball"):
            home[name] = len(made)
            made.append((parent, joint, mount))
            frames.append({name: np.eye(4)})
        else:
            home[name] = parent
            frames[parent][name] = mount
    return tuple(
        Body(
            index=index,
            parent=parent,
            joint=joint,
            mount=mount,
            links=tuple(tree.links[name] for name in frames[index]),
            poses=tuple(frames[index].values()),
        )
        for index, (parent, joint, mount) in enumerate(made)
    )


def _first_link(tree: Tree) -> int:
    """Return the place of the base in the order: below a floating joint, if the root has one."""
    root = tree.links[tree.order[0]]
    joints = tree.below[root.name]
    empty = root.inertial is None and not root.collisions
    if empty and len(joints) == 1 and joints[0].kind == "floating":
        return 1
    return 0
