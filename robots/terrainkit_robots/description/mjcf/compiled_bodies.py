"""Compile the poses, scales and masses of the bodies of a parsed MJCF with MuJoCo.

The compiler resolves orientations, frames and their scales, and computes the inertia of geoms. But
it also opens all files, and rejects models with invalid values, which the reader keeps for the lint
rules. It therefore gets a copy of the bodies with placeholders for everything that it cannot use:

- A shape that needs a mesh or has an invalid size is a unit sphere without mass. A mesh that gives
  a body its mass is added as another shape, if MuJoCo compiles it.
- An explicit inertial has a mass of 1 kg and moments of 1 kg m2.
- A joint is a body at its anchor that carries no other body, because the time to compile joints
  grows with the third power of their number in a chain. It is fixed unless the model has a scaled
  frame; then it has a joint with limits and an armature of 1.

The compiled value of a placeholder is the scale of the value that it replaces.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from terrainkit_robots.description.mjcf.mesh_masses import MeshMasses
from terrainkit_robots.description.mjcf.shapes import SIZES, shape_kind
from terrainkit_robots.description.mjcf.tree import Node
from terrainkit_robots.description.model import ShapeKind
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.transforms import Matrix, quat_to_matrix

_SPANNING: frozenset[ShapeKind] = frozenset({"capsule", "cylinder", "ellipsoid", "box"})
"""Shapes that `fromto` applies to."""

_MIN_LENGTH = 1e-14
"""Minimum distance of the points of `fromto`; MuJoCo rejects shorter ones."""


@dataclass(frozen=True, kw_only=True)
class JointScale:
    """Factors of the frames around a joint on its positions, forces and armature."""

    position: float = 1.0
    force: float = 1.0
    armature: float = 1.0


class CompiledBodies:
    """The compiled bodies of a parsed spec, with their geoms and joints.

    Args:
        spec: The parsed spec.
        node_of: Function that returns the node of a MuJoCo element.
        report: Function that reports what MuJoCo rejects at a node.
        contents: File contents by path, which are used instead of files on disk.

    Raises:
        ValueError: If MuJoCo rejects the bodies.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        node_of: Callable[[Any], Node],
        report: Callable[[Node, str], None],
        contents: Mapping[Path, bytes],
    ) -> None:
        self._parsed, self._node_of, self._report = spec, node_of, report
        self._spec = mujoco.MjSpec()
        self._meshes = MeshMasses(spec, self._spec, node_of, contents)
        self._copies: dict[Any, Any] = {spec.worldbody: self._spec.worldbody}
        self._placeholders: set[Any] = set()
        self._unit_joints: dict[Any, Any] = {}
        """Joint in the copy of each joint, if the model has a scaled frame."""

        self._is_scaled = any(map(_is_scaled, spec.frames))
        self._missing: dict[Any, list[float]] = {}
        stack = list(spec.worldbody.bodies)
        while stack:
            body = stack.pop()
            self._copy_body(body)
            stack += body.bodies
        for site in spec.sites:
            self._copy_shape(site)
        self._spec.compiler.degree = False
        self._spec.compiler.balanceinertia = True  # the inertia of huge geoms has rounding errors
        with quiet_mujoco():
            self._model = self._spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)

    # Compiled values

    def world_pose(self, body: Any) -> Matrix:
        """Return the pose of a body in the world with all joints at their reference, (4, 4) [m]."""
        index = self._copies[body].id
        return _pose(self._data.xpos[index], self._data.xquat[index])

    def body_pose(self, body: Any) -> Matrix:
        """Return the pose of a body in its parent, or of a joint in its body, shape (4, 4) [m].

        The pose of a joint is its anchor with the orientation of the frame in which its axis is
        written.
        """
        index = self._copies[body].id
        return _pose(self._model.body_pos[index], self._model.body_quat[index])

    def shape_pose(self, shape: Any) -> Matrix:
        """Return the pose of a geom or site in its body, shape (4, 4) [m]."""
        index = self._copies[shape].id
        return _pose(self._model.geom_pos[index], self._model.geom_quat[index])

    def shape_size(self, geom: Any) -> Matrix:
        """Return the size of a geom, shape (3,) [m]."""
        size: Matrix = self._model.geom_size[self._copies[geom].id]
        return geom.size * size[0] if geom in self._placeholders else size

    def mesh_scale(self, geom: Any) -> float:
        """Return the scale of the frames around a geom with a mesh."""
        return float(self._model.geom_size[self._copies[geom].id, 0])

    def inertial(self, body: Any) -> tuple[float, Matrix, Matrix]:
        """Return the compiled inertial of a body.

        Returns:
            Mass [kg], pose of the inertial in the body, shape (4, 4) [m], and principal moments
            [kg m2], shape (3,).
        """
        model, index = self._model, self._copies[body].id
        pose = _pose(model.body_ipos[index], model.body_iquat[index])
        return float(model.body_mass[index]), pose, model.body_inertia[index]

    def missing_masses(self, body: Any) -> list[float]:
        """Return what the geoms whose inertia is not compiled add to the mass of a body [kg].

        A mass is negative, or NaN if it depends on a mesh file, or 0 if it is compiled.
        """
        return self._missing.get(body, [])

    def joint_scale(self, joint: Any) -> JointScale:
        """Return the factors of the frames around a joint on its values."""
        if joint not in self._unit_joints:
            return JointScale()
        model, index = self._model, self._unit_joints[joint].id
        return JointScale(
            position=float(model.jnt_range[index, 1]),
            force=float(model.jnt_actfrcrange[index, 1]),
            armature=float(model.dof_armature[index]),
        )

    # Copies

    def _copy_body(self, body: Any) -> None:
        copy = self._place(body).add_body(
            pos=body.pos, quat=self._quat(body, body.quat, body.alt), info=body.info
        )
        self._copies[body] = copy
        if is_explicit(body):
            copy.explicitinertial, copy.mass, copy.inertia = True, 1.0, np.ones(3)
            copy.ipos = body.ipos
            if math.isnan(body.fullinertia[0]):  # otherwise it is in the frame of the body
                copy.iquat = self._quat(body, body.iquat, body.ialt, "inertial")
        low, high = body.compiler.inertiagrouprange
        for geom in body.geoms:
            self._copy_shape(geom)
            if low <= geom.group <= high and not is_explicit(body):
                self._set_mass(geom, body)
        for joint in body.joints:
            self._copy_joint(joint)

    def _copy_shape(self, shape: Any) -> None:
        """Add a geom or site to the copy, without mass."""
        kind = shape_kind(shape)
        ends = shape.fromto
        spans = kind in _SPANNING and not math.isnan(ends[0])
        if spans and np.linalg.norm(ends[:3] - ends[3:]) < _MIN_LENGTH:
            self._report_rejected(shape, "the two points of fromto are equal")
            spans = False
        count = 1 if spans else SIZES.get(kind, 0)
        has_mesh = bool(getattr(shape, "meshname", ""))
        is_valid = count > 0 and not has_mesh and bool((shape.size[:count] > 0).all())
        if not is_valid:
            self._placeholders.add(shape)
        copy = self._place(shape).add_geom(
            type=shape.type if is_valid or spans else mujoco.mjtGeom.mjGEOM_SPHERE,
            size=shape.size if is_valid else np.ones(3),
            mass=0,
            info=shape.info,
        )
        if spans:
            copy.fromto = ends
        else:
            copy.pos, copy.quat = shape.pos, self._quat(shape, shape.quat, shape.alt)
        self._copies[shape] = copy

    def _set_mass(self, geom: Any, body: Any) -> None:
        """Give the copy of a geom the mass of the geom, as far as MuJoCo can compile it."""
        copy = self._copies[geom]
        mass = float(geom.mass)
        density = float(geom.density)
        is_placeholder = geom in self._placeholders
        kinds = mujoco.mjtGeom
        needs_mesh = bool(geom.meshname) or geom.type in (kinds.mjGEOM_MESH, kinds.mjGEOM_SDF)
        is_massless = mass == 0 or (math.isnan(mass) and density == 0)
        if is_massless or (is_placeholder and not needs_mesh):
            return
        if not is_placeholder and not mass < 0 and density >= 0:
            copy.mass, copy.density, copy.typeinertia = mass, density, geom.typeinertia
            return
        if needs_mesh and not mass < 0 and density >= 0:
            place, quat = self._place(geom), self._quat(geom, geom.quat, geom.alt)
            if self._meshes.add(place, geom, quat):
                return
        if mass > 0:
            copy.mass = mass
        self._missing.setdefault(body, []).append(0.0 if mass > 0 else mass)

    def _copy_joint(self, joint: Any) -> None:
        """Add the anchor of a joint to the copy, with a unit joint if its values may be scaled."""
        kinds, limited = mujoco.mjtJoint, mujoco.mjtLimited.mjLIMITED_TRUE
        anchor = self._place(joint).add_body(pos=joint.pos)
        self._copies[joint] = anchor
        if self._is_scaled:
            anchor.explicitinertial, anchor.mass, anchor.inertia = True, 1.0, np.ones(3)
            slides = joint.type == kinds.mjJNT_SLIDE
            self._unit_joints[joint] = anchor.add_joint(
                type=kinds.mjJNT_SLIDE if slides else kinds.mjJNT_HINGE,
                range=[-1, 1],
                limited=limited,
                actfrcrange=[-1, 1],
                actfrclimited=limited,
                armature=1.0,
            )

    def _place(self, element: Any) -> Any:
        """Return the copy of the frame around an element, or of its body if there is none."""
        frame = element.frame
        if frame is None:
            return self._copies[element.parent]
        if frame not in self._copies:
            quat = self._quat(frame, frame.quat, frame.alt)
            copy = self._place(frame).add_frame(pos=frame.pos, quat=quat)
            if _is_scaled(frame):
                copy.scale = np.full(3, self._uniform_scale(frame))
                copy.scaling, copy.massscale = frame.scaling, frame.massscale
            self._copies[frame] = copy
        return self._copies[frame]

    def _uniform_scale(self, frame: Any) -> float:
        scale = np.asarray(frame.scale, dtype=np.float64)
        if scale[0] == scale[1] == scale[2] > 0:
            return float(scale[0])
        mean = float(np.cbrt(np.abs(scale).prod())) or 1.0
        self._report(
            self._node_of(frame),
            f"scale of <frame>: got {' '.join(f'{factor:g}' for factor in scale)}; expected equal "
            f"positive factors; {mean:g} is used for all axes",
        )
        return mean

    def _quat(self, element: Any, quat: Matrix, alt: Any, child: str = "") -> Matrix:
        """Return the quaternion of an orientation; the identity if it is invalid."""
        if alt.type == mujoco.mjtOrientation.mjORIENTATION_QUAT:
            return quat
        compiler = element.compiler
        try:
            return np.array(
                self._parsed.resolve_orientation(
                    degree=bool(compiler.degree), sequence=compiler.eulerseq, orientation=alt
                )
            )
        except ValueError as error:
            self._report_rejected(element, f"there is no orientation: {error}", child)
            return np.array([1.0, 0, 0, 0])

    def _report_rejected(self, element: Any, message: str, child: str = "") -> None:
        node = self._node_of(element)
        node = next((part for part in node.elements() if part.tag == child), node)
        self._report(node, f"<{node.tag}>: {message}; MuJoCo rejects the file")


def _is_scaled(frame: Any) -> bool:
    """Return whether a frame scales what is in it, as MuJoCo 3.16 and newer can."""
    return hasattr(frame, "scale") and bool((frame.scale != 1).any() or frame.massscale > 0)


def is_explicit(body: Any) -> bool:
    """Return whether MuJoCo uses the <inertial> of a body."""
    derived = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return bool(body.explicitinertial and body.compiler.inertiafromgeom != derived)


def _pose(position: Matrix, quat: Matrix) -> Matrix:
    pose = np.eye(4)
    pose[:3, :3] = quat_to_matrix(quat)
    pose[:3, 3] = position
    return pose
