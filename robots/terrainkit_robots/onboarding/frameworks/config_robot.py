"""The robot for which a configuration is written: its spec, bodies and joint limits."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from statistics import median
from typing import Literal, TypeVar

from terrainkit.errors import ConfigError, listing
from terrainkit.settings.text import truncate
from terrainkit_robots.onboarding.frameworks.source import (
    comment,
    dict_entries,
    float_literal,
    format_collection,
)
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.spec.robot_spec import RobotSpec, unit_of

_Value = TypeVar("_Value")

_OPTIONAL = frozenset({"effort", "velocity", "armature", "soft_limits"})
"""Fields of the spec that joints may lack."""

DEFAULT_SOFT_LIMIT_FACTOR = 0.9
"""Soft limit factor of robots with unknown joint limits, as in legged_gym and Isaac Lab."""


@dataclass(frozen=True, kw_only=True)
class ConfigRobot:
    """A robot for which a configuration is written."""

    spec: RobotSpec

    bodies: Sequence[str] = ()
    """Names of all bodies after fixed joints are merged; if empty, the bodies in the spec."""

    limits: Mapping[str, tuple[float, float]] | None = None
    """Lower and upper limit of each joint in the URDF; None if unknown."""

    passive_joints: Sequence[str] = ()
    """Movable joints of the URDF without an actuator, such as mimic joints."""

    sites: Sequence[str] = ()
    """Names of the sites in robot.xml."""

    roles: Mapping[str, str] = field(default_factory=dict)
    """Role of each joint of the legs, such as hip, knee or ankle."""

    foot_height: float = 0.0
    """Height of the frames of the feet above the ground when the robot stands [m]."""

    has_fixed_feet: bool = False
    """Whether the feet are bodies on fixed joints, which are not merged."""

    has_map: bool = False
    """Whether the robot is trained on a map, in terrain.py beside the configuration."""

    @property
    def title(self) -> str:
        """Return the name of the robot for messages."""
        return truncate(re.sub(r"[^\w .+-]", "_", self.spec.name).strip() or "the robot", 60)

    @property
    def all_joints(self) -> tuple[str, ...]:
        """Return the names of all movable joints, which patterns have to tell apart."""
        return (*self.spec.joint_order, *self.passive_joints)

    @cached_property
    def all_bodies(self) -> tuple[str, ...]:
        """Return the names of all known bodies."""
        spec = self.spec
        named = (spec.base, *spec.feet, *spec.shanks, *spec.thighs)
        contacts = (*spec.termination_contacts, *spec.penalized_contacts)
        return tuple(dict.fromkeys(self.bodies or (*named, *contacts)))

    @cached_property
    def soft_limit_factor(self) -> float:
        """Return the median share of the joint ranges within the soft limits, from 0 to 1."""
        soft_limits = self._match("soft_limits", self.spec.soft_limits)
        factors = []
        for joint, (lower, upper) in (self.limits or {}).items():
            if joint in soft_limits and upper > lower:
                soft_lower, soft_upper = soft_limits[joint]
                factors.append((soft_upper - soft_lower) / (upper - lower))
        factor = median(factors) if factors else DEFAULT_SOFT_LIMIT_FACTOR
        return round(factor, 2) if 0 < factor <= 1 else 1.0

    @cached_property
    def velocity_joints(self) -> tuple[str, ...]:
        """Return the joints with velocity targets, such as wheels: damping, but no stiffness.

        Raises:
            ConfigError: if the stiffness or damping of a joint is missing.
        """
        stiffness, damping = map(self.joint_values, ("stiffness", "damping"))
        return tuple(
            joint for joint in self.spec.joint_order if stiffness[joint] == 0 < damping[joint]
        )

    @cached_property
    def position_joints(self) -> tuple[str, ...]:
        """Return the joints with position targets."""
        return tuple(joint for joint in self.spec.joint_order if joint not in self.velocity_joints)

    def joint_values(self, field: str) -> dict[str, float]:
        """Return the values of a field of the spec by joint.

        Raises:
            ConfigError: if two keys match a joint, a key matches no joint, or a joint has no value,
                unless frameworks do without it.
        """
        return self._match(field, getattr(self.spec, field))

    def _match(self, field: str, values: Mapping[str, _Value]) -> dict[str, _Value]:
        matching = match_joints(values, self.spec.joint_order)
        for error in matching.errors(field, partial=field in _OPTIONAL):
            raise ConfigError(error.message)
        return dict(matching.values)

    def provenance_comment(
        self, field: str, *, depth: int = 0, prefix: str = "", unit: str = ""
    ) -> list[str]:
        """Return a comment with the unit and the provenance of a field.

        Args:
            field: Name of the field of the spec.
            depth: Indentation of the comment, in steps of four spaces.
            prefix: Text before the unit.
            unit: Unit, by default the unit of the field.
        """
        unit = unit or unit_of(field)
        source = self.spec.provenance.get(field)
        text = " ".join(part for part in (prefix, unit and f"[{unit}]") if part)
        if source is not None:
            text += f"; {source.origin}" + (f": {source.reason}" if source.reason else "")
        return comment(text, depth=depth)

    def velocity_scale_comment(self, *, depth: int = 0) -> list[str]:
        """Return a comment on the action scales of joints with velocity targets."""
        return self.provenance_comment("action_scale", depth=depth, unit=unit_of("velocity"))

    def soft_limit_comment(self, *, depth: int = 0) -> list[str]:
        """Return a comment on `soft_limit_factor`."""
        median_of = ", median over joints" if self.limits else ""
        text = f"Share of the joint range within the soft limits{median_of}"
        return comment(f"{text}; soft limits by joint are in robot.toml.", depth=depth)

    def action_scales(self, joints: Iterable[str]) -> dict[str, float]:
        """Return the action scales of some joints."""
        scales = self.joint_values("action_scale")
        return {joint: scales[joint] for joint in joints}

    def scale_table(self, name: str, target: Literal["position", "velocity"]) -> list[str]:
        """Return the statement with the action scales of the joints with a kind of target."""
        joints, origin = self.position_joints, self.provenance_comment("action_scale")
        if target == "velocity":
            joints, origin = self.velocity_joints, self.velocity_scale_comment()
        entries = dict_entries(self.action_scales(joints))
        heading = f"# Change of the {target} target for an action of 1."
        return ["", heading, *origin, *format_collection(f"{name} = ", entries, "{}")]

    def shared_value(
        self, values: Iterable[float], kind: Literal["median", "largest"], *, depth: int = 0
    ) -> tuple[float, list[str]]:
        """Return one value for all joints, and a comment if the values differ.

        Args:
            values: Values of the joints.
            kind: Which value to return.
            depth: Indentation of the comment, in steps of four spaces.
        """
        values = list(values) or [0.0]
        lowest, highest = float_literal(min(values)), float_literal(max(values))
        value = max(values) if kind == "largest" else median(values)
        if lowest == highest:
            return value, []
        text = f"One value for all joints, the {kind} of {lowest} to {highest}."
        return value, comment(text, depth=depth)

    def check_bodies(self, bodies: Iterable[str], field: str) -> tuple[str, ...]:
        """Return names of bodies without duplicates.

        Args:
            bodies: Names of bodies.
            field: Field of the spec that has them, for the error.

        Raises:
            ConfigError: if a name is not a body.
        """
        bodies = tuple(dict.fromkeys(bodies))
        unknown = [name for name in bodies if name not in self.all_bodies]
        if unknown:
            raise ConfigError(
                f"{field} of {self.title}: got unknown bodies {listing(map(repr, unknown))}; "
                f"expected {listing(map(repr, self.all_bodies))}"
            )
        return bodies
