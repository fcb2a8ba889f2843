"""Facts that follow from a robot description, each computed on first use."""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property, wraps
from typing import TYPE_CHECKING, TypeVar

from terrainkit_robots.analysis.bodies.base_joints import (
    find_base_joints,
    moves_freely,
    moves_in_plane,
)
from terrainkit_robots.analysis.bodies.bodies import Body, merge_bodies, physical_parent
from terrainkit_robots.analysis.bodies.bounds import BodyBounds
from terrainkit_robots.analysis.bodies.overlap import OverlapScene
from terrainkit_robots.analysis.bodies.tree import Tree, build_tree
from terrainkit_robots.analysis.bodies.world_base import with_free_base, with_world_base
from terrainkit_robots.analysis.inertia.inertia_repair import InertiaRepair
from terrainkit_robots.analysis.legs.closed_loops import BodyLoop, body_loops
from terrainkit_robots.analysis.legs.default_pose import default_positions
from terrainkit_robots.analysis.legs.legs import Leg, detect_legs
from terrainkit_robots.analysis.legs.limbs import Limb, detect_limbs
from terrainkit_robots.analysis.legs.passive_joints import passive_joints
from terrainkit_robots.analysis.legs.stance import Stance, compute_stance
from terrainkit_robots.analysis.legs.wheels import is_balanced
from terrainkit_robots.analysis.meshes.uses import UsedMesh, is_missing, used_meshes
from terrainkit_robots.analysis.simulator_conventions.joint_order import (
    SimulatorOrder,
    simulator_orders,
)
from terrainkit_robots.analysis.symmetry.asymmetry import Misalignment, find_misalignments
from terrainkit_robots.analysis.symmetry.copies import copied_pairs
from terrainkit_robots.analysis.symmetry.mirror import Mirror, detect_mirror
from terrainkit_robots.analysis.symmetry.mirror_map import mirror_map
from terrainkit_robots.analysis.symmetry.mirror_pairs import MirrorPair, mirror_pairs
from terrainkit_robots.description.model import Joint, Link, RobotModel
from terrainkit_robots.description.xml.unparsed import UnparsedNumbers
from terrainkit_robots.mesh.mesh_cache import Meshes

if TYPE_CHECKING:
    from terrainkit_robots.spec.robot_spec import MirrorJoint, RobotSpec

_T = TypeVar("_T")


