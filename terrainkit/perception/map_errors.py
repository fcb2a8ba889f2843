"""MapErrors: height scans with the errors of the elevation maps of real robots."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrainkit.curriculum.arrays import Array, like, make_rng, to_indices
from terrainkit.errors import ConfigError
from terrainkit.perception.height_scan import Floats, HeightScan, to_floats, to_number
from terrainkit.perception.ray_caster import RayCaster

_OCCLUSION_MARGIN = 0.02
"""A point is seen if a ray toward it ends at most this far before it [m]."""

_BLADE, _TUFT = 0.05, 1.0
"""Sides of the squares in which grass has one height, and in which it grows or does not [m]."""


@dataclass(frozen=True, kw_only=True)
class MapErrorOptions:
    """Sizes of the errors; 0 is none. Angles do not drift."""

    noise: float = 0.0
    """Standard deviation of the heights [m]."""

    noise_per_meter: float = 0.0
    """Increase of this standard deviation for each meter between a point and the robot."""

    drift: float = 0.0
    """Standard deviation of the position of the map along x, y and z after 1 s; it grows with the
    square root of the time since the reset [m]."""

    delay: tuple[int, int] = (0, 0)
    """Lowest and highest delay [steps]. Each reset draws the delay of a robot."""

    missing: float = 0.0
    """Fraction of the points without a height, 0 to 1."""

    occlusion: bool = False
    """Whether points that the sensor cannot see have no height."""

    sensor: tuple[float, float, float] = (0.3, 0.0, 0.1)
    """Position of the sensor for the occlusion: ahead, left and above the robot's position [m]."""

    grass: float = 0.0
    """Largest height of grass, which hides the ground [m]."""

    grass_cover: float = 0.5
    """Fraction of the ground with grass, 0 to 1."""

    def __post_init__(self) -> None:
        for name, high in _LIMITS.items():
            to_number(f"map errors: {name}", getattr(self, name), 0.0, high)
        to_floats("map errors: sensor", self.sensor, [3])
        delay = to_indices("map errors: delay", self.delay, _MAX_DELAY + 1, 2)
        if delay[0] > delay[1]:
            raise ConfigError(f"map errors: delay: got {self.delay}; expected the lowest first")


_MAX_DELAY = 100
_LIMITS = dict.fromkeys(("noise", "noise_per_meter", "drift", "grass"), 10.0)
_LIMITS |= dict.fromkeys(("missing", "grass_cover"), 1.0)


