"""Events: reset states, pushes, and the parameters that differ between simulated robots."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terrainkit.errors import ConfigError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.simulation import Ids, Simulation
from terrainkit_robots.transforms import FloatArray

if TYPE_CHECKING:
    from terrainkit_robots.rl.env import LeggedEnv

MAX_RESET_RELIEF = 0.06
"""Height range of the ground under a robot that is not reset exactly at its origin [m]."""

MAX_PUSH, BIPED_MAX_PUSH = 0.6, 0.29
"""Default of the largest velocity that a push adds along x and along y, in units of
sqrt(g leg length): 1.26 m/s for the bundled quadruped, 0.76 m/s for two legs of 0.7 m."""


@dataclass(frozen=True, kw_only=True)
class EventTerm:
    """What happens to the robots besides their actions. Functions take the environment."""

    startup: Callable[["LeggedEnv"], object] | None = None
    """Called once, before the first episodes."""

    reset: Callable[["LeggedEnv", Ids], object] | None = None
    """Called with the environments whose episodes start, sorted, shape (k,)."""

    step: Callable[["LeggedEnv"], object] | None = None
    """Called before each step of the policy."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RandomizedParams:
    """Physical parameters of n robots with g colliding geoms and j joints."""

    friction: FloatArray  # mean contact friction, shape (n, 1)
    geom_friction: FloatArray  # friction of each colliding geom, shape (n, g)
    added_mass: FloatArray  # mass added to the base [kg], shape (n, 1)
    com_shift: FloatArray  # shift of the base's center of mass [m], shape (n, 3)
    stiffness: FloatArray  # factor on the stiffness of each joint, shape (n, j)
    damping: FloatArray  # factor on the damping of each joint, shape (n, j)
    strength: FloatArray  # factor on all torques, shape (n, 1)


def sample_params(env: "LeggedEnv") -> RandomizedParams:
    """Sample the physical parameters of all robots."""
    cfg, scene, num_envs, rng = env.cfg.domain_rand, env.scene, env.num_envs, env.rng
    joints = scene.model.nu
    nominal = scene.model.geom_friction[scene.geoms, 0].astype(np.float32)
    mass = scene.model.body_subtreemass[scene.base].astype(np.float32)

    def uniform(limits: tuple[float, float] | None, width: int, default: float) -> FloatArray:
        low, high = limits or (default, default)
        return rng.uniform(low, high, (num_envs, width)).astype(np.float32)

    shifts = cfg.com_pos_x_range, cfg.com_pos_y_range, cfg.com_pos_z_range
    low, high = np.array([limits or (-cfg.com_shift, cfg.com_shift) for limits in shifts]).T
    mass_unit = 1.0 if cfg.added_mass_range else mass
    friction = uniform(cfg.friction, 1, float(nominal.mean()) if len(nominal) else 1.0)
    geom_friction = nominal if cfg.friction is None else friction
    return RandomizedParams(
        friction=friction,
        geom_friction=np.broadcast_to(geom_friction, (num_envs, len(nominal))).copy(),
        added_mass=mass_unit * uniform(cfg.added_mass_range or cfg.added_mass, 1, 0.0),
        com_shift=rng.uniform(low, high, (num_envs, 3)).astype(np.float32),
        stiffness=uniform(cfg.gains, joints, 1.0),
        damping=uniform(cfg.gains, joints, 1.0),
        strength=uniform(cfg.motor_strength, 1, 1.0),
    )


def apply_params(sim: Simulation, params: RandomizedParams) -> None:
    """Write the parameters of each robot to its simulation.

    Args:
        sim: The simulation.
        params: Parameters of each robot.

    Raises:
        ConfigError: If the base of a robot would have no mass.
    """
    batch, scene, model, base = sim.batch, sim.scene, sim.scene.model, sim.scene.base
    nominal = model.body_mass[base]
    mass = nominal + params.added_mass
    if mass.min() <= 0:
        got = f"a base of {nominal:.3g} kg would weigh {mass.min():.3g} kg"
        name = "domain_rand.added_mass or added_mass_range"
        raise ConfigError(f"{name}: {got}; expected more than 0 kg")
    batch.expand("body_mass")[:, base] = mass[:, 0]
    # The added mass has the shape of the base, so the inertia grows in proportion.
    batch.expand("body_inertia")[:, base] = model.body_inertia[base] * (mass / nominal)
    batch.expand("body_ipos")[:, base] = model.body_ipos[base] + params.com_shift
    batch.expand("geom_friction")[:, scene.geoms, 0] = params.geom_friction
    # MuJoCo's affine actuators: force = gain * ctrl + bias . (1, q, dq).
    gain, bias = batch.expand("actuator_gainprm"), batch.expand("actuator_biasprm")
    k, d, s = params.stiffness, params.damping, params.strength
    # A position actuator has gain k and bias -k, a velocity actuator gain d and bias -d: both must
    # change by the same factor, or the target moves.
    has_stiffness, has_damping = model.actuator_biasprm[:, 1:3].T != 0
    factor = np.where(has_stiffness, k, np.where(has_damping, d, 1))
    gain[:, :, 0] = model.actuator_gainprm[:, 0] * factor * s
    bias[:, :, 1] = model.actuator_biasprm[:, 1] * k * s
    bias[:, :, 2] = model.actuator_biasprm[:, 2] * d * s
    with quiet_mujoco():
        batch.set_const()


def randomize_params(env: "LeggedEnv") -> None:
    """Sample the physical parameters of all robots."""
    env.params = sample_params(env)
    apply_params(env.sim, env.params)


