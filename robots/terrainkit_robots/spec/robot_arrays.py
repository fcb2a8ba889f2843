"""A robot to train: its spec as arrays."""

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.spec.robot_spec import RobotSpec

FloatArray = NDArray[np.float32]

SPEC_FILE = "robot.toml"
"""File name of the spec in a robot's folder."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """A robot as arrays, with j joints in the order of its spec."""

    spec: RobotSpec
    """Its spec."""
    mjcf: Path
    """Its MuJoCo model."""
    default_pose: FloatArray
    """Default joint positions [rad], shape (j,)."""
    wheels: NDArray[np.bool_]
    """Joints with damping but no stiffness, shape (j,)."""
    action_scale: FloatArray
    """Change of each joint's target for an action of 1, shape (j,): a position [rad], or the speed
    of a wheel [rad/s]. A joint with 0 has no action."""
    effort: FloatArray
    """Torque limits [N m], shape (j,)."""
    velocity: FloatArray
    """Velocity limits [rad/s], shape (j,)."""
    lower: FloatArray
    """Lower soft limits [rad], -inf without one, shape (j,)."""
    upper: FloatArray
    """Upper soft limits [rad], shape (j,)."""

    @property
    def leg_length(self) -> float:
        """Length of the legs [m], or the height of the base if it is unknown."""
        return self.spec.leg_length or self.base_height_target

    @property
    def base_height_target(self) -> float:
        """Height of the standing base above the ground [m]."""
        return cast("float", self.spec.base_height_target)  # `from_spec` requires it

    @property
    def spawn_height(self) -> float:
        """Height of the base above the ground at a reset [m]."""
        return cast("float", self.spec.spawn_height)  # `from_spec` requires it

    @property
    def folder(self) -> Path:
        """Folder of its files."""
        return self.mjcf.parents[len(Path(self.spec.mjcf).parts) - 1]

    @classmethod
    def from_spec(cls, spec: RobotSpec, folder: Path) -> "Robot":
        """Return the robot that a spec describes.

        Args:
            spec: The spec.
            folder: Folder that its files are relative to.

        Raises:
            ConfigError: If the base is fixed, or the spec lacks a value that training needs.
        """
        if not spec.floating:
            raise ConfigError(f"base of {spec.name}: got a fixed base; expected a floating base")
        if not spec.feet:
            raise ConfigError(f"feet of {spec.name}: got none; expected one for each leg")
        if spec.spawn_height is None or spec.base_height_target is None:
            raise ConfigError(
                f"the spec of {spec.name} lacks spawn_height or base_height_target; "
                "terrainkit onboard measures both"
            )

        soft = match_joints(spec.soft_limits, spec.joint_order).values
        limits = [soft.get(name, (-np.inf, np.inf)) for name in spec.joint_order]
        lower, upper = np.array(limits, np.float32).T
        return cls(
            spec=spec,
            mjcf=folder / spec.mjcf,
            default_pose=spec.joint_array("default_pose"),
            wheels=(spec.joint_array("stiffness") == 0) & (spec.joint_array("damping") > 0),
            action_scale=spec.joint_array("action_scale"),
            effort=spec.joint_array("effort"),
            velocity=spec.joint_array("velocity"),
            lower=lower,
            upper=upper,
        )

    @classmethod
    def load(cls, folder: Path) -> "Robot":
        """Load the robot in an onboarded folder; raise ConfigError if there is none."""
        return cls.from_spec(RobotSpec.load(folder / SPEC_FILE), folder)
