"""Read the robot of an MJCF document.

MuJoCo's parser resolves defaults and replicas, and its compiler frames, units and the inertia of
geoms. Written values that the compiler does not need, or rejects, are read from the parsed spec.
Masses that depend on a mesh that MuJoCo does not compile are NaN.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from terrainkit_robots.description.mjcf.actuators import (
    force_limit,
    position_gains,
    read_actuators,
)
from terrainkit_robots.description.mjcf.compiled_bodies import CompiledBodies, is_explicit
from terrainkit_robots.description.mjcf.constraints import (
    GEOM_SETTINGS,
    JOINT_SETTINGS,
    Constraints,
    settings_of,
)
from terrainkit_robots.description.mjcf.imu import find_imu
from terrainkit_robots.description.mjcf.inertia import (
    apply_minimums,
    geom_inertial,
    scale_to_total_mass,
)
from terrainkit_robots.description.mjcf.parser import parse_mjcf
from terrainkit_robots.description.mjcf.references import dangling_references
from terrainkit_robots.description.mjcf.shapes import (
    SIZES,
    color_of,
    mesh_file,
    mesh_geometry,
    mesh_name,
    shape_kind,
)
from terrainkit_robots.description.mjcf.tree import MjcfTree, Node, read_tree
from terrainkit_robots.description.model import (
    WORLD,
    Actuator,
    Dynamics,
    Geometry,
    Inertial,
    Joint,
    Limit,
    Link,
    PhysicsOptions,
    RobotModel,
    Source,
)
from terrainkit_robots.description.xml.document import XmlDocument
from terrainkit_robots.description.xml.numbers import is_in_degrees, parse_numbers
from terrainkit_robots.text import UniqueNames, count, names


def read_mjcf(doc: XmlDocument, *, contents: Mapping[Path, bytes] | None = None) -> RobotModel:
    """Return the robot of a document whose root is <mujoco>.

    Args:
        doc: The XML document.
        contents: File contents by path, which are used instead of included files on disk.
    """
    mjcf = read_tree(doc, contents or {})
    spec, lines = parse_mjcf(mjcf)
    model = RobotModel(
        name=mjcf.root.written.get("model", "").strip(),
        kind="mjcf",
        file=doc.file,
        source=mjcf.root.source,
        sources=tuple(mjcf.sources),
    )
    if spec is not None:
        model = _SpecReader(mjcf, spec, lines, contents or {}).fill(model)
    return replace(model, problems=tuple(mjcf.problems))


class _SpecReader:
    """Convert a parsed MuJoCo spec to links and joints, and collect problems."""

    def __init__(
        self,
        mjcf: MjcfTree,
        spec: mujoco.MjSpec,
        lines: Sequence[Node],
        contents: Mapping[Path, bytes],
    ) -> None:
        self._mjcf, self._contents = mjcf, contents
        self._spec = spec
        self._lines = lines
        self._meshes = {mesh_name(mesh): mesh for mesh in spec.meshes}
        self._materials = {material.name: material for material in spec.materials}
        self._paired = {name for p in spec.pairs for name in (p.geomname1, p.geomname2)} - {""}
        # Contype of geoms that collide only through a <pair>: the lowest bit that collides with no
        # geom of the robot. If it is the first one, they stand on a floor with the default bits.
        taken = {k for k in range(31) for geom in spec.geoms if geom.conaffinity >> k & 1}
        self._paired_bit = 1 << min({*range(31)} - taken, default=30)
        self._bodies = UniqueNames(body.name for body in spec.bodies)
        self._joints = UniqueNames(joint.name for joint in spec.joints)
        new_body = mujoco.MjSpec().worldbody.add_body()
        self._new_joint, self._new_geom = new_body.add_joint(), new_body.add_geom()
        self._links = {spec.worldbody: WORLD}
        self._reported: set[str] = set()

    def fill(self, model: RobotModel) -> RobotModel:
        """Return the model with the contents of the spec; without links if MuJoCo rejects it."""
        imu = find_imu(self._spec)
        try:
            self._compiled = CompiledBodies(self._spec, self._node, self._report, self._contents)
        except (ValueError, RuntimeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
            reason, _, location = str(error).removeprefix("Error: ").partition("\n")
            message = f"MuJoCo rejects the file: {reason}; the robot is not checked"
            self._report(self._node_of_line(location), message)
            return model
        scales = {j.name: self._compiled.joint_scale(j) for j in self._spec.joints if j.name}
        self._actuators = tuple(read_actuators(self._spec, self._node, scales))
        links, joints = self._read_bodies()
        efforts = {joint.name: joint.effort for joint in joints}
        constraints = Constraints(self._spec, self._node, self._links, self._compiled)
        joints = [
            replace(
                joint,
                mimic=constraints.mimics.get(joint.name),
                coupled=joint.name in constraints.coupled,
            )
            for joint in joints
        ]
        compiler = self._spec.compiler
        bounds = float(compiler.boundmass), float(compiler.boundinertia)
        links = [replace(link, inertial=apply_minimums(link, *bounds)) for link in links]
        dangling_references(self._mjcf, self._spec)
        if not compiler.degree:
            self._check_euler_angles()
        return replace(
            model,
            links=scale_to_total_mass(links, float(compiler.settotalmass)),
            joints=tuple(joints),
            actuators=tuple(_within_limit(a, efforts.get(a.joint)) for a in self._actuators),
            options=self._options(),
            keyframe=self._keyframe_positions(joints),
            imu=imu and (self._links[imu.parent], self._compiled.shape_pose(imu)),
            excluded=frozenset(
                frozenset((pair.bodyname1, pair.bodyname2))
                for pair in self._spec.excludes
                if pair.bodyname1 != pair.bodyname2
            ),
            loops=tuple(constraints.loops),
            couplings=tuple(constraints.couplings),
            tendons=tuple(constraints.tendons),
            left_out=(
                *constraints.left_out,
                *self._left_keyframes(),
                *(f"{count(n, 'element')} of <{tag}>" for tag, n in self._mjcf.unread.items()),
            ),
        )

    def _check_euler_angles(self) -> None:
        for node in self._mjcf.nodes():
            text = node.attributes.get("euler", "")
            angles = parse_numbers(text, 3) if text else None
            if angles is not None and is_in_degrees(angles.tolist()):
                message = f"euler of <{node.tag}>: got {text} rad; expected radians"
                self._mjcf.add_problem(node, "XML018", message)

    def _options(self) -> PhysicsOptions:
        option = self._spec.option
        nodes = [node for node in self._mjcf.nodes() if node.tag == "option"]
        names = ("contact", "constraint", "limit", "actuation", "gravity", "equality")
        x, y, z = map(float, option.gravity)
        return PhysicsOptions(
            source=nodes[-1].source if nodes else self._mjcf.root.source,
            gravity=(x, y, z),
            timestep=float(option.timestep),
            disabled=frozenset(
                name
                for name in names
                if option.disableflags & getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}")
            ),
            degrees=bool(self._spec.compiler.degree),
        )

    def _node(self, element: Any, default: Node | None = None) -> Node:
        """Return the node of a MuJoCo element, which stores its line."""
        return self._node_of_line(element.info, default)

    def _node_of_line(self, text: str, default: Node | None = None) -> Node:
        """Return the node of the line in a text that ends with `line N`."""
        match = re.search(r"\bline (\d+)$", text)
        line = int(match[1]) if match else 0
        if 1 <= line <= len(self._lines):
            return self._lines[line - 1]
        return default or self._mjcf.root

    def _report(self, node: Node, message: str) -> None:
        """Report what MuJoCo's compiler would reject, each message once."""
        if message not in self._reported:
            self._reported.add(message)
            self._mjcf.add_problem(node, "XML011", message)

    # Bodies

    def _read_bodies(self) -> tuple[list[Link], list[Joint]]:
        links: list[Link] = []
        joints: list[Joint] = []
        stack = list(reversed(self._spec.worldbody.bodies))
        while stack:
            body = stack.pop()
            node = self._node(body)
            name = body.name or self._bodies.add(node.default_name or "unnamed_body")
            self._links[body] = name
            virtual_links, body_joints = self._read_joints(body, node, name)
            links += [*virtual_links, self._link(body, node, name)]
            joints += body_joints
            stack += reversed(body.bodies)
        return links, joints

    def _link(self, body: Any, node: Node, name: str) -> Link:
        collisions: list[Geometry] = []
        visuals: list[Geometry] = []
        for geom in body.geoms:
            drawn = not (geom.contype or geom.conaffinity or geom.name in self._paired)
            shapes = visuals if drawn else collisions
            shapes.append(self._geometry(geom, self._node(geom, node)))
        return Link(
            name=name,
            source=node.source,
            inertial=self._inertial(body, node),
            gravity_compensation=float(body.gravcomp),
            collisions=tuple(collisions),
            visuals=tuple(visuals),
        )

    def _inertial(self, body: Any, node: Node) -> Inertial | None:
        compiled = self._compiled.inertial(body)
        if not is_explicit(body):
            if body.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE:
                return None
            return geom_inertial(node.source, compiled, self._compiled.missing_masses(body))
        written = next((element for element in node.elements() if element.tag == "inertial"), node)
        mass_scale, origin, moments = compiled
        inertia = None
        if not math.isnan(body.fullinertia[0]):
            xx, yy, zz, xy, xz, yz = body.fullinertia
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        elif "diaginertia" in written.attributes:
            inertia = np.diag(body.inertia)
        return Inertial(
            source=written.source,
            mass=None if math.isnan(body.mass) else float(body.mass) * mass_scale,
            origin=origin,
            inertia=None if inertia is None else inertia * moments[0],
            attribute=_first(written, ("fullinertia", "diaginertia")),
            axes_attribute=_first(written, ("quat", "axisangle", "xyaxes", "zaxis", "euler")),
        )

    # Shapes

    def _geometry(self, geom: Any, node: Node) -> Geometry:
        shape = shape_kind(geom)
        fitted = bool(geom.meshname) and shape in SIZES
        size = self._compiled.shape_size(geom)
        contype, conaffinity = self._bits(geom)
        geometry = Geometry(
            source=node.source,
            shape="unknown" if shape == "mesh" or fitted else shape,
            name=geom.name,
            size=() if fitted else tuple(map(float, size[: SIZES.get(shape, 0)])),
            origin=self._compiled.shape_pose(geom),
            contype=contype,
            conaffinity=conaffinity,
            color=color_of(geom, self._materials),
            friction=float(geom.friction[0]),
            priority=int(geom.priority),
            condim=int(geom.condim),
            settings=settings_of(geom, self._new_geom, GEOM_SETTINGS),
            fit_to_mesh=fitted,
        )
        mesh = self._meshes.get(geom.meshname) if shape == "mesh" or fitted else None
        file = mesh and mesh_file(mesh, self._node(mesh), bool(self._spec.strippath))
        if file is None:
            return geometry
        return mesh_geometry(geometry, mesh, file, self._compiled.mesh_scale(geom))

    def _bits(self, geom: Any) -> tuple[int, int]:
        """Return contype and conaffinity."""
        if self._spec.option.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
            return 0, 0
        if geom.name in self._paired and not (geom.contype or geom.conaffinity):
            return self._paired_bit, 0
        return int(geom.contype), int(geom.conaffinity)

    # Joints

    def _read_joints(self, body: Any, node: Node, name: str) -> tuple[list[Link], list[Joint]]:
        """Return the joints of a body, and virtual links between them if there are several."""
        links: list[Link] = []
        joints: list[Joint] = []
        parent, origin = self._links[body.parent], self._compiled.body_pose(body)
        own_joints = self._own_joints(body, node, name)
        for k, joint in enumerate(own_joints, 1):
            child = name if k == len(own_joints) else self._bodies.add(f"{name}:{joint.name}")
            if child != name:
                links.append(Link(name=child, source=joint.source, virtual=True))
            joints.append(replace(joint, parent=parent, child=child, origin=origin))
            parent, origin = child, np.eye(4)
        return links, joints

    def _own_joints(self, body: Any, node: Node, name: str) -> list[Joint]:
        """Return the joints of a body without their links, a fixed joint if it has none."""
        if not len(body.joints):
            fixed = self._joints.add(f"{name}_fixed")
            return [Joint(name=fixed, source=node.source, kind="fixed", parent="", child="")]
        return [
            self._joint(
                joint, self._node(joint, node), joint.name or self._joints.add(f"{name}_joint")
            )
            for joint in body.joints
        ]

    def _joint(self, joint: Any, node: Node, name: str) -> Joint:
        """Return a joint without its parent and child."""
        kinds = mujoco.mjtJoint
        frame, scale = self._compiled.body_pose(joint), self._compiled.joint_scale(joint)
        bare = Joint(
            name=name,
            source=node.source,
            kind="ball",
            parent="",
            child="",
            stiffness=float(np.ravel(joint.stiffness)[0]) * scale.armature,
            dynamics=Dynamics(
                source=node.source,
                damping=float(np.ravel(joint.damping)[0]) * scale.armature,
                friction=float(joint.frictionloss) * scale.force,
            ),
        )
        if joint.type == kinds.mjJNT_FREE:
            return replace(bare, kind="floating")
        if joint.type == kinds.mjJNT_BALL:
            return replace(bare, anchor=frame[:3, 3])
        slides = joint.type == kinds.mjJNT_SLIDE
        unit = scale.position if slides else math.pi / 180 if joint.compiler.degree else 1.0
        actuators = [a for a in self._actuators if a.joint and a.joint == joint.name]
        limits = self._range(joint, node)
        own_armature = float(joint.armature) * scale.armature
        return replace(
            bare,
            kind="prismatic" if slides else "continuous" if limits is None else "revolute",
            axis=frame[:3, :3] @ np.asarray(joint.axis),
            anchor=frame[:3, 3],
            reference=float(joint.ref) * unit,
            limit=_limit(node.source, limits, unit, force_limit(joint, actuators, scale.force)),
            armature=own_armature + sum(actuator.armature for actuator in actuators),
            spring_reference=float(joint.springref) * unit,
            settings=settings_of(joint, self._new_joint, JOINT_SETTINGS),
            position_gains=position_gains(actuators),
        )

    def _range(self, joint: Any, node: Node) -> tuple[float, float] | None:
        """Return the limits as written, or None; MuJoCo ignores limits that are not in order."""
        low, high = map(float, joint.range)
        limited = mujoco.mjtLimited
        if joint.limited == limited.mjLIMITED_FALSE:
            return None
        written = low != 0 or high != 0 or "range" in node.attributes
        if joint.limited == limited.mjLIMITED_AUTO and written and not joint.compiler.autolimits:
            self._report(
                node,
                f"joint {node.owner} has a range but no limited, and autolimits is off; "
                "MuJoCo rejects the file",
            )
        return (low, high) if written or joint.limited == limited.mjLIMITED_TRUE else None

    def _left_keyframes(self) -> Iterator[str]:
        """Yield one phrase on the keyframes after the first one, which is read."""
        others = [key.name or "without a name" for key in self._spec.keys if len(key.qpos)][1:]
        if others:
            yield f"the keyframes after the first: {names(others, max_count=4)}"

    def _keyframe_positions(self, joints: Sequence[Joint]) -> dict[str, float]:
        """Return the joint positions of the first keyframe that has any."""
        sizes = {"floating": 7, "ball": 4, "fixed": 0}
        moved = [joint for joint in joints for _ in range(sizes.get(joint.kind, 1))]
        key = next((key for key in self._spec.keys if len(key.qpos)), None)
        if key is None:
            return {}
        if len(key.qpos) != len(moved):
            if self._mjcf.complete:
                self._report(
                    self._node(key),
                    f"qpos of <key>: got {len(key.qpos)} numbers; expected {len(moved)}; "
                    "MuJoCo rejects the file",
                )
            return {}
        return {
            joint.name: float(position)
            for joint, position in zip(moved, key.qpos, strict=True)
            if joint.moves and math.isfinite(position)
        }


def _within_limit(actuator: Actuator, limit: float | None) -> Actuator:
    """Return an actuator whose effort is not more than the limit of its joint."""
    known = [effort for effort in (actuator.effort, limit) if effort is not None]
    return replace(actuator, effort=min(known, default=None))


def _limit(
    source: Source, limits: tuple[float, float] | None, unit: float, effort: float | None
) -> Limit | None:
    if limits is None:
        return None if effort is None else Limit(source=source, effort=effort)
    lower, upper = limits
    return Limit(source=source, lower=lower * unit, upper=upper * unit, effort=effort)


def _first(node: Node, attributes: Sequence[str]) -> str:
    """Return the first of some attributes that a node has, or an empty string."""
    return next((name for name in attributes if name in node.attributes), "")
