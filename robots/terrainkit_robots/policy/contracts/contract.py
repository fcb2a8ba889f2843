"""The contract of a policy: joints, gains, scales and observation terms, in any format."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from terrainkit.errors import ConfigError, listing
from terrainkit.settings.text import truncate

TERM_NAMES: dict[str, tuple[str, ...]] = {
    "base_lin_vel": ("base_lin_vel", "base_lin_vel"),
    "base_ang_vel": ("base_ang_vel", "base_ang_vel"),
    "projected_gravity": ("projected_gravity", "projected_gravity"),
    "xyzw_projected_gravity": ("xyzw_projected_gravity", "xyzw_projected_gravity"),
    "commands": ("velocity_commands", "command", "commands", "base_velocity"),
    "dof_pos": ("joint_pos_rel", "joint_pos", "dof_pos"),
    "absolute_dof_pos": ("joint_pos", "absolute_joint_pos"),
    "dof_vel": ("joint_vel_rel", "joint_vel", "dof_vel"),
    "actions": ("last_action", "actions", "action"),
    "gait_phase": ("moving_gait_phase", "moving_gait_phase"),
    "running_gait_phase": ("gait_phase", "gait_phase", "phase"),
    "foot_contact": ("foot_contact", "foot_contact"),
    "height_scan": ("height_scan_by_x", "height_scan_by_x"),
    "grid_height_scan": ("height_scan", "height_scan", "height_scanner"),
}
"""Names of each term: in Unitree's `deploy.yaml`, in mjlab, and in other projects. `joint_pos` is
absolute in the first and relative in the second. Where terrainkit's term differs from the term of
that name, it has a name that no reader knows, so that a reader stops: its gait phase is 0 while
the robot is commanded to stand, and the points of its height scan are ordered by x first."""

UNITREE, MJLAB = 0, 1
"""Positions of the names of the two formats."""

PER_JOINT = "default_pose", "stiffness", "damping", "action_scale", "action_offset"
"""Fields of a contract with one number for each joint."""

DEFAULT_STEP_DT = 0.02
"""Time between two actions where a format does not state it [s], as in mjlab's and Isaac Lab's
tasks."""

MAX_HISTORY = 100
"""Longest history [steps], as `observations.history_length` allows."""

COMMAND_NAMES = {"lin_vel_x": "lin_vel_x", "lin_vel_y": "lin_vel_y", "ang_vel_z": "ang_vel_yaw"}
"""terrainkit's name of each range of commands."""

FORMATS = "deploy.yaml", "metadata of mjlab"

KNOWN_TERMS = (
    "base_ang_vel projected_gravity velocity_commands joint_pos_rel joint_vel_rel last_action "
    "gait_phase joint_pos",
    "base_lin_vel base_ang_vel projected_gravity command joint_pos joint_vel actions height_scan",
)
"""Terms of Unitree's controllers, and of mjlab's velocity task."""


class ContractError(ConfigError):
    """A contract does not fit: `got` is what it has, and `expected` what it should have."""

    def __init__(self, got: str, expected: str = "") -> None:
        super().__init__(f"{got}; expected {expected}" if expected else got)
        self.got, self.expected = got, expected


@dataclass(frozen=True, kw_only=True)
class ContractTerm:
    """An observation term: (clip(value - offset, *clip)) * scale, at the last `history` steps."""

    name: str
    """Its name in its project."""

    scale: tuple[float, ...] = (1.0,)
    """A factor, or one for each number."""

    clip: tuple[float, float] | None = None
    """Limits before the scale."""

    history: int = 1
    """Number of steps, the current one included; the oldest comes first."""

    columns: tuple[int, ...] = ()
    """Order of its numbers, if it is another one."""

    params: Mapping[str, float] = field(default_factory=dict)
    """Parameters: `period` of a gait phase [s], `offset` of a height scan [m]."""


