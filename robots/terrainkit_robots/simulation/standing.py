"""Let a robot stand in its pose under position control."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.analysis.bodies.contact import contact_points
from terrainkit_robots.analysis.bodies.kinematics import body_poses
from terrainkit_robots.analysis.cannot_check import CannotCheckError
from terrainkit_robots.analysis.legs.stance import is_statically_stable
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.simulation.gain import Gain
from terrainkit_robots.simulation.rollout import Rollout
from terrainkit_robots.simulation.sim_model import SimModel
from terrainkit_robots.simulation.welding import weld_joints
from terrainkit_robots.transforms import Matrix, invert_poses, quat_to_matrix

if TYPE_CHECKING:
    from terrainkit_robots.analysis.facts import Facts

_DECIMATION = 4
"""Number of steps between observations: 20 ms."""

_FINAL_SECONDS = 0.1
"""A foot that touches the ground within the last tenth of a second touches it at the end [s]."""

MIN_MARGIN = 0.005
"""Distance of the center of mass from the edge of the support that a biped needs to stand with
locked joints [m]; with point feet it does not stand at all."""

_UP = np.array([0.0, 0.0, 1.0])

_FOOT_RADIUS_RATIO = 0.3
"""Radius around the tip that counts as foot if the foot is a part of the shank, over leg length."""


@dataclass(frozen=True, kw_only=True)
class ContactArea:
    """An area of a body that may touch the ground."""

    body: str
    """Name of the body."""

    center: tuple[float, float, float]
    """Center of the contact in the standing pose, in the frame of the body [m]."""

    radius: float
    """Radius of the area [m]; infinite if the whole body is a foot."""

    foot: str
    """Name of the link that is the foot of the leg. A leg may have several areas."""

    leg_length: float
    """Length of the leg [m]."""


@dataclass(frozen=True, kw_only=True)
class StandResult:
    """The motion of a robot that was to stand."""

    tilt: float
    """Angle between the up direction of the base at the start and at the end [rad]."""

    max_tilt: float
    """Largest such angle over time [rad]."""

    height: float
    """Height of the base at the end [m]."""

    height_loss: float
    """Height of the base at the start minus that at the end [m]."""

    drift: float
    """Horizontal distance that the base moved [m]."""

    leg_length: float
    """Length of the shortest leg [m]; infinite without contact areas."""

    other_contacts: tuple[str, ...]
    """Bodies that touched the ground outside of the contact areas, in the order of the bodies."""

    lifted_feet: tuple[str, ...]
    """Feet that did not touch the ground at the end, in the order of the legs."""

    saturation: float
    """Largest torque over effort limit in the second half, in 0..1; 0 if all are unlimited."""

    saturated_joint: str
    """The joint with that torque; empty if all are unlimited."""

    joint_error: float
    """Largest distance of a joint from its target at the end [rad] or [m]."""

    diverged: bool
    """Whether a position, velocity or acceleration was not finite, or huge."""

    seconds: float
    """Simulated time [s]; shorter than requested if the simulation diverged."""


def why_it_balances(facts: "Facts") -> str:
    """Return why a biped does not stand even with locked joints; empty for other robots."""
    if facts.stance is None or is_statically_stable(facts.legs):
        return ""
    if facts.wheels:
        return "it balances on its wheels"
    has_feet = any(body.has_contacts for body in facts.bodies)  # else it falls through the floor
    if has_feet and not facts.stance.margin > MIN_MARGIN:
        return "the center of mass of the biped is not above its feet"
    return ""


def contact_areas(facts: "Facts") -> tuple[ContactArea, ...]:
    """Return where a robot with legs may touch the ground.

    A separate foot link may touch it anywhere. If the foot is a part of the shank, only the tip of
    the shank may.
    """
    if facts.stance is None:
        return ()
    found = []
    poses = body_poses(facts.bodies, facts.default_pose)
    for leg, contact in zip(facts.legs, facts.stance.contacts, strict=True):
        body = facts.bodies[leg.limb.chain[-1]]
        has_ankle = "knee" in leg.roles[:-1]  # the body below an ankle is a foot
        point = invert_poses(poses[body.index]) @ [*contact, 1.0]
        for link, local in zip(body.links, body.poses, strict=True):
            is_foot = has_ankle or (link.name == leg.foot and link is not body.top)
            x, y, z = (invert_poses(local) @ point)[:3].tolist()
            found.append(
                ContactArea(
                    body=link.name,
                    center=(x, y, z),
                    radius=math.inf if is_foot else _FOOT_RADIUS_RATIO * leg.length,
                    foot=leg.foot,
                    leg_length=leg.length,
                )
            )
    return tuple(found)


def ground_normal(facts: "Facts") -> Matrix:
    """Return the mean normal of the soles at the default pose, shape (3,).

    It is in the frame of the trunk. A robot with locked joints and a level trunk tilts until its
    soles are level. Points are level, and so are edges across their length.
    """
    poses = body_poses(facts.bodies, facts.default_pose)
    feet = [leg.limb.chain[-1] for leg in facts.legs]
    soles = [contact_points(facts.bodies[i], poses[i], facts.meshes) for i in feet]
    offsets = np.concatenate([sole - sole.mean(axis=0) for sole in soles] or [np.zeros((1, 3))])
    slope, *_ = np.linalg.lstsq(offsets[:, :2], offsets[:, 2], rcond=1e-3)
    normal = np.array([*-slope, 1.0])
    return np.asarray(normal / np.linalg.norm(normal))


def stand_test(
    sim: SimModel,
    gains: Mapping[str, Gain],
    *,
    positions: Mapping[str, float],
    areas: Sequence[ContactArea] = (),
    seconds: float = 2.0,
    self_collision: bool = True,
    joints_locked: bool = False,
    ground_normal: Matrix = _UP,
) -> StandResult:
    """Simulate a robot that holds its pose.

    Args:
        sim: The robot.
        gains: Gains of each actuated joint.
        positions: Initial position of each joint, and target of its actuator [rad] or [m].
        areas: Where the robot may touch the ground; nowhere by default.
        seconds: Time to simulate [s].
        self_collision: Whether the shapes of the robot collide with each other.
        joints_locked: Whether the joints are welded at their positions.
        ground_normal: Normal of the ground in the frame of the base at the start if the joints are
            locked, shape (3,).

    Raises:
        CannotCheckError: if the base is fixed, or the simulation would take too long.
    """
    if not sim.floating:
        raise CannotCheckError("it does not stand: its base is fixed to the world")
    with quiet_mujoco():
        qpos = sim.qpos_at(positions)
        if joints_locked:
            sim = weld_joints(sim, positions)
            gains = {}
            positions = {}
            qpos = np.concatenate([qpos[:3], _level(ground_normal)])
        rollout = Rollout(sim, gains, self_collision=self_collision)
        # Without a drop, a failure is a failure to stand and not to land.
        rollout.reset(qpos, clearance=0.0)
        return _stand(rollout, positions, areas, seconds)


def _level(normal: Matrix) -> Matrix:
    """Return the quaternion of the shortest rotation that makes a normal vertical, shape (4,)."""
    quat = np.array([1.0 + normal[2], *np.cross(normal, _UP)])
    return np.asarray(quat / np.linalg.norm(quat))


def _stand(
    rollout: Rollout, positions: Mapping[str, float], areas: Sequence[ContactArea], seconds: float
) -> StandResult:
    """Return the motion of a robot that holds joint positions from the current state on."""
    import mujoco

    sim, model, data = rollout.sim, rollout.model, rollout.data
    time_step = float(model.opt.timestep)
    start = data.qpos[:3].copy()
    up = quat_to_matrix(data.qpos[3:7])[:, 2]
    targets = dict(zip(sim.joints, data.qpos[7:], strict=True)) | dict(positions)
    data.ctrl[:] = [targets[name] for name in sim.actuated]
    ranges = model.actuator_forcerange[:, 1]
    limited = (model.actuator_forcelimited != 0) & (ranges > 0)
    efforts = np.where(limited, ranges, np.inf)
    bodies = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, area.body) for area in areas]
    area_of = {body: area for body, area in zip(bodies, areas, strict=True) if body >= 0}

    def tilt() -> float:
        return math.acos(np.clip(up @ quat_to_matrix(data.qpos[3:7])[:, 2], -1.0, 1.0))

    steps = 0
    max_tilt = 0.0
    shares = np.zeros(model.nu)
    other_bodies: set[int] = set()
    contact_feet: set[str] = set()
    for step in rollout.steps(seconds):
        steps = step + 1
        if step % _DECIMATION:
            continue
        time = step * time_step
        max_tilt = max(max_tilt, tilt())
        if 2 * time >= seconds:
            shares = np.maximum(shares, np.abs(data.actuator_force) / efforts)
        for body, point in _floor_contacts(model, data):
            area = area_of.get(body)
            if area is None or not _is_within(area, data, body, point):
                other_bodies.add(body)
            elif time >= seconds - _FINAL_SECONDS:
                contact_feet.add(area.foot)
    motion = data.qpos[:3] - start
    error = np.abs(data.qpos[7:] - [targets[name] for name in sim.joints])
    saturation = float(shares.max(initial=0.0))
    feet = dict.fromkeys(area.foot for area in area_of.values())
    return StandResult(
        tilt=tilt(),
        max_tilt=max(max_tilt, tilt()),
        height=float(data.qpos[2]),
        height_loss=-float(motion[2]),
        drift=float(np.hypot(motion[0], motion[1])),
        leg_length=min((area.leg_length for area in areas), default=math.inf),
        other_contacts=tuple(model.body(body).name for body in sorted(other_bodies)),
        lifted_feet=tuple(foot for foot in feet if foot not in contact_feet),
        saturation=saturation,
        saturated_joint=sim.actuated[int(shares.argmax())] if saturation > 0 else "",
        joint_error=float(error.max(initial=0.0)),
        diverged=rollout.diverged,
        seconds=steps * time_step,
    )


def _floor_contacts(model: Any, data: Any) -> Iterator[tuple[int, Any]]:
    """Yield each contact with the floor: the body, and the point in the world, shape (3,) [m]."""
    pairs = model.geom_bodyid[data.contact.geom]
    for contact in np.flatnonzero((pairs == 0).any(axis=1)):
        yield int(pairs[contact].max()), data.contact.pos[contact]


def _is_within(area: ContactArea, data: Any, body: int, point: Any) -> bool:
    if math.isinf(area.radius):
        return True
    center = data.xpos[body] + data.xmat[body].reshape(3, 3) @ area.center
    return bool(np.linalg.norm(point - center) <= area.radius)
