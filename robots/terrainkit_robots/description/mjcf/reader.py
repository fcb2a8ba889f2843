"""Read the robot of an MJCF document.

MuJoCo's parser resolves defaults, frames, units and replicas. Nothing is compiled, because the
compiler opens meshes and stops at the first error.

MuJoCo computes the mass of a body without <inertial> from its geoms, and so does this reader.
Masses that depend on a mesh file are NaN.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.description.mjcf.actuators import (
    ActuatorData,
    force_limit,
    read_actuators,
    read_mimics,
)
from terrainkit_robots.description.mjcf.imu import BodySite, find_imu
from terrainkit_robots.description.mjcf.inertia import Solid, make_solid, sum_solids
from terrainkit_robots.description.mjcf.parser import parse_mjcf, report
from terrainkit_robots.description.mjcf.references import dangling_references
from terrainkit_robots.description.mjcf.shapes import (
    SIZES,
    Scale,
    apply_frames,
    color_of,
    fromto_pose,
    geom_shape,
    mesh_file,
    mesh_geometry,
    mesh_name,
    pose_and_scale,
    resolve_orientation,
    scale_solid,
)
from terrainkit_robots.description.mjcf.tree import MjcfTree, Node, read_tree
from terrainkit_robots.description.model import (
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
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    import mujoco

WORLD = "world"

_PAIRED = 1 << 30
"""Contype bit of geoms that collide only through a <pair>; no other geom uses it."""


def read_mjcf(doc: XmlDocument, *, contents: Mapping[Path, bytes] | None = None) -> RobotModel:
    """Return the robot of a document whose root is <mujoco>.

    Args:
        doc: The XML document.
        contents: File contents by path, which are used instead of included files on disk.
    """
    file = doc.file
    if doc.root is None:
        return RobotModel(
            name="",
            kind="mjcf",
            file=file,
            source=Source(file=file, line=0),
            problems=doc.problems,
            sources=(file,),
        )
    mjcf = read_tree(doc, contents or {})
    spec, lines = parse_mjcf(mjcf)
    robot = RobotModel(
        name=mjcf.root.written.get("model", "").strip(),
        kind="mjcf",
        file=file,
        source=mjcf.root.source,
        sources=mjcf.sources,
    )
    if spec is not None:
        robot = _Reader(mjcf, spec, lines).fill(robot)
    return replace(robot, problems=tuple(mjcf.problems))


class _Reader:
    """Convert a parsed MuJoCo spec to links and joints, and collect problems."""

    def __init__(self, mjcf: MjcfTree, spec: "mujoco.MjSpec", lines: Sequence[Node]) -> None:
        self._mjcf = mjcf
        self._spec = spec
        self._lines = lines
        self._meshes = {mesh_name(mesh): mesh for mesh in spec.meshes}
        self._materials = {material.name: material for material in spec.materials}
        self._paired = {name for p in spec.pairs for name in (p.geomname1, p.geomname2)} - {""}
        self._bodies = _Names(body.name for body in spec.bodies)
        self._joints = _Names(joint.name for joint in spec.joints)
        self._actuators = tuple(read_actuators(spec, self._node))
        self._joint_actuators: dict[str, list[ActuatorData]] = {}
        for actuator in self._actuators:
            self._joint_actuators.setdefault(actuator.joint, []).append(actuator)
        self._mimics = read_mimics(spec, self._node)
        self._factors: dict[str, float] = {}
        self._sites: list[BodySite] = []
        self._reported: set[str] = set()

    def fill(self, robot: RobotModel) -> RobotModel:
        """Return the robot with the contents of the spec."""
        links, joints = self._read_bodies()
        compiler = self._spec.compiler
        bounds = float(compiler.boundmass), float(compiler.boundinertia)
        links = [replace(each, inertial=_apply_minimums(each, *bounds)) for each in links]
        dangling_references(self._mjcf, self._spec)
        if not compiler.degree:
            self._check_euler_angles()
        return replace(
            robot,
            links=_scale_to_total_mass(links, float(compiler.settotalmass)),
            joints=joints,
            actuators=self._scaled_actuators(joints),
            options=self._options(),
            keyframe=self._keyframe_positions(joints),
            imu=self._imu(),
            excluded=frozenset(
                frozenset((each.bodyname1, each.bodyname2))
                for each in self._spec.excludes
                if each.bodyname1 != each.bodyname2
            ),
        )

    def _check_euler_angles(self) -> None:
        for node in self._mjcf.nodes():
            text = node.attributes.get("euler", "")
            angles = parse_numbers(text, 3) if text else None
            if angles is not None and is_in_degrees(angles.tolist()):
                message = f"euler of <{node.tag}>: got {text} rad; expected radians"
                report(self._mjcf, node, "XML018", message)

    def _options(self) -> PhysicsOptions:
        import mujoco

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
        match = re.fullmatch(r"line (\d+)", element.info)
        line = int(match[1]) if match else 0
        if 1 <= line <= len(self._lines):
            return self._lines[line - 1]
        return default or self._mjcf.root

    def _report(self, node: Node, message: str) -> None:
        """Report what MuJoCo's compiler would reject, each message once."""
        if message not in self._reported:
            self._reported.add(message)
            report(self._mjcf, node, "XML011", message)

    def _scaled_actuators(self, joints: Sequence[Joint]) -> tuple[Actuator, ...]:
        most = {joint.name: joint.limit.effort for joint in joints if joint.limit is not None}
        return tuple(
            actuator.actuator(self._factors.get(actuator.joint, 1.0), most.get(actuator.joint))
            for actuator in self._actuators
        )

    # Bodies

    def _read_bodies(self) -> tuple[list[Link], tuple[Joint, ...]]:
        links: list[Link] = []
        joints: list[Joint] = []
        stack = [(body, WORLD, Scale(), 0) for body in reversed(self._spec.worldbody.bodies)]
        while stack:
            body, parent, outer, depth = stack.pop()
            node = self._node(body)
            name = body.name or self._bodies.unused(node.default_name or "unnamed_body")
            pose, scale = self._pose_and_scale(body, node, outer)
            virtual_links, body_joints = self._read_joints(body, node, name, parent, pose, scale)
            links += [*virtual_links, self._link(body, node, name, scale)]
            joints += body_joints
            self._sites += [
                BodySite(site=site, link=name, depth=depth, node=node, scale=scale)
                for site in body.sites
            ]
            stack += [(child, name, scale, depth + 1) for child in reversed(body.bodies)]
        return links, tuple(joints)

    def _pose_and_scale(self, element: Any, node: Node, outer: Scale) -> tuple[Matrix, Scale]:
        try:
            pose, scale = pose_and_scale(element, outer, self._spec)
        except ValueError as error:
            self._report(node, f"<{node.tag}> has no orientation: {error}; MuJoCo rejects the file")
            pose, scale = np.eye(4), outer
            pose[:3, 3] = np.asarray(element.pos) * outer.length
        if not scale.uniform:
            self._report(
                node, "scale of <frame>: got different factors; their mean is used for all axes"
            )
        return pose, scale

    def _link(self, body: Any, node: Node, name: str, scale: Scale) -> Link:
        collisions: list[Geometry] = []
        visuals: list[Geometry] = []
        solids: list[Solid] = []
        low, high = self._spec.compiler.inertiagrouprange
        for geom in body.geoms:
            geometry, weight = self._geometry(geom, self._node(geom, node), scale)
            drawn = not (geom.contype or geom.conaffinity or geom.name in self._paired)
            (visuals if drawn else collisions).append(geometry)
            if weight is not None and low <= geom.group <= high:
                solids.append(weight)
        return Link(
            name=name,
            source=node.source,
            inertial=self._inertial(body, node, solids, scale),
            collisions=tuple(collisions),
            visuals=tuple(visuals),
        )

    def _inertial(
        self, body: Any, node: Node, solids: Sequence[Solid], scale: Scale
    ) -> Inertial | None:
        import mujoco

        how = body.compiler.inertiafromgeom
        derived = mujoco.mjtInertiaFromGeom
        if how == derived.mjINERTIAFROMGEOM_TRUE:
            return sum_solids(solids, node.source)
        if not body.explicitinertial:
            return (
                None if how == derived.mjINERTIAFROMGEOM_FALSE else sum_solids(solids, node.source)
            )
        written = next((n for n in _iter_elements(node) if n.tag == "inertial"), node)
        origin = np.eye(4)
        origin[:3, 3] = np.asarray(body.ipos) * scale.length
        full = np.asarray(body.fullinertia)
        inertia = None
        if not math.isnan(full[0]):
            xx, yy, zz, xy, xz, yz = full
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        elif "diaginertia" in written.attributes:
            inertia = np.diag(body.inertia)
        if math.isnan(full[0]):  # fullinertia is in the frame of the body
            origin[:3, :3] = self._orientation(body, written)
        known = "mass" in written.attributes and "mass" not in written.defaults
        return Inertial(
            source=written.source,
            mass=float(body.mass) * scale.mass if known else None,
            origin=origin,
            inertia=None if inertia is None else inertia * (scale.mass * scale.length**2),
            attribute=_first(written, ("fullinertia", "diaginertia")),
            axes_attribute=_first(written, ("quat", "axisangle", "xyaxes", "zaxis", "euler")),
        )

    def _orientation(self, body: Any, node: Node) -> Matrix:
        try:
            return resolve_orientation(body.iquat, body.ialt, body.compiler, self._spec)
        except ValueError as error:
            self._report(node, f"<inertial> has no orientation: {error}; MuJoCo rejects the file")
            return np.eye(3)

    def _imu(self) -> tuple[str, Matrix] | None:
        """Return the link of the IMU and its pose in the link frame."""
        found = find_imu(self._spec, self._sites)
        if found is None:
            return None
        node = self._node(found.site, found.node)
        ends = np.asarray(found.site.fromto)
        if math.isnan(ends[0]):
            return found.link, self._pose_and_scale(found.site, node, found.scale)[0]
        try:
            pose, _ = fromto_pose(ends)
            return found.link, apply_frames(pose, found.site.frame, found.scale, self._spec)[0]
        except ValueError as error:
            self._report(node, f"<{node.tag}>: {error}; MuJoCo rejects the file")
            return None

    # Shapes

    def _geometry(self, geom: Any, node: Node, outer: Scale) -> tuple[Geometry, Solid | None]:
        """Return the geometry of a geom, and the solid that it adds to its body."""
        import mujoco

        shape, size = geom_shape(geom), np.asarray(geom.size, dtype=np.float64)
        pose, scale = self._pose_and_scale(geom, node, outer)
        if not math.isnan(geom.fromto[0]) and shape in ("capsule", "cylinder", "ellipsoid", "box"):
            try:
                pose, half = fromto_pose(np.asarray(geom.fromto))
                pose, scale = apply_frames(pose, geom.frame, outer, self._spec)
                flat = shape in ("ellipsoid", "box")
                size = np.array([size[0], size[0] if flat else half, half])
            except ValueError as error:
                self._report(node, f"<{node.tag}>: {error}; MuJoCo rejects the file")
        size = size[: SIZES.get(shape, 0)]
        fitted = bool(geom.meshname) and shape in SIZES
        shell = geom.typeinertia == mujoco.mjtGeomInertia.mjINERTIA_SHELL
        solid_shape = "plane" if geom.type == mujoco.mjtGeom.mjGEOM_HFIELD else shape
        weight = make_solid(
            "unknown" if fitted or shell else solid_shape,
            size.tolist(),
            pose,
            mass=float(geom.mass),
            density=float(geom.density),
        )
        contype, conaffinity = self._bits(geom)
        geometry = Geometry(
            source=node.source,
            shape="unknown" if shape == "mesh" or fitted else shape,
            name=geom.name,
            size=() if fitted else tuple(float(each) for each in size * scale.length),
            origin=pose,
            contype=contype,
            conaffinity=conaffinity,
            color=color_of(geom, self._materials),
            friction=float(geom.friction[0]),
            priority=int(geom.priority),
            condim=int(geom.condim),
        )
        if shape == "mesh" or fitted:
            geometry = replace(self._with_mesh(geometry, geom, scale), fit_to_mesh=fitted)
        return geometry, None if weight is None else scale_solid(weight, scale)

    def _bits(self, geom: Any) -> tuple[int, int]:
        """Return contype and conaffinity."""
        import mujoco

        if self._spec.option.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
            return 0, 0
        if geom.name in self._paired and not (geom.contype or geom.conaffinity):
            return _PAIRED, 0
        return int(geom.contype), int(geom.conaffinity)

    def _with_mesh(self, geometry: Geometry, geom: Any, scale: Scale) -> Geometry:
        mesh = self._meshes.get(geom.meshname)
        if mesh is None:
            return geometry
        file = mesh_file(mesh, self._node(mesh), bool(self._spec.strippath))
        return geometry if file is None else mesh_geometry(geometry, mesh, file, scale)

    # Joints

    def _read_joints(
        self, body: Any, node: Node, name: str, parent: str, pose: Matrix, scale: Scale
    ) -> tuple[list[Link], list[Joint]]:
        """Return the joints of a body, and virtual links between them if there are several."""
        body_joints = list(body.joints)
        if not body_joints:
            fixed = Joint(
                name=self._joints.unused(f"{name}_fixed"),
                source=node.source,
                kind="fixed",
                parent=parent,
                child=name,
                origin=pose,
            )
            return [], [fixed]
        links: list[Link] = []
        joints: list[Joint] = []
        for k, joint in enumerate(body_joints, 1):
            written = self._node(joint, node)
            own = joint.name or self._joints.unused(f"{name}_joint")
            child = name if k == len(body_joints) else self._bodies.unused(f"{name}:{own}")
            if child != name:
                links.append(Link(name=child, source=written.source, virtual=True))
            joints.append(
                replace(
                    self._joint(joint, written, own, scale),
                    parent=parent,
                    child=child,
                    origin=pose if k == 1 else np.eye(4),
                )
            )
            parent = child
        return links, joints

    def _joint(self, joint: Any, node: Node, name: str, outer: Scale) -> Joint:
        """Return a joint without its parent and child."""
        import mujoco

        kinds = mujoco.mjtJoint
        at = np.eye(4)
        at[:3, 3] = joint.pos
        try:
            at, scale = apply_frames(at, joint.frame, outer, self._spec)
        except ValueError as error:
            self._report(node, f"a <frame> has no orientation: {error}; MuJoCo rejects the file")
            scale = outer
        bare = Joint(name=name, source=node.source, kind="ball", parent="", child="")
        if joint.type == kinds.mjJNT_FREE:
            return replace(bare, kind="floating")
        if joint.type == kinds.mjJNT_BALL:
            return replace(bare, anchor=at[:3, 3])
        slides = joint.type == kinds.mjJNT_SLIDE
        unit = scale.length if slides else math.pi / 180 if joint.compiler.degree else 1.0
        force, rotor = (scale.force, scale.rotor) if slides else (scale.torque, scale.torque)
        self._factors[joint.name] = force
        actuators = self._joint_actuators.get(joint.name, []) if joint.name else []
        limits = self._range(joint, node)
        return replace(
            bare,
            kind="prismatic" if slides else "continuous" if limits is None else "revolute",
            axis=at[:3, :3] @ np.asarray(joint.axis),
            anchor=at[:3, 3],
            reference=float(joint.ref) * unit,
            limit=_limit(node.source, limits, unit, force_limit(joint, actuators, force)),
            mimic=self._mimics.get(joint.name),
            dynamics=Dynamics(
                source=node.source,
                damping=float(np.ravel(joint.damping)[0]) * rotor,
                friction=float(joint.frictionloss) * force,
            ),
            armature=(float(joint.armature) + sum(actuator.armature for actuator in actuators))
            * rotor,
        )

    def _range(self, joint: Any, node: Node) -> tuple[float, float] | None:
        """Return the limits as written, or None; MuJoCo ignores limits that are not in order."""
        import mujoco

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

    def _keyframe_positions(self, joints: Sequence[Joint]) -> dict[str, float]:
        """Return the joint positions of the first keyframe that has any."""
        sizes = {"floating": 7, "ball": 4, "fixed": 0}
        expected = sum(sizes.get(joint.kind, 1) for joint in joints)
        for key in self._spec.keys:
            positions = [float(each) for each in key.qpos]
            if not positions:
                continue
            if len(positions) != expected:
                if self._mjcf.complete:
                    self._report(
                        self._node(key),
                        f"qpos of <key>: got {len(positions)} numbers; expected {expected}; "
                        "MuJoCo rejects the file",
                    )
                return {}
            return dict(_assign_positions(joints, sizes, positions))
        return {}


