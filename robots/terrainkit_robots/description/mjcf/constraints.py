"""Read the equality constraints and tendons of an MJCF."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

from terrainkit_robots.description.mjcf.compiled_bodies import CompiledBodies
from terrainkit_robots.description.mjcf.tree import Node
from terrainkit_robots.description.model import WORLD, Coupling, Loop, Mimic, Tendon
from terrainkit_robots.description.xml.number_text import number_text
from terrainkit_robots.transforms import Matrix, invert_poses, quat_to_matrix

_SOLVER = ("solref", "solimp")

GEOM_SETTINGS = ("friction", "condim", "priority", "solmix", "margin", "gap", *_SOLVER)
"""Fields of a MuJoCo geom for its contacts."""

_LIMIT_SOLVER = ("solref_limit", "solimp_limit", "solref_friction", "solimp_friction")

JOINT_SETTINGS = (*_LIMIT_SOLVER, "margin", "springyield")
"""Fields of a MuJoCo joint for its limits and its friction."""

_TENDON_SETTINGS = (
    *JOINT_SETTINGS,
    *("range", "frictionloss", "springlength", "stiffness", "damping", "armature"),
)


def settings_of(element: Any, default: Any, names: Sequence[str]) -> dict[str, str]:
    """Return the attributes of a MuJoCo element that are not the defaults, as text.

    Args:
        element: An element of a parsed spec.
        default: A new element of the same kind.
        names: Fields of the element; an attribute is named like its field, without underscores.
    """
    found = {}
    for name in names:
        # A field that this version of MuJoCo does not have is 0.
        value, usual = (np.ravel(getattr(owner, name, 0.0)) for owner in (element, default))
        if not np.array_equal(value, usual, equal_nan=True):
            if name in ("stiffness", "damping"):  # old versions read the first number only
                value = np.trim_zeros(value, "b")
            found[name.replace("_", "")] = number_text(value)
    return found


class Constraints:
    """The constraints and tendons of a parsed spec.

    Args:
        spec: The spec.
        node_of: Function that returns the node of a MuJoCo element.
        link_names: Name of the link of each body.
        compiled: The compiled bodies and sites.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        node_of: Callable[[Any], Node],
        link_names: Mapping[Any, str],
        compiled: CompiledBodies,
    ) -> None:
        self.mimics: dict[str, Mimic] = {}
        """The mimic of each joint that a linear equality couples to another joint."""

        self.couplings: list[Coupling] = []
        self.loops: list[Loop] = []
        self.tendons: list[Tendon] = []
        self.coupled: set[str] = set()
        """Joints that other joints move through a loop or a fixed tendon."""

        self.left_out: list[str] = []
        """What is not read, one phrase each."""

        self._spec, self._node_of = spec, node_of
        self._link_names, self._compiled = link_names, compiled
        self._driven = {actuator.target for actuator in spec.actuators}
        self._default = mujoco.MjSpec()
        kinds = mujoco.mjtEq
        for number, equality in enumerate(spec.equalities, 1):
            if not equality.active:
                continue
            if equality.type == kinds.mjEQ_JOINT:
                self._read_coupling(equality)
            elif equality.type == kinds.mjEQ_TENDON:
                self._add_coupling("tendon", equality, equality.data[:5].tolist())
            elif equality.type in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                self._read_loop(equality, equality.name or f"loop_{number}")
            else:
                self.left_out.append(f"the equality constraint {equality.name or number}")
        for number, tendon in enumerate(spec.tendons, 1):
            self._read_tendon(tendon, tendon.name or f"tendon_{number}")

    def _read_coupling(self, equality: Any) -> None:
        follower, target = self._ends(equality, self._spec.joint)
        values = np.array(equality.data[:5])
        if follower is None or (target is None and equality.name2) or not np.isfinite(values).all():
            return
        # MuJoCo relates the distances from the references of both joints.
        shift = Polynomial([0.0 if target is None else -_reference(target), 1.0])
        moved = (Polynomial(values)(shift) + _reference(follower)).coef
        offset, multiplier, *higher = np.pad(moved, (0, 5 - len(moved))).tolist()
        is_taken = equality.name1 in self.mimics or equality.name1 in self._driven
        if target is not None and not any(higher) and not is_taken:
            self.mimics[equality.name1] = Mimic(
                source=self._node_of(equality).source,
                joint=equality.name2,
                multiplier=multiplier,
                offset=offset,
                settings=self._settings(equality),
            )
        else:
            self._add_coupling("joint", equality, (offset, multiplier, *higher))

    def _add_coupling(
        self, kind: Literal["joint", "tendon"], equality: Any, coefficients: Sequence[float]
    ) -> None:
        self.couplings.append(
            Coupling(
                kind=kind,
                follower=equality.name1,
                target=equality.name2,
                coefficients=tuple(coefficients),
                settings=self._settings(equality),
            )
        )

    def _settings(self, equality: Any) -> dict[str, str]:
        return settings_of(equality, self._default.add_equality(), _SOLVER)

    def _ends(self, equality: Any, find: Callable[[str], Any]) -> list[Any]:
        """Return both elements that a constraint names, None for one that does not exist."""
        return [find(name) if name else None for name in (equality.name1, equality.name2)]

    def _read_loop(self, equality: Any, name: str) -> None:
        is_weld = equality.type == mujoco.mjtEq.mjEQ_WELD
        settings = self._settings(equality)
        if is_weld and equality.data[10] != 1:
            settings["torquescale"] = number_text(equality.data[10])
        if equality.objtype == mujoco.mjtObj.mjOBJ_SITE:
            sites = [site for site in self._ends(equality, self._spec.site) if site is not None]
            ends = [(site.parent, self._compiled.shape_pose(site)) for site in sites]
        else:
            ends = self._body_ends(equality)
        links = [self._link_names.get(body, WORLD) for body, _ in ends]
        if len(links) < 2 or WORLD in links or links[0] == links[1]:
            self.left_out.append(f"the constraint {name}, which closes no loop of the robot")
            return
        chains = [ancestors(body) for body, _ in ends]
        if chains[0][-1] == chains[1][-1]:  # a mocap body closes no loop
            for chain, other in (chains, chains[::-1]):
                moved = [body for body in chain if body not in other]
                self.coupled |= {joint.name for body in moved for joint in body.joints}
        self.loops.append(
            Loop(
                name=name,
                kind="weld" if is_weld else "connect",
                links=(links[0], links[1]),
                origins=(ends[0][1], ends[1][1]),
                settings=settings,
            )
        )

    def _body_ends(self, equality: Any) -> list[tuple[Any, Matrix]]:
        """Return both bodies of a constraint, and the pose of its frame in each."""
        bodies = self._ends(equality, self._spec.body)
        if None in bodies:
            return []
        poses = [self._compiled.world_pose(body) for body in bodies]
        at_reference = invert_poses(poses[0]) @ poses[1]
        frame = np.eye(4)
        frame[:3, 3] = equality.data[:3]
        if equality.type == mujoco.mjtEq.mjEQ_CONNECT:  # the anchor is in the first body
            return [(bodies[0], frame), (bodies[1], invert_poses(at_reference) @ frame)]
        first = at_reference @ frame
        if np.any(equality.data[6:10]):  # relpose: the orientation, and where the anchor is
            first[:3, :3] = quat_to_matrix(equality.data[6:10])
            first[:3, 3] = equality.data[3:6]
        return [(bodies[0], first), (bodies[1], frame)]

    def _read_tendon(self, tendon: Any, name: str) -> None:
        kinds = mujoco.mjtWrap
        joints: dict[str, float] = {}
        points: list[tuple[str, Matrix] | float] = []
        for wrap in tendon.path:
            if wrap.type == kinds.mjWRAP_JOINT and wrap.target is not None:
                joints[wrap.target.name] = float(wrap.coef)
                self.coupled.add(wrap.target.name)
            elif wrap.type == kinds.mjWRAP_PULLEY:
                points.append(float(wrap.divisor))
            elif wrap.type == kinds.mjWRAP_SITE and wrap.target is not None:
                link = self._link_names.get(wrap.target.parent, WORLD)
                points.append((link, self._compiled.shape_pose(wrap.target)))
            else:
                self.left_out.append(f"the tendon {name}, which wraps around a shape")
                return
        settings = settings_of(tendon, self._default.add_tendon(), _TENDON_SETTINGS)
        if tendon.limited == mujoco.mjtLimited.mjLIMITED_FALSE:
            settings.pop("range", None)
        self.tendons.append(
            Tendon(name=name, joints=joints, points=tuple(points), settings=settings)
        )


def _reference(joint: Any) -> float:
    """Return the reference of a joint [rad] or [m]."""
    hinge = joint.type == mujoco.mjtJoint.mjJNT_HINGE
    return float(joint.ref) * (math.pi / 180 if hinge and joint.compiler.degree else 1.0)


def ancestors(body: Any) -> list[Any]:
    """Return a body and the bodies that carry it, without the world."""
    found = []
    while body.name != WORLD:  # to ask for the parent of the world crashes MuJoCo 3.11
        found.append(body)
        body = body.parent
    return found
