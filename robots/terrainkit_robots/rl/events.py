"""Events: reset states, pushes, and the parameters that differ between simulated robots."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.config import DomainRand, InitState
from terrainkit_robots.rl.scene import Scene
from terrainkit_robots.rl.simulation import Ids, Simulation
from terrainkit_robots.rl.terrain import Ground
from terrainkit_robots.spec.robot import Robot
from terrainkit_robots.transforms import FloatArray

MAX_RESET_RELIEF = 0.06
"""Height range of the ground under a robot that is not reset exactly at its origin [m]."""


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


def sample_params(
    rng: np.random.Generator, num_envs: int, sim: Simulation, cfg: DomainRand
) -> RandomizedParams:
    """Sample the physical parameters of `num_envs` robots."""
    joints, scene = sim.scene.model.nu, sim.scene
    nominal = scene.model.geom_friction[scene.geoms, 0].astype(np.float32)
    mass = scene.model.body_subtreemass[scene.base].astype(np.float32)

    def uniform(limits: tuple[float, float] | None, width: int, default: float) -> FloatArray:
        low, high = limits or (default, default)
        return rng.uniform(low, high, (num_envs, width)).astype(np.float32)

    friction = uniform(cfg.friction, 1, float(nominal.mean()) if len(nominal) else 1.0)
    geom_friction = nominal if cfg.friction is None else friction
    return RandomizedParams(
        friction=friction,
        geom_friction=np.broadcast_to(geom_friction, (num_envs, len(nominal))).copy(),
        added_mass=mass * uniform(cfg.added_mass, 1, 0.0),
        com_shift=rng.uniform(-cfg.com_shift, cfg.com_shift, (num_envs, 3)).astype(np.float32),
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
        raise ConfigError(f"domain_rand.added_mass: {got}; expected more than 0 kg")
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


class Pushes:
    """Velocity pushes at regular intervals; each robot has its own phase."""

    def __init__(self, cfg: DomainRand, num_envs: int, dt: float) -> None:
        self.velocity = np.zeros((num_envs, 3), np.float32)  # of this step, world frame [m/s]
        self.steps_until_push = np.zeros(num_envs, np.int64)
        self._interval = max(1, round(cfg.push_interval_s / dt))
        self._max_vel = cfg.max_push_vel_xy if cfg.push_interval_s else 0.0

    def reset(self, rng: np.random.Generator, env_ids: Ids) -> None:
        """Sample when the first push of new episodes happens.

        Args:
            rng: Generator of the random numbers.
            env_ids: Environments, shape (k,).
        """
        self.velocity[env_ids] = 0
        if self._max_vel:
            # Random phases, so that not all robots are pushed in the same step.
            self.steps_until_push[env_ids] = rng.integers(1, self._interval + 1, len(env_ids))

    def apply(self, rng: np.random.Generator, qvel: NDArray[np.float64]) -> None:
        """Push the robots that are due.

        Args:
            rng: Generator of the random numbers.
            qvel: Velocities of all robots, shape (n, nv), to which the pushes are added.
        """
        self.velocity[:] = 0
        if not self._max_vel:
            return
        self.steps_until_push -= 1
        env_ids = np.flatnonzero(self.steps_until_push <= 0)
        self.steps_until_push[env_ids] = self._interval
        self.velocity[env_ids, :2] = rng.uniform(-self._max_vel, self._max_vel, (len(env_ids), 2))
        qvel[:, :2] += self.velocity[:, :2]


def sample_reset_state(
    rng: np.random.Generator,
    env_origins: FloatArray,
    scene: Scene,
    robot: Robot,
    terrain: Ground,
    cfg: InitState,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample the state of robots at a reset.

    Where the ground beside an origin is uneven, the sampled offset is halved, and then dropped.

    Args:
        rng: Generator of the random numbers.
        env_origins: Spawn origin of each robot [m], shape (k, 3).
        scene: The scene.
        robot: The robot.
        terrain: The ground.
        cfg: Ranges of the state.

    Returns:
        Positions `qpos`, shape (k, nq), and velocities `qvel`, shape (k, nv).
    """
    count, limit = len(env_origins), cfg.position
    qpos = np.tile(scene.default_qpos, (count, 1))
    offset = rng.uniform(-limit, limit, (count, 2)).astype(np.float32)
    # Points that cover the area of the feet at any heading.
    radius = 0.5 * max(robot.leg_length, robot.spec.stance_width or 0.2)
    circle = np.exp(0.25j * np.pi * np.arange(8))
    rings = radius * np.concatenate([[0], circle / 2, circle])
    ring_x, ring_y = rings.real.astype(np.float32), rings.imag.astype(np.float32)
    for factor in (0.5, 0.0, 1.0):  # the last pass only measures the origin
        x, y = (env_origins[:, :2] + offset).T
        height = terrain.height(x[:, None] + ring_x, y[:, None] + ring_y, env_origins[:, 2:])
        highest = height.max(axis=1)
        uneven = highest - height.min(axis=1) > MAX_RESET_RELIEF
        if not uneven.any():
            break
        # Half of the offset first, then none, so that robots start near the origin only where they
        # have to.
        offset[uneven] *= factor
    qpos[:, :2] = env_origins[:, :2] + offset
    qpos[:, 2] = highest + robot.spawn_height
    yaw = rng.uniform(-cfg.yaw, cfg.yaw, count)
    # The quaternion of a rotation about z.
    qpos[:, 3], qpos[:, 6] = np.cos(yaw / 2), np.sin(yaw / 2)
    low, high = cfg.reset_range or robot.spec.reset_range
    factors = rng.uniform(low, high, (count, len(robot.default_pose)))
    qpos[:, scene.joint_qpos] = np.clip(robot.default_pose * factors, robot.lower, robot.upper)
    qvel = np.zeros((count, scene.model.nv))
    qvel[:, :3] = rng.uniform(-cfg.lin_vel, cfg.lin_vel, (count, 3))
    qvel[:, 3:6] = rng.uniform(-cfg.ang_vel, cfg.ang_vel, (count, 3))
    return qpos, qvel
