"""Read the equality constraints and tendons of an MJCF."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.polynomial import Polynomial

from terrainkit_robots.description.mjcf.tree import Node
from terrainkit_robots.description.model import WORLD, Coupling, Loop, Mimic, Tendon
from terrainkit_robots.description.xml.number_text import number_text
from terrainkit_robots.transforms import Matrix, invert_poses, quat_to_matrix

if TYPE_CHECKING:
    import mujoco

_SOLVER = {"solref": "solref", "solimp": "solimp"}

GEOM_SETTINGS = {
    name: name for name in ("friction", "condim", "priority", "solmix", "margin", "gap")
} | _SOLVER
"""Attribute of <geom> by field of a MuJoCo geom, for its contacts."""

JOINT_SETTINGS = {
    "solref_limit": "solreflimit",
    "solimp_limit": "solimplimit",
    "solref_friction": "solreffriction",
    "solimp_friction": "solimpfriction",
    "margin": "margin",
    "springyield": "springyield",
}
"""Attribute of <joint> by field of a MuJoCo joint, for its limits and its friction."""

_TENDON_SETTINGS = JOINT_SETTINGS | {
    name: name
    for name in ("range", "frictionloss", "springlength", "stiffness", "damping", "armature")
}


def settings_of(element: Any, default: Any, attributes: Mapping[str, str]) -> dict[str, str]:
    """Return the attributes of a MuJoCo element that are not the defaults, as text.

    Args:
        element: An element of a parsed spec.
        default: A new element of the same kind.
        attributes: Name of the attribute by field of the element.
    """
    found = {}
    for name, attribute in attributes.items():
        # A field that this version of MuJoCo does not have is 0.
        value, usual = (np.ravel(getattr(owner, name, 0.0)) for owner in (element, default))
        if not np.array_equal(value, usual, equal_nan=True):
            if name in ("stiffness", "damping"):  # old versions read the first number only
                value = np.trim_zeros(value, "b")
            found[attribute] = number_text(value)
    return found


class Constraints:
    """The constraints and tendons of a parsed spec.

    Args:
        spec: The spec.
        node_of: Function that returns the node of a MuJoCo element.
        link_names: Name of the link of each body.
        world_pose: Function that returns the pose of a body in the world with all joints at their
            reference, shape (4, 4) [m].
        site_pose: Function that returns the pose of a site in its body, shape (4, 4) [m].
    """

    def __init__(
        self,
        spec: "mujoco.MjSpec",
        node_of: Callable[[Any], Node],
        link_names: Mapping[Any, str],
        world_pose: Callable[[Any], Matrix],
        site_pose: Callable[[Any], Matrix],
    ) -> None:
        import mujoco

        self.mimics: dict[str, Mimic] = {}
        """The mimic of each joint that a linear equality couples to another joint."""

        self.couplings: list[Coupling] = []
        self.loops: list[Loop] = []
        self.tendons: list[Tendon] = []
        self.coupled: set[str] = set()
        """Joints that other joints move through a loop or a fixed tendon."""

        self.left_out: list[str] = []
        """What is not read, one phrase each."""

        self._node_of, self._link_names = node_of, link_names
        self._world_pose, self._site_pose = world_pose, site_pose
        self._driven = {actuator.target for actuator in spec.actuators}
        self._joints = {joint.name: joint for joint in spec.joints if joint.name}
        self._bodies = {body.name: body for body in spec.bodies if body.name}
        self._sites = {site.name: site for site in spec.sites if site.name}
        self._default = mujoco.MjSpec()
        kinds = mujoco.mjtEq
        for number, equality in enumerate(spec.equalities, 1):
            if not equality.active:
                continue
            if equality.type == kinds.mjEQ_JOINT:
                self._read_coupling(equality)
            elif equality.type == kinds.mjEQ_TENDON:
                self._add_coupling("tendon", equality, equality.data[:5])
            elif equality.type in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                self._read_loop(equality, equality.name or f"loop_{number}")
            else:
                self.left_out.append(f"the equality constraint {equality.name or number}")
        for number, tendon in enumerate(spec.tendons, 1):
            self._read_tendon(tendon, tendon.name or f"tendon_{number}")

    def _read_coupling(self, equality: Any) -> None:
        follower, target = (self._joints.get(n) for n in (equality.name1, equality.name2))
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
                settings=settings_of(equality, self._default.add_equality(), _SOLVER),
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
                coefficients=tuple(map(float, coefficients)),
                settings=settings_of(equality, self._default.add_equality(), _SOLVER),
            )
        )

    def _read_loop(self, equality: Any, name: str) -> None:
        import mujoco

        is_weld = equality.type == mujoco.mjtEq.mjEQ_WELD
        settings = settings_of(equality, self._default.add_equality(), _SOLVER)
        if is_weld and equality.data[10] != 1:
            settings["torquescale"] = number_text(equality.data[10])
        if equality.objtype == mujoco.mjtObj.mjOBJ_SITE:
            sites = [self._sites.get(end) for end in (equality.name1, equality.name2)]
            ends = [(site.parent, self._site_pose(site)) for site in sites if site is not None]
        else:
            ends = self._body_ends(equality)
        links = [self._link_names.get(body, WORLD) for body, _ in ends]
        if len(links) < 2 or WORLD in links or links[0] == links[1]:
            self.left_out.append(f"the constraint {name}, which closes no loop of the robot")
            return
        chains = [_ancestors(body) for body, _ in ends]
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
        import mujoco

        bodies = [self._bodies.get(name) for name in (equality.name1, equality.name2)]
        if None in bodies:
            return []
        at_reference = invert_poses(self._world_pose(bodies[0])) @ self._world_pose(bodies[1])
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
        import mujoco

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
                points.append((link, self._site_pose(wrap.target)))
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
    import mujoco

    hinge = joint.type == mujoco.mjtJoint.mjJNT_HINGE
    return float(joint.ref) * (math.pi / 180 if hinge and joint.compiler.degree else 1.0)


def _ancestors(body: Any) -> list[Any]:
    """Return a body and the bodies that carry it, without the world."""
    found = []
    while body is not None and body.parent is not None:
        found.append(body)
        body = body.parent
    return found
