"""Find the site of the IMU of an MJCF."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from terrainkit_robots.description.mjcf.shapes import Scale
from terrainkit_robots.description.mjcf.tree import Node

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, kw_only=True)
class BodySite:
    """A site on a body."""

    site: Any
    """The `mujoco.MjsSite`."""

    link: str
    """Name of the link of the body."""

    depth: int
    """Depth of the body below the world."""

    node: Node
    scale: Scale
    """Scale of the frames around the body."""


def find_imu(spec: "mujoco.MjSpec", sites: Sequence[BodySite]) -> BodySite | None:
    """Return the site of a gyro or an accelerometer, else a site named imu, else None.

    Of several sites, the one closest to the base is returned.
    """
    import mujoco

    kinds = (mujoco.mjtSensor.mjSENS_GYRO, mujoco.mjtSensor.mjSENS_ACCELEROMETER)
    sensed = {sensor.objname for sensor in spec.sensors if sensor.type in kinds} - {""}
    mimics = [each for each in sites if each.site.name in sensed]
    mimics = mimics or [each for each in sites if each.site.name.lower() == "imu"]
    return min(mimics, key=lambda each: each.depth, default=None)
