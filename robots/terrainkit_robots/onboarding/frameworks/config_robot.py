"""The robot that is configured: its spec, and what the frameworks ask of it."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import median
from typing import Literal, TypeVar

from terrainkit.errors import ConfigError, listing
from terrainkit_robots.onboarding.frameworks.source import comment, number
from terrainkit_robots.spec.per_joint import by_joint, match_joints
from terrainkit_robots.spec.robot_spec import RobotSpec, unit_of
from terrainkit_robots.text import short

_Value = TypeVar("_Value")

USUAL_SOFT_FACTOR = 0.9
"""Share of a joint's range that rewards leave free, where the ranges are not given; what
legged_gym and Isaac Lab use for their own robots."""


@dataclass(frozen=True, kw_only=True)
class ConfigRobot:
    """A robot, as a configuration is written of it."""

    spec: RobotSpec

    bodies: Sequence[str] = ()
    """Every body there is once fixed joints are merged; if empty, those that the spec names."""

    limits: Mapping[str, tuple[float, float]] | None = None
    """Lower and upper limit of joints, as the URDF has them; None if they are not known."""

    unactuated: Sequence[str] = ()
    """Joints of the URDF that move and have no motor: they follow another, or swing."""

    @property
    def title(self) -> str:
        """Return what to call the robot in a message or a sentence."""
        return short(re.sub(r"[^\w .+-]", "_", self.spec.name).strip() or "the robot", 60)

    @cached_property
    def all_bodies(self) -> tuple[str, ...]:
        """Return every body."""
        spec = self.spec
        named = (spec.base, *spec.feet, *spec.shanks, *spec.thighs)
        contacts = (*spec.termination_contacts, *spec.penalized_contacts)
        return tuple(dict.fromkeys(self.bodies or (*named, *contacts)))

    @cached_property
    def soft_factor(self) -> float:
        """Return the share of the joints' ranges that rewards leave free, between 0 and 1."""
        soft = self._matched("soft_limits", self.spec.soft_limits)
        shares = []
        for joint, (lower, upper) in (self.limits or {}).items():
            if joint in soft and upper > lower:
                shares.append((soft[joint][1] - soft[joint][0]) / (upper - lower))
        share = median(shares) if shares else USUAL_SOFT_FACTOR
        return round(share, 4) if 0 < share <= 1 else 1.0

    @cached_property
    def velocity_joints(self) -> tuple[str, ...]:
        """Return the joints that are told a speed: what has damping alone stays nowhere.

        Raises:
            ConfigError: if a joint has no stiffness or damping, not even 0.
        """
        stiffness, damping = map(self.of_every_joint, ("stiffness", "damping"))
        return tuple(
            joint for joint in self.spec.joint_order if stiffness[joint] == 0 < damping[joint]
        )

    @cached_property
    def position_joints(self) -> tuple[str, ...]:
        """Return the joints that are told a position: all but wheels."""
        return tuple(joint for joint in self.spec.joint_order if joint not in self.velocity_joints)

    def by_joint(self, name: str) -> dict[str, float]:
        """Return the table `name` of the spec by joint, in their order; joints may be missing.

        Raises:
            ConfigError: if two keys match a joint, or one matches none.
        """
        return self._matched(name, getattr(self.spec, name))

    def of_every_joint(self, name: str) -> dict[str, float]:
        """Return the table `name` of the spec by joint, which has to have them all.

        Raises:
            ConfigError: if a joint is not matched exactly once, or a key matches none.
        """
        return by_joint(getattr(self.spec, name), self.spec.joint_order, name)

    def _matched(self, name: str, table: Mapping[str, _Value]) -> dict[str, _Value]:
        matching = match_joints(table, self.spec.joint_order)
        for clash in matching.clashes(name, partial=True):
            raise ConfigError(clash.message)
        return dict(matching.values)

    def origin(self, name: str, *, depth: int = 0, what: str = "", unit: str = "") -> list[str]:
        """Return a comment on the field `name`: its unit, and where its value came from.

        Args:
            name: The field.
            depth: How far the comment will be indented, in steps of four.
            what: What comes first.
            unit: The unit, if it is not that of the field.
        """
        unit, source = unit or unit_of(name), self.spec.provenance.get(name)
        text = " ".join(part for part in (what, unit and f"[{unit}]") if part)
        if source is not None:
            text += f"; {source.origin}" + (f": {source.reason}" if source.reason else "")
        return comment(text, depth=depth)

    def soft_limits(self, *, depth: int = 0) -> list[str]:
        """Return a comment on `soft_factor`."""
        text = "Share of each joint's range that rewards leave free"
        more = ", the median" if self.limits else ""
        return comment(f"{text}{more}; limits by joint are in robot.toml.", depth=depth)

    def scales(self, joints: Iterable[str]) -> dict[str, float]:
        """Return the action scale of joints: `placed` ones, or wheels."""
        found = self.of_every_joint("action_scale")
        return {joint: found[joint] for joint in joints}

    def speed_origin(self, *, depth: int = 0) -> list[str]:
        """Return a comment on the action scales of wheels."""
        return self.origin("action_scale", depth=depth, unit=unit_of("velocity"))

    def one_for_all(
        self, values: Iterable[float], choice: Literal["median", "largest"], *, depth: int = 0
    ) -> tuple[float, list[str]]:
        """Return the median or the largest of the joints' values, and a comment if they differ."""
        listed = list(values) or [0.0]
        lowest, highest = number(min(listed)), number(max(listed))
        chosen = max(listed) if choice == "largest" else median(listed)
        if lowest == highest:
            return chosen, []
        remark = f"One number for all joints, the {choice}: they have {lowest} to {highest}."
        return chosen, comment(remark, depth=depth)

    def known(self, names: Iterable[str], what: str) -> tuple[str, ...]:
        """Return the names, which have to be bodies.

        Raises:
            ConfigError: if one is not a body.
        """
        listed = tuple(dict.fromkeys(names))
        unknown = [name for name in listed if name not in self.all_bodies]
        if unknown:
            raise ConfigError(
                f"{what} of {self.title} are no bodies: {listing(map(repr, unknown))}; "
                f"there are: {listing(map(repr, self.all_bodies))}"
            )
        return listed