class Facts:
    """Derived quantities of a robot, each computed once.

    SI units, radians; each states its frame.
    """

    def __init__(
        self,
        model: RobotModel,
        meshes: Meshes | None = None,
        *,
        against: "Facts | None" = None,
        spec: "RobotSpec | None" = None,
        base_joints: tuple[Joint, ...] | None = None,
    ) -> None:
        self.against: Facts | None = against
        """Another description of the same robot that this one is compared with."""

        self.spec: RobotSpec | None = spec
        """The robot.toml of the robot."""

        self.meshes: Meshes = meshes or Meshes()
        """The mesh files. Each file is opened on first use, and only once."""

        if base_joints is None:
            base_joints = self._find_base_joints(model)
        self.base_joints: tuple[Joint, ...] = base_joints
        """Ordinary joints that a floating base is written as; they are no joints of the robot."""

        self.model: RobotModel = (
            replace(model, floating=True)
            if base_joints
            else with_world_base(model, build_tree(model))
        )
        """The description; the world is its base link if several parts are attached to it."""

    def _find_base_joints(self, model: RobotModel) -> tuple[Joint, ...]:
        """Return the ordinary joints of a floating base, if the robot stands on legs or is free."""
        found = find_base_joints(build_tree(model), model) if model.floating is None else ()
        if not found:
            return ()
        robot = Facts(model, self.meshes, base_joints=found)
        is_free = moves_freely(found)
        has_legs = bool(robot.legs) and (is_free or not moves_in_plane(robot.bodies))
        return found if has_legs or (is_free and model.actuators) else ()

    def with_model(self, model: RobotModel) -> "Facts":
        """Return the facts of a changed description, with the same base."""
        return Facts(model, self.meshes, spec=self.spec, base_joints=self.base_joints)

    def with_free_base(self) -> "Facts":
        """Return the facts of the robot without joints between the world and its first body."""
        base = next((name for name in self.tree.order if not self.tree.links[name].virtual), None)
        if base is None or base == self.tree.order[0]:
            return self
        return self.with_model(with_free_base(self.model, self.tree, base))

    @property
    def required_spec(self) -> "RobotSpec":
        """The robot.toml, for rules that only run with one."""
        assert self.spec is not None
        return self.spec

    # Bodies

    @cached_property
    def tree(self) -> Tree:
        """The tree of links, without the joints that do not fit into a tree."""
        tree = build_tree(self.model)
        if not self.base_joints:
            return tree
        base = self.base_joints[-1].child
        return build_tree(with_free_base(self.model, tree, base), base)

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """The rigid bodies: links merged across fixed joints. The trunk is first."""
        return merge_bodies(self.tree)

    @cached_property
    def body_of(self) -> Mapping[str, Body]:
        """The body of each link of the main tree, by name of the link."""
        return {link.name: body for body in self.bodies for link in body.links}

    @cached_property
    def body_of_joint(self) -> Mapping[str, Body]:
        """The body that each joint moves, by name of the joint."""
        return {body.joint.name: body for body in self.bodies if body.joint is not None}

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """Links of the main tree without virtual ones, each after its parent."""
        return tuple(link for b in self.bodies for link in b.links if not link.virtual)

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """Joints of the main tree with one degree of freedom, each after its parent."""
        return tuple(b.joint for b in self.bodies if b.joint is not None and b.joint.moves)

    @cached_property
    def actuated(self) -> tuple[Joint, ...]:
        """The actuated joints.

        In URDF these are the joints that are not passive. In MJCF these are the joints with an
        actuator, or all joints if the file has no actuators.
        """
        passive = self.passive_joints if self.model.kind != "mjcf" else {}
        return tuple(joint for joint in self._maybe_actuated if joint.name not in passive)

    @cached_property
    def passive_joints(self) -> Mapping[str, str]:
        """Why a joint has no motor, for the joints that are passive by design, by name."""
        return passive_joints(self.model, self.bodies, self.leg_bodies)

    @cached_property
    def _maybe_actuated(self) -> tuple[Joint, ...]:
        """The joints that may be actuated, from which the legs follow."""
        joints = tuple(joint for joint in self.joints if joint.mimic is None)
        names = {actuator.joint for actuator in self.model.actuators} - {""}
        return tuple(joint for joint in joints if joint.name in names) if names else joints

    @cached_property
    def actuated_hinges(self) -> tuple[Joint, ...]:
        """The actuated joints that turn."""
        return tuple(joint for joint in self.actuated if joint.kind != "prismatic")

    @cached_property
    def actuator_order(self) -> tuple[str, ...]:
        """Names of the joints in the order of their first actuators. Empty without actuators."""
        known = {joint.name for joint in self.joints}
        names = (actuator.joint for actuator in self.model.actuators)
        return tuple(dict.fromkeys(name for name in names if name in known))

    @cached_property
    def total_mass(self) -> float:
        """Sum of the declared masses [kg]. NaN if MuJoCo derives one of them from a mesh file."""
        masses = [link.inertial.mass for link in self.links if link.inertial is not None]
        if any(mass is not None and math.isnan(mass) for mass in masses):
            return math.nan
        return sum(body.mass for body in self.bodies)

    @cached_property
    def body_bounds(self) -> BodyBounds:
        """Bounding boxes of the bodies."""
        return BodyBounds(self.bodies, self.meshes)

    @cached_property
    def overlap_scene(self) -> OverlapScene:
        """The collision shapes, ready to be tested for overlaps."""
        return OverlapScene(self.bodies, self.meshes, self.model.excluded)

    @cached_property
    def inertia_repair(self) -> InertiaRepair:
        """The fixes of inertias."""
        return InertiaRepair(bodies=self.bodies, mirror=self.mirror, meshes=self.meshes)

    def physical_parent(self, body: Body) -> Body | None:
        """Return the nearest ancestor of a body that is not virtual."""
        return physical_parent(self.bodies, body)

    @cached_property
    def _parents(self) -> frozenset[int | None]:
        return frozenset(body.parent for body in self.bodies)

    def is_wheel(self, body: Body) -> bool:
        """Return whether a body is a wheel or a propeller."""
        is_end = body.index not in self._parents
        return (is_end and is_balanced(body)) or body.index in self.wheels

    @cached_property
    def wheels(self) -> frozenset[int]:
        """Indices of the bodies that are wheels at the end of legs."""
        return frozenset(leg.limb.chain[-1] for leg in self.legs if leg.limb.has_wheel)

    # Files

    @cached_property
    def unparsed(self) -> UnparsedNumbers:
        """The numbers that could not be read."""
        return UnparsedNumbers(self.model)

    @cached_property
    def mesh_names(self) -> list[UsedMesh]:
        """The meshes, one for each name in the file."""
        return used_meshes(self.model, self.meshes, lambda mesh: mesh.filename)

    @cached_property
    def mesh_files(self) -> list[UsedMesh]:
        """The meshes, one for each file, without the files that MSH001 reports."""
        by_path = used_meshes(self.model, self.meshes, lambda mesh: mesh.path)
        return [used for used in by_path if not is_missing(used)]

    # Legs

    @cached_property
    def loops(self) -> tuple[BodyLoop, ...]:
        """The closed loops of the bodies."""
        return body_loops(self.model.loops, self.bodies)

    @cached_property
    def limbs(self) -> tuple[Limb, ...]:
        """Chains from the trunk to each leaf with at least two actuated joints."""
        has_tendons = any(not actuator.joint for actuator in self.model.actuators)
        actuated = self.joints if has_tendons else self._maybe_actuated
        return detect_limbs(self, actuated)

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """The limbs that the robot stands on. Empty for an arm, a drone or a car.

        The user may name the feet. Those of the spec count if no legs are found without them.
        """
        legs = detect_legs(self.limbs, self.bodies, self.meshes, self.model.feet)
        if legs or self.spec is None or not self.spec.feet:
            return legs
        return detect_legs(self.limbs, self.bodies, self.meshes, self.spec.feet)

    @cached_property
    def leg_bodies(self) -> frozenset[int]:
        """Indices of the bodies of all legs, including bodies that several legs share."""
        return frozenset(index for leg in self.legs for index in leg.limb.chain)

    @cached_property
    def leg_joints(self) -> list[Joint]:
        """Joints that belong to exactly one leg, with those in its closed loops.

        A joint that legs share, such as a waist, is left out.
        """
        joints = [joint for leg in self.legs for joint in (*leg.joints, *leg.branches)]
        uses = Counter(joint.name for joint in joints)
        unshared = {joint.name for joint in self.robot_joints if uses[joint.name] == 1}
        return [joint for joint in joints if joint.name in unshared]

    @cached_property
    def robot_joints(self) -> list[Joint]:
        """The moving joints, except the joints that move the base of a planar model."""
        # Of several bodies on the world, each is a part of the robot.
        is_single = sum(body.parent == 0 for body in self.bodies) == 1
        base = {0} if is_single and self.bodies[0].virtual else set()
        found = []
        for body in self.bodies[1:]:
            if body.parent in base:
                if body.virtual:
                    base.add(body.index)
                continue
            if body.joint is not None and body.joint.moves:
                found.append(body.joint)
        return found

    @cached_property
    def stance(self) -> Stance | None:
        """The stance at `default_pose`. None without legs."""
        if not self.legs:
            return None
        return compute_stance(self, self.default_pose, total_mass=self.total_mass)

    @cached_property
    def default_pose(self) -> Mapping[str, float]:
        """Default joint positions [rad] or [m], by name.

        A position comes from the spec, the first keyframe, the solved standing pose, or is the
        value within the limits that is closest to zero, in this order.
        """
        return default_positions(self)

    # Symmetry

    @cached_property
    def mirror(self) -> Mirror:
        """The mirror plane, and the pairs of mirrored bodies."""
        return detect_mirror(self.legs, self.bodies)

    @cached_property
    def mirror_map(self) -> "Mapping[str, MirrorJoint]":
        """The mirrored joint of each actuated joint that has one, by name."""
        return mirror_map(self)

    @cached_property
    def mirror_pairs(self) -> tuple[MirrorPair, ...]:
        """The pairs of mirrored joints, parents first."""
        return mirror_pairs(self)

    @cached_property
    def copied_pairs(self) -> tuple[MirrorPair, ...]:
        """The pairs of joints of assemblies that are mounted twice, parents first."""
        return copied_pairs(self.mirror_pairs)

    @cached_property
    def uncopied_pairs(self) -> tuple[MirrorPair, ...]:
        """The pairs of mirrored joints outside copied assemblies, parents first."""
        copied = {pair.left.body.index for pair in self.copied_pairs}
        return tuple(p for p in self.mirror_pairs if p.left.body.index not in copied)

    @cached_property
    def misalignments(self) -> tuple[list[Misalignment], set[int]]:
        """The misaligned pairs of `uncopied_pairs`, and the indices of the displaced bodies."""
        tips = {leg.limb.chain[-1]: leg.limb.tip for leg in self.legs}
        return find_misalignments(self.mirror, self.uncopied_pairs, self.leg_bodies, tips)

    # Simulators

    @cached_property
    def fixed_joints(self) -> tuple[Joint, ...]:
        """Joints inside the bodies of a URDF: fixed joints and joints of unknown type.

        Empty for MJCF, whose bodies no simulator merges.
        """
        if self.model.kind == "mjcf":
            return ()
        parent_joint = self.tree.parent_joint
        return tuple(parent_joint[link.name] for body in self.bodies for link in body.links[1:])

    @cached_property
    def file_order(self) -> tuple[str, ...]:
        """Names of the joints in the order of the file."""
        known = set(self.joints)
        return tuple(joint.name for joint in self.model.joints if joint in known)

    @cached_property
    def simulator_orders(self) -> tuple[SimulatorOrder, ...]:
        """The order of joints and bodies in each simulator."""
        return simulator_orders(self)


def cached_fact(function: Callable[[Facts], _T]) -> Callable[[Facts], _T]:
    """Cache the result of a function in the facts that it takes, as a `cached_property` of them.

    For facts of the layers above `analysis`, which cannot be properties of `Facts`.
    """
    fact = cached_property(function)
    fact.__set_name__(Facts, f"{function.__module__}.{function.__qualname__}")

    @wraps(function)
    def cached(facts: Facts) -> _T:
        return fact.__get__(facts)

    return cached
