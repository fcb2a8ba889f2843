"""The randomization: what differs from robot to robot and from time to time.

So that a policy bears the real one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.physics import Physics
from terrainkit_robots.rl.task import DomainRand

FloatArray = NDArray[np.float32]
Ids = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Differences:
    """How n robots differ from their model."""

    friction: FloatArray
    """Friction of the contacts, of several kinds their mean, shape (n, 1)."""

    geom_friction: FloatArray
    """Friction of each geom that touches, shape (n, g)."""

    added_mass: FloatArray
    """Mass added to the base [kg], shape (n, 1)."""

    com_shift: FloatArray
    """Shift of the base's center of mass [m], shape (n, 3)."""

    stiffness: FloatArray
    """Factor on the stiffness of each joint, shape (n, j)."""

    damping: FloatArray
    """Factor on the damping of each joint, shape (n, j)."""

    strength: FloatArray
    """Factor on all torques, shape (n, 1)."""


class Pushes:
    """Push n robots now and then, each at times of its own."""

    def __init__(self, settings: DomainRand, num_envs: int, dt: float) -> None:
        self.velocity = np.zeros((num_envs, 3), np.float32)
        """What was added to each base's velocity in this step, in the world's frame [m/s], (n, 3).
        """

        self.wait = np.zeros(num_envs, np.int64)
        """Steps until each is pushed, shape (n,)."""

        self._every = max(1, round(settings.push_interval_s / dt))
        self._most = settings.max_push_vel_xy if settings.push_interval_s else 0.0

    def begin(self, rng: np.random.Generator, ids: Ids) -> None:
        """Begin episodes: the first push may come at any time, so also soon after a command."""
        self.velocity[ids] = 0
        if self._most:
            self.wait[ids] = rng.integers(1, self._every + 1, len(ids))

    def push(self, rng: np.random.Generator, qvel: NDArray[np.float64]) -> None:
        """Push those whose time has come; qvel is that of the physics, shape (n, nv)."""
        self.velocity[:] = 0
        if not self._most:
            return
        self.wait -= 1
        ids = np.flatnonzero(self.wait <= 0)
        self.wait[ids] = self._every
        self.velocity[ids, :2] = rng.uniform(-self._most, self._most, (len(ids), 2))
        qvel[:, :2] += self.velocity[:, :2]


def draw_differences(
    rng: np.random.Generator, count: int, physics: Physics, settings: DomainRand
) -> Differences:
    """Return how `count` robots differ."""
    joints, scene = physics.scene.model.nu, physics.scene
    own = scene.model.geom_friction[scene.geoms, 0].astype(np.float32)

    def within(span: tuple[float, float] | None, width: int, nominal: float) -> FloatArray:
        low, high = span or (nominal, nominal)
        return rng.uniform(low, high, (count, width)).astype(np.float32)

    friction = within(settings.friction, 1, float(own.mean()) if len(own) else 1.0)
    shift = settings.com_shift
    return Differences(
        friction=friction,
        geom_friction=_spread(own, friction, given=settings.friction is not None),
        added_mass=within(settings.added_mass, 1, 0.0),
        com_shift=rng.uniform(-shift, shift, (count, 3)).astype(np.float32),
        stiffness=within(settings.gains, joints, 1.0),
        damping=within(settings.gains, joints, 1.0),
        strength=within(settings.motor_strength, 1, 1.0),
    )


def apply_differences(physics: Physics, differences: Differences) -> None:
    """Give each simulation a robot of its own.

    Raises:
        ConfigError: if a base would weigh nothing.
    """
    batch, scene, model = physics.batch, physics.scene, physics.scene.model
    base = scene.base
    least = float(model.body_mass[base] + differences.added_mass.min())
    if least <= 0:
        raise ConfigError(
            f"domain_rand.added_mass leaves a base of {least:.3g} kg; it weighs "
            f"{model.body_mass[base]:.3g} kg"
        )
    mass = batch.expand("body_mass")
    mass[:, base] = model.body_mass[base] + differences.added_mass[:, 0]
    # A heavier base of the same shape: its inertia grows alike.
    batch.expand("body_inertia")[:, base] = (
        model.body_inertia[base] * (mass[:, base] / model.body_mass[base])[:, None]
    )
    batch.expand("body_ipos")[:, base] = model.body_ipos[base] + differences.com_shift
    batch.expand("geom_friction")[:, scene.geoms, 0] = differences.geom_friction
    # kp and kv of MuJoCo's affine actuators: force = gain * ctrl + bias . (1, q, dq).
    gain, bias = batch.expand("actuator_gainprm"), batch.expand("actuator_biasprm")
    k, d, s = differences.stiffness, differences.damping, differences.strength
    positional, damped = model.actuator_biasprm[:, 1] != 0, model.actuator_biasprm[:, 2] != 0
    factor = np.where(positional, k, np.where(damped, d, 1))
    gain[:, :, 0] = model.actuator_gainprm[:, 0] * factor * s
    bias[:, :, 1] = model.actuator_biasprm[:, 1] * k * s
    bias[:, :, 2] = model.actuator_biasprm[:, 2] * d * s
    with quiet_mujoco():
        batch.set_const()


def _spread(own: FloatArray, friction: FloatArray, *, given: bool) -> FloatArray:
    """Return the friction of each geom, shape (n, g): that of its robot if given, else its own."""
    shape = (len(friction), len(own))
    return np.broadcast_to(friction if given else own, shape).copy()
