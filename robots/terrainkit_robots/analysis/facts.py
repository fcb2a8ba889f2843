"""Facts: what follows from a robot's description, each worked out when it is first asked for."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING

from terrainkit_robots.analysis.bodies.bodies import Body, merge_bodies
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.bodies.overlap import OverlapScene
from terrainkit_robots.analysis.bodies.tree import Tree, build_tree
from terrainkit_robots.analysis.legs.default_pose import starting_positions
from terrainkit_robots.analysis.legs.legs import Leg, find_legs
from terrainkit_robots.analysis.legs.limbs import Limb, find_limbs
from terrainkit_robots.analysis.legs.stance import Stance, stand
from terrainkit_robots.analysis.symmetry.mirror import Mirror, find_mirror
from terrainkit_robots.description.model import Joint, Link, RobotModel
from terrainkit_robots.mesh.mesh_cache import Meshes
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    from terrainkit_robots.spec.robot_spec import RobotSpec


class Facts:
    """A robot's facts. Units are SI and radians; the trunk's frame is the robot's."""

    def __init__(
        self,
        model: RobotModel,
        meshes: Meshes | None = None,
        *,
        against: "Facts | None" = None,
        spec: "RobotSpec | None" = None,
    ) -> None:
        self.model: RobotModel = model
        """The description."""

        self.against: Facts | None = against
        """Another description of the same robot, to be compared with this one."""

        self.spec: RobotSpec | None = spec
        """What is known of the robot beyond its description: its robot.toml."""

        self.meshes: Meshes = meshes or Meshes()
        """Its mesh files; each is opened when something asks for it, and then once."""

    @cached_property
    def tree(self) -> Tree:
        """The tree of links, made sound where the file is not."""
        return build_tree(self.model)

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Links that fixed joints hold together, as one; the trunk first."""
        return merge_bodies(self.tree)

    @cached_property
    def body_of(self) -> Mapping[str, Body]:
        """The body that each link of the main tree is a part of, by the link's name."""
        return {link.name: body for body in self.bodies for link in body.links}

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """Links of the main tree, each after its parent; virtual ones are left out."""
        return tuple(link for b in self.bodies for link in b.links if not link.virtual)

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """The joints of the main tree with one degree of freedom, parents first."""
        return tuple(b.joint for b in self.bodies if b.joint is not None and b.joint.moves)

    @cached_property
    def actuated(self) -> tuple[Joint, ...]:
        """The joints that a motor drives.

        In URDF those that mimic no other; in MJCF those with an actuator, or all without any.
        """
        joints = tuple(joint for joint in self.joints if joint.mimic is None)
        driven = {actuator.joint for actuator in self.model.actuators} - {""}
        return tuple(j for j in joints if j.name in driven) if driven else joints

    @cached_property
    def total_mass(self) -> float:
        """Sum of the declared masses [kg]; NaN where MuJoCo takes one from a mesh file."""
        masses = [link.inertial.mass for link in self.links if link.inertial is not None]
        if any(mass is not None and math.isnan(mass) for mass in masses):
            return math.nan
        return sum(body.mass for body in self.bodies)

    @cached_property
    def at_zero(self) -> tuple[Matrix, ...]:
        """Pose of each body in the trunk's frame with all joints at 0, shape (4, 4) each [m]."""
        return tuple(body_poses(self.bodies, {}))

    @cached_property
    def limbs(self) -> tuple[Limb, ...]:
        """Chains from the trunk to each leaf with at least two actuated joints."""
        return find_limbs(self)

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """The limbs that the robot stands on; empty for an arm, a drone or a car."""
        return find_legs(self)

    @cached_property
    def leg_bodies(self) -> frozenset[int]:
        """Indices of the bodies of all legs, those that carry several of them included."""
        return frozenset(index for leg in self.legs for index in leg.limb.chain)

    def carrier_of(self, body: Body) -> Body | None:
        """Return the body that carries another, past those that only stand between two joints."""
        at = body.parent
        while at is not None and self.bodies[at].virtual:
            at = self.bodies[at].parent
        return None if at is None else self.bodies[at]

    @cached_property
    def mirror(self) -> Mirror:
        """Which bodies and joints are mirror images of which."""
        return find_mirror(self)

    @cached_property
    def stance(self) -> Stance | None:
        """How it stands: at the pose of its spec, of its first keyframe, or as the search finds.

        None without legs.
        """
        return stand(self, starting_positions(self)) if self.legs else None

    @cached_property
    def positions(self) -> Mapping[str, float]:
        """Joint positions that the robot starts from [rad] or [m], by name.

        Those of its stance, of its spec, of its first keyframe, or the closest to zero that the
        limits allow.
        """
        return starting_positions(self) if self.stance is None else self.stance.positions

    @cached_property
    def overlaps(self) -> OverlapScene:
        """The collision shapes, ready to be asked which are inside each other."""
        return OverlapScene(self)