def reset_state(env: "LeggedEnv", env_ids: Ids) -> None:
    """Put robots at their spawn origins, in a random state with the feet above the ground.

    Where the ground beside an origin is uneven, the sampled offset is halved, and then dropped.
    """
    cfg, scene, robot, rng, count = env.cfg.init_state, env.scene, env.robot, env.rng, len(env_ids)
    origins = env.curriculum.env_origins[env_ids]
    qpos, qvel = np.tile(scene.default_qpos, (count, 1)), np.zeros((count, scene.model.nv))
    offset = rng.uniform(-cfg.position, cfg.position, (count, 2)).astype(np.float32)
    # Points that cover the area of the feet at any heading.
    radius = 0.5 * max(robot.leg_length, robot.spec.stance_width or 0.2)
    circle = np.exp(0.25j * np.pi * np.arange(8))
    rings = radius * np.concatenate([[0], circle / 2, circle])
    ring_x, ring_y = rings.real.astype(np.float32), rings.imag.astype(np.float32)
    for factor in (0.5, 0.0, 1.0):  # the last pass only measures the origin
        x, y = (origins[:, :2] + offset).T
        height = env.terrain.height(x[:, None] + ring_x, y[:, None] + ring_y, origins[:, 2:])
        highest = height.max(axis=1)
        uneven = highest - height.min(axis=1) > MAX_RESET_RELIEF
        if not uneven.any():
            break
        # Half of the offset first, then none, so that robots start near the origin only where they
        # have to.
        offset[uneven] *= factor
    qpos[:, :2] = origins[:, :2] + offset
    qpos[:, 2] = highest + robot.spawn_height
    yaw = rng.uniform(-cfg.yaw, cfg.yaw, count)
    # The quaternion of a rotation about z.
    qpos[:, 3], qpos[:, 6] = np.cos(yaw / 2), np.sin(yaw / 2)
    low, high = cfg.reset_range or robot.spec.reset_range
    factors = rng.uniform(low, high, (count, len(robot.default_pose)))
    qpos[:, scene.joint_qpos] = np.clip(robot.default_pose * factors, robot.lower, robot.upper)
    qvel[:, :3] = rng.uniform(-cfg.lin_vel, cfg.lin_vel, (count, 3))
    qvel[:, 3:6] = rng.uniform(-cfg.ang_vel, cfg.ang_vel, (count, 3))
    env.sim.reset(env_ids, qpos, qvel)
    # Random joint positions may put a foot below the ground: raise the base.
    x, y, z = np.moveaxis(env.sim.sensor("foot_position", env_ids), 2, 0)
    depth = (env.terrain.height(x, y, z) + scene.sole_depth - z).max(axis=1)
    if (depth > 0).any():
        env.sim.qpos[env_ids, 2] += np.maximum(depth, 0)
        env.sim.forward(env_ids)


def reset_push(env: "LeggedEnv", env_ids: Ids) -> None:
    """Sample when the first push of new episodes happens."""
    env.push_vel[env_ids] = 0
    # Random phases, so that not all robots are pushed in the same step.
    if interval := push_interval(env):
        env.steps_until_push[env_ids] = env.rng.integers(1, interval + 1, len(env_ids))


def push(env: "LeggedEnv") -> None:
    """Add a velocity to the robots that are due, at regular intervals."""
    env.push_vel[:] = 0
    if interval := push_interval(env):
        limit = env.cfg.domain_rand.max_push_vel_xy
        if limit is None:
            share = BIPED_MAX_PUSH if len(env.robot.spec.feet) == 2 else MAX_PUSH
            limit = share * float(np.sqrt(9.81 * env.robot.leg_length))
        env.steps_until_push -= 1
        env_ids = np.flatnonzero(env.steps_until_push <= 0)
        if len(env_ids):
            env.steps_until_push[env_ids] = interval
            env.push_vel[env_ids, :2] = env.rng.uniform(-limit, limit, (len(env_ids), 2))
            env.sim.qvel[:, :2] += env.push_vel[:, :2]


def push_interval(env: "LeggedEnv") -> int:
    """Return the steps between two pushes; 0 for no pushes."""
    cfg = env.cfg.domain_rand
    is_pushed = cfg.push_interval_s and cfg.max_push_vel_xy != 0
    return max(1, round(cfg.push_interval_s / env.cfg.dt)) if is_pushed else 0


def reset_joint_offset(env: "LeggedEnv", env_ids: Ids) -> None:
    """Sample the zero offset of each joint."""
    limit = env.cfg.domain_rand.joint_offset
    env.joint_offset[env_ids] = env.rng.uniform(-limit, limit, env.joint_offset[env_ids].shape)


def reset_lin_vel_bias(env: "LeggedEnv", env_ids: Ids) -> None:
    """Sample the constant error of the observed base linear velocity."""
    limit = env.cfg.noise.noise_level * env.cfg.noise.lin_vel_bias
    env.lin_vel_bias[env_ids] = env.rng.uniform(-limit, limit, (len(env_ids), 3))


def reset_action_delay(env: "LeggedEnv", env_ids: Ids) -> None:
    """Sample the delay of the actions."""
    if limits := env.cfg.domain_rand.action_delay:
        delay = env.rng.uniform(*limits, len(env_ids))
        env.sim.reset_action_delay(env_ids, delay, env.to_ctrl(env.action_history[0])[env_ids])


EVENTS = {
    "params": EventTerm(startup=randomize_params),
    "state": EventTerm(reset=reset_state),
    "push": EventTerm(reset=reset_push, step=push),
    "joint_offset": EventTerm(reset=reset_joint_offset),
    "lin_vel_bias": EventTerm(reset=reset_lin_vel_bias),
    "action_delay": EventTerm(reset=reset_action_delay),
}
"""Every event of a task by name, in the order in which they happen."""