def _assign_positions(
    joints: Sequence[Joint], sizes: Mapping[str, int], positions: Sequence[float]
) -> Iterator[tuple[str, float]]:
    """Yield the name and position of each joint with one degree of freedom."""
    at = 0
    for joint in joints:
        if joint.moves and math.isfinite(positions[at]):
            yield joint.name, positions[at]
        at += sizes.get(joint.kind, 1)


def _iter_elements(node: Node) -> Iterator[Node]:
    """Yield the elements of a body, including those in frames."""
    for child in node.children:
        yield child
        if child.tag in ("frame", "replicate"):
            yield from _iter_elements(child)


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


class _Names:
    """Set of used names."""

    def __init__(self, used_names: Iterable[str]) -> None:
        self._used_names = set(used_names)
        self._counts: dict[str, int] = {}

    def unused(self, name: str) -> str:
        """Return an unused name and add it to the set."""
        free = name
        while free in self._used_names:
            self._counts[name] = self._counts.get(name, 1) + 1
            free = f"{name}_{self._counts[name]}"
        self._used_names.add(free)
        return free


def _apply_minimums(link: Link, least: float, least_moment: float) -> Inertial | None:
    """Return the inertial of a link with the compiler's minimum mass [kg] and inertia [kg m2].

    Negative values are kept.
    """
    inertial = link.inertial
    if link.virtual or max(least, least_moment) <= 0:
        return inertial
    if inertial is None:
        return Inertial(source=link.source, mass=least, inertia=np.eye(3) * least_moment)
    mass, inertia = inertial.mass, inertial.inertia
    if mass is not None and 0 <= mass < least:
        mass = least
    if inertia is not None and np.isfinite(inertia).all():
        moments, axes = np.linalg.eigh(inertia)
        small = (moments >= 0) & (moments < least_moment)
        inertia = axes @ np.diag(np.where(small, least_moment, moments)) @ axes.T
    return replace(inertial, mass=mass, inertia=inertia)


def _scale_to_total_mass(links: Sequence[Link], total: float) -> tuple[Link, ...]:
    """Return links with masses scaled to a total mass [kg], if the file sets one."""
    masses = [link.inertial.mass for link in links if link.inertial is not None]
    known = sum(mass for mass in masses if mass is not None)
    if not (total > 0 and known > 0 and math.isfinite(known)) or None in masses:
        return tuple(links)
    factor = total / known
    return tuple(
        link
        if link.inertial is None or link.inertial.mass is None
        else replace(
            link,
            inertial=replace(
                link.inertial,
                mass=link.inertial.mass * factor,
                inertia=None if link.inertial.inertia is None else link.inertial.inertia * factor,
            ),
        )
        for link in links
    )