@dataclass(frozen=True, kw_only=True)
class Contract:
    """What a policy observes and what its actions do. Arrays are in the order of `joints`."""

    style: int
    """Format, which decides the meaning of the names of the terms: `UNITREE` or `MJLAB`."""

    joints: tuple[str, ...]
    """Joints of the policy; a robot's other joints keep their default position."""

    default_pose: tuple[float, ...]
    """Position that is observed as 0 [rad]."""

    stiffness: tuple[float, ...]
    """P gains [N m/rad]."""

    damping: tuple[float, ...]
    """D gains [N m s/rad]."""

    action_scale: tuple[float, ...]
    """Factor from action to target [rad]."""

    action_offset: tuple[float, ...]
    """Target of the action 0 [rad]."""

    target_limits: tuple[tuple[float, float], ...] = ()
    """Limits of the targets [rad]; empty for none."""

    terms: tuple[ContractTerm, ...]
    """Observation terms in order."""

    is_interleaved: bool = False
    """Whether the history consists of whole observations, and not of whole terms."""

    newest_first: bool = False
    """Whether the history begins with the current step; no format states it."""

    step_dt: float | None = None
    """Time between two actions [s]; None if the format does not state it: 0.02 s."""

    physics_dt: float | None = None
    """Time step of the simulation of the training [s]; None if it is not stated."""

    commands: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Ranges by the names in `COMMAND_NAMES` [m/s, rad/s]."""

    doubts: tuple[ContractError, ...] = ()
    """What is doubtful in the file, but can be read."""

    def __post_init__(self) -> None:
        """Check that there is one value for each joint, and at least one term.

        Raises:
            ConfigError: If a list has another length.
        """
        if len(set(self.joints)) != len(self.joints) or not self.joints or not self.terms:
            got = f"got {len(self.joints)} joints, {len(self.terms)} observation terms"
            raise ConfigError(f"{got}; expected at least one each, and no joint twice")
        for name in PER_JOINT:
            check_length(name, getattr(self, name), len(self.joints))
        if self.target_limits:
            check_length("clip of the action", self.target_limits, len(self.joints))
        numbers = [*self.default_pose, *self.stiffness, *self.damping, *self.action_scale]
        for term in self.terms:
            numbers += [*term.scale, *term.params.values()]
            is_valid = bool(term.scale) and 1 <= term.history <= MAX_HISTORY
            is_valid &= term.params.get("period", 1.0) > 0
            if not is_valid or (term.clip and not term.clip[0] < term.clip[1]):
                got = f"got scale {term.scale}, history {term.history}, {dict(term.params)}"
                expected = f"expected numbers, a history up to {MAX_HISTORY}, a period above 0"
                raise ConfigError(f"observation term {term.name}: {truncate(got, 150)}; {expected}")
        step = DEFAULT_STEP_DT if self.step_dt is None else self.step_dt
        if not all(map(math.isfinite, numbers)) or not 1e-3 <= step <= 60:
            got = f"got step_dt {step:g}, or a value that is not finite"
            raise ConfigError(f"{got}; expected finite numbers, and a step of 0.001 s or more")
        if not all(low <= high for low, high in self.target_limits):
            raise ConfigError("clip of the action: got limits in the other order; expected [-1, 1]")


def check_length(name: str, values: Sequence[object], expected: int) -> None:
    """Raise a ConfigError if there is not one value for each joint."""
    if len(values) != expected:
        got = f"got {len(values)} values for {expected} joints"
        raise ConfigError(f"{name}: {got}; expected one for each joint, such as [0.5, 0.5, ...]")


def own_name(style: int, name: str, others: Sequence[str]) -> str:
    """Return terrainkit's name of a term.

    Args:
        style: Format of the name.
        name: Its name there.
        others: Names of terms of the environment, which a task file may add.

    Raises:
        ContractError: If the term is unknown.
    """
    for first in (True, False):  # the name in its own format decides
        for own, names in TERM_NAMES.items():
            if name in ((names[style],) if first else names):
                return own
    if name in others:
        return name
    known = listing(dict.fromkeys(names[style] for names in TERM_NAMES.values()))
    own = "observation_terms of the environment of a task file, given with --task FILE.py"
    raise ContractError(
        f"observation term {truncate(repr(name))}: unknown",
        f"one of {known}, or a term of this name in the {own}",
    )