class MapErrors:
    """A height scan of n robots with errors.

    Each robot has its own drift and delay. Random numbers depend on the seed, the number of calls
    of `below` and the robot, and not on which other robots are reset.
    """

    def __init__(
        self,
        scan: HeightScan,
        options: MapErrorOptions,
        num_envs: int,
        *,
        dt: float,
        rays: RayCaster | None = None,
        seed: int = 0,
    ) -> None:
        """Reset all robots.

        Args:
            scan: The scan without errors.
            options: The sizes of the errors.
            num_envs: Number of robots.
            dt: Time between two calls of `below` [s].
            rays: Rays on the same map; required for the occlusion.
            seed: Seed of all random numbers.

        Raises:
            ConfigError: if a number is out of range, or the occlusion has no rays.
        """
        if options.occlusion and rays is None:
            raise ConfigError("map errors: occlusion: got no rays; expected rays=RayCaster(map)")
        to_number("num_envs", num_envs, 0, whole=True)
        to_number("dt", dt, 1e-6, 1e3)
        self._scan, self._options, self._rays, self._dt, self._seed = scan, options, rays, dt, seed
        self._steps, n, k = 0, num_envs, scan.offsets.shape[1]
        self._drift, self._delay, self._age = np.zeros((n, 3)), np.zeros(n, int), np.zeros(n, int)
        self._past = np.empty((options.delay[1] + 1, n, k), np.float32)
        self.reset(np.arange(n))

    def reset(self, env_ids: ArrayLike) -> None:
        """Begin new episodes of some robots: no drift, no past scans, another delay.

        Args:
            env_ids: Robots, shape (k,).

        Raises:
            ConfigError: if there is no such robot.
        """
        ids = to_indices("env_ids", env_ids, len(self._age))
        low, high = self._options.delay
        delays = make_rng((self._seed, self._steps, 1)).integers(low, high + 1, len(self._age))
        self._delay[ids], self._age[ids], self._drift[ids] = delays[ids], 0, 0.0

    def below(self, position: Array, yaw: ArrayLike) -> Array:
        """Return the heights that robots measure, once per step; see `HeightScan.below`.

        Args:
            position: Positions of the robots [m], shape (n, 3).
            yaw: Yaw of the robots [rad], shape (n,).

        Returns:
            Heights [m], shape (n, k); NaN where there is no height.

        Raises:
            ConfigError: if a shape is wrong, or a value is not finite.
        """
        n = len(self._age)
        options = self._options
        pos = to_floats("position", position, [n, 3])
        angle = to_floats("yaw", yaw, [n])
        rng = make_rng((self._seed, self._steps, 0))
        self._drift += options.drift * self._dt**0.5 * rng.standard_normal((n, 3))
        displaced = np.column_stack([pos[:, :2] + self._drift[:, :2], pos[:, 2]])
        x, y, z = self._scan.points(displaced, angle)
        seen = self._is_seen(pos, angle, (x, y, z)) & (rng.random(z.shape) >= options.missing)
        z = z + self._grass(x, y) + self._drift[:, 2:]
        away = np.hypot(*self._scan.offsets)
        z += rng.standard_normal(z.shape) * (options.noise + options.noise_per_meter * away)
        length, rows = len(self._past), np.arange(n)
        self._past[self._steps % length] = np.where(seen, z, np.nan)
        # Before the delay is over, the first scan since the reset is the last one that is known.
        back = self._steps - np.minimum(self._delay, self._age)
        self._steps, self._age = self._steps + 1, self._age + 1
        return like(self._past[back % length, rows], position)

    def _is_seen(
        self, pos: NDArray[Any], yaw: NDArray[Any], points: tuple[Floats, Floats, Floats]
    ) -> NDArray[np.bool_]:
        if not self._options.occlusion or self._rays is None:
            return np.ones(points[0].shape, bool)
        ahead, left, up = self._options.sensor
        c, s = np.cos(yaw), np.sin(yaw)
        sensor = pos + np.column_stack([c * ahead - s * left, s * ahead + c * left, 0 * c + up])
        toward = np.stack(points, axis=-1) - sensor[:, None]
        distance = np.linalg.norm(toward, axis=-1)
        starts = np.broadcast_to(sensor[:, None], toward.shape).reshape(-1, 3)
        met = self._rays.cast(starts, toward.reshape(-1, 3), float(distance.max()) + 1.0)
        return np.asarray(met.reshape(distance.shape) > distance - _OCCLUSION_MARGIN)

    def _grass(self, x: Floats, y: Floats) -> Floats | float:
        """Return the height of the grass at points [m]; it does not move with the robots."""
        if not self._options.grass:
            return 0.0
        height = self._options.grass * _lattice_noise(x, y, _BLADE, 2 * self._seed)
        grows = _lattice_noise(x, y, _TUFT, 2 * self._seed + 1) < self._options.grass_cover
        return np.asarray(height * grows, np.float32)


def _lattice_noise(x: Floats, y: Floats, side: float, seed: int) -> Floats:
    """Return a random number from 0 to 1 for the square around each point.

    The integers of the square are hashed as in "Mark Jarzynski and Marc Olano, Hash Functions for
    GPU Rendering, 2020" (pcg2d).
    """
    i, j = (np.floor(coordinate / side).astype(np.int64).astype(np.uint32) for coordinate in (x, y))
    i, j = (
        (index + np.uint32(seed % 2**32)) * np.uint32(1664525) + np.uint32(1013904223)
        for index in (i, j)
    )
    for _ in range(2):
        i = i + j * np.uint32(1664525)
        j = j + i * np.uint32(1664525)
        i, j = i ^ (i >> np.uint32(16)), j ^ (j >> np.uint32(16))
    return np.asarray((i + j * np.uint32(1664525)).astype(np.float32) / np.float32(2**32))
