"""Derive the limits of a robot for feasibility from its spec and its model in the default pose."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from terrainkit.errors import ConfigError, one_line
from terrainkit.feasibility.crossing_limits import RobotLimits
from terrainkit.integrations.near_geoms import collides
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.geoms import box_corners, only_visual
from terrainkit_robots.spec.robot_arrays import SPEC_FILE
from terrainkit_robots.spec.robot_spec import RobotSpec

STEP_UP = 0.4
"""Highest step up, in leg lengths. A leg folds to about half of its length, and the foot has to
clear the edge."""

STEP_DOWN = 0.5
"""Highest step down, in leg lengths. The leg reaches down as far as the other legs fold."""

# 2 sin(20 degrees) = 0.68.
GAP = 0.7
"""Widest gap, in leg lengths: the chord of a leg that swings 20 degrees to the front and to the
back, a long step without a flight phase."""

# tan(30 degrees); the friction angle at a coefficient of 1 is 45 degrees.
SLOPE = 0.577
"""Steepest slope, as rise over run: 30 degrees, two thirds of the friction angle at a friction
coefficient of 1."""

FOOTHOLD = 4.0
"""Diameter of the smallest foothold, in foot radii: the foot, and an error of one radius to each
side."""

CROUCH = 0.4
"""Difference of the standing and the crouched height, in leg lengths; as far as a foot is lifted,
the body is lowered."""


@dataclass(frozen=True, kw_only=True)
class DerivedLimits:
    """The limits of a robot, and where they come from."""

    robot: str
    """Name of the robot."""

    limits: RobotLimits
    """The limits."""

    reasons: Mapping[str, str]
    """Origin of each limit by name."""


def derive_limits(folder: Path, overrides: Mapping[str, float] | None = None) -> DerivedLimits:
    """Return the limits of the robot in an onboarded folder.

    Args:
        folder: Folder with `robot.toml` and the MJCF file that it names.
        overrides: Limits that replace the derived limits, by name.

    Raises:
        ConfigError: if the spec has no legs, leg length or foot radius, the MJCF file cannot be
            loaded, or a limit is invalid.
    """
    spec = RobotSpec.load(folder / SPEC_FILE)
    if not spec.feet:
        raise ConfigError(f"feet of {spec.name}: got none; expected one for each leg")
    leg, foot = _length(spec, "leg_length"), _length(spec, "foot_radius")
    length, width, height, center = _extents(spec, folder / spec.mjcf)
    about_leg = f"leg_length ({leg:g} m)"
    values = {
        "step_up": (STEP_UP * leg, f"{STEP_UP:g} x {about_leg}"),
        "step_down": (STEP_DOWN * leg, f"{STEP_DOWN:g} x {about_leg}"),
        "gap": (GAP * leg, f"{GAP:g} x {about_leg}"),
        "slope": (SLOPE, "30 degrees"),
        "friction": (RobotLimits.friction, "of the friction coefficient; a foot slides above 1"),
        "foothold": (FOOTHOLD * foot, f"{FOOTHOLD:g} x foot_radius ({foot:g} m)"),
        "body_width": (width, "width of the shapes in the default pose"),
        "standing_height": (height, "height of the shapes in the default pose"),
        "crouched_height": (
            max(height - CROUCH * leg, height / 2),
            f"standing_height - {CROUCH:g} x {about_leg}, at least half of it",
        ),
        "body_length": (length, "length of the shapes in the default pose"),
    }
    is_wheel = (spec.joint_array("stiffness") == 0) & (spec.joint_array("damping") > 0)
    if np.count_nonzero(is_wheel) >= len(spec.feet):
        values |= _wheel_limits(foot, (spec.stance_width or width) / 2 / center)
    limits = RobotLimits(**{name: round(value, 6) for name, (value, _) in values.items()})
    reasons = {name: reason for name, (_, reason) in values.items()}
    given = dict(overrides or {})
    return DerivedLimits(
        robot=spec.name,
        limits=replace(limits, **given),
        reasons=reasons | dict.fromkeys(given, "given"),
    )


def _wheel_limits(radius: float, tipping: float) -> dict[str, tuple[float, str]]:
    """Return the limits that differ on wheels, and their reasons.

    A wheel does not climb an edge above its axle, and it drops by 13 % of its radius into a gap of
    one radius, which it can climb. On a steeper slope than `tipping`, the robot tips over sideways.
    """
    names = ("step_up", "step_down", "gap", "foothold")
    limits = dict.fromkeys(names, (radius, f"radius of the wheels ({radius:g} m)"))
    slope = min(SLOPE, tipping), "30 degrees, or half of the track over the height of the mass"
    return limits | {"slope": slope}


def _length(spec: RobotSpec, name: str) -> float:
    value = getattr(spec, name)
    if not value:
        raise ConfigError(f"{name} of {spec.name}: got {value or 0:g} m; expected a length above 0")
    return float(value)


def _extents(spec: RobotSpec, mjcf: Path) -> tuple[float, float, float, float]:
    """Return length, width and height of the robot in the default pose [m].

    A body without collision shapes counts with its visual ones. The last value is the height of
    the center of mass above the lowest point [m].
    """
    import mujoco

    if not mjcf.is_file():
        raise ConfigError(f"mjcf of {spec.name}: got {mjcf}, which does not exist")
    try:
        with quiet_mujoco():
            model = mujoco.MjModel.from_xml_path(str(mjcf))
    except ValueError as error:
        reason = one_line(str(error))
        raise ConfigError(f"mjcf of {spec.name}: {mjcf} cannot be loaded: {reason}") from error
    data = mujoco.MjData(model)
    for name, position in spec.per_joint("default_pose").items():
        joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
        if joint < 0:
            raise ConfigError(f"mjcf of {spec.name}: {mjcf} has no joint {name}")
        data.qpos[model.jnt_qposadr[joint]] = position
    mujoco.mj_kinematics(model, data)
    is_shape = collides(model) | only_visual(model)
    geoms = np.flatnonzero(is_shape & (model.geom_bodyid > 0))
    if not len(geoms):
        raise ConfigError("mjcf: got a robot without geoms; expected at least one")
    mujoco.mj_comPos(model, data)
    corners = box_corners(model, data, geoms)
    length, width, height = np.ptp(corners, axis=0).tolist()
    return length, width, height, float(data.subtree_com[0, 2] - corners[:, 2].min())
