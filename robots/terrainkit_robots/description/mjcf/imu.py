"""The IMU of a MJCF: the site at which turning and acceleration are sensed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from terrainkit_robots.description.mjcf.document import Node
from terrainkit_robots.description.mjcf.shapes import Scale

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, kw_only=True)
class PlacedSite:
    """A site on a body."""

    site: Any
    """The `mujoco.MjsSite`."""

    link: str
    """Name of the body's link."""

    depth: int
    """How many bodies it is below the world."""

    node: Node
    scale: Scale
    """What the frames around the body do to its size."""


def find_imu(spec: "mujoco.MjSpec", sites: Sequence[PlacedSite]) -> PlacedSite | None:
    """Return the site that a gyro or an accelerometer names, else one called imu; None without.

    Of several it is the one closest to the base, and of those the first.
    """
    import mujoco

    kinds = (mujoco.mjtSensor.mjSENS_GYRO, mujoco.mjtSensor.mjSENS_ACCELEROMETER)
    sensed = {sensor.objname for sensor in spec.sensors if sensor.type in kinds} - {""}
    found = [each for each in sites if each.site.name in sensed]
    found = found or [each for each in sites if each.site.name.lower() == "imu"]
    return min(found, key=lambda each: each.depth, default=None)
