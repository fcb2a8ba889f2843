"""The robot as arrays: its spec in the order of joints, feet and bodies that training uses."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.spec.per_joint import match_joints
from terrainkit_robots.spec.robot_spec import RobotSpec
from terrainkit_robots.spec.spec_file import read_spec

FloatArray = NDArray[np.float32]

SPEC_FILE = "robot.toml"
"""Name of a robot's spec in its folder."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """A robot to train, j joints in the order of its actions."""

    spec: RobotSpec
    """What training needs to know of it."""

    mjcf: Path
    """Its MuJoCo model."""

    default_pose: FloatArray
    """Position of each joint that actions are added to [rad], shape (j,)."""

    wheels: NDArray[np.bool_]
    """Joints with damping and no stiffness, which stay nowhere, shape (j,)."""

    effort: FloatArray
    """Largest torque of each joint [N m], shape (j,)."""

    velocity: FloatArray
    """Largest speed of each joint [rad/s], shape (j,)."""

    lower: FloatArray
    """Lower soft limit of each joint [rad], -inf without one, shape (j,)."""

    upper: FloatArray
    """Upper soft limit of each joint [rad], shape (j,)."""


def robot_of(spec: RobotSpec, folder: Path) -> Robot:
    """Return the robot that a spec in `folder` describes.

    Raises:
        ConfigError: if the spec does not name every joint, or lacks what training needs.
    """
    if not spec.floating:
        raise ConfigError(f"{spec.name} has a fixed base; wanted a robot that moves freely")
    if not spec.feet:
        raise ConfigError(f"{spec.name} has no feet in its spec; wanted one for each leg")
    if spec.spawn_height is None or spec.base_height_target is None:
        raise ConfigError(
            f"the spec of {spec.name} lacks spawn_height or base_height_target; "
            "terrainkit onboard measures both"
        )
    soft = match_joints(spec.soft_limits, spec.joint_order).values
    limits = [soft.get(name, (-np.inf, np.inf)) for name in spec.joint_order]
    return Robot(
        spec=spec,
        mjcf=folder / spec.mjcf,
        default_pose=_array(spec, "default_pose"),
        wheels=(_array(spec, "stiffness") == 0) & (_array(spec, "damping") > 0),
        effort=_array(spec, "effort"),
        velocity=_array(spec, "velocity"),
        lower=np.array([low for low, _ in limits], np.float32),
        upper=np.array([high for _, high in limits], np.float32),
    )


def read_robot(folder: Path) -> Robot:
    """Return the robot in an onboarded folder.

    Raises:
        ConfigError: if it has no robot.toml, or one that cannot be trained.
    """
    if not (folder / SPEC_FILE).exists():
        raise ConfigError(
            f"{folder} has no {SPEC_FILE}; wanted a folder that terrainkit onboard wrote"
        )
    return robot_of(read_spec(folder / SPEC_FILE), folder)


def _array(spec: RobotSpec, table: str) -> FloatArray:
    return np.array(list(spec.per_joint(table).values()), np.float32)
