"""Find the site of the IMU of an MJCF."""

from typing import Any

import mujoco

from terrainkit_robots.description.mjcf.constraints import ancestors


def find_imu(spec: mujoco.MjSpec) -> Any:
    """Return the site of a gyro or an accelerometer, else a site named imu, else None.

    Of several sites, the site closest to the base is returned.
    """
    kinds = (mujoco.mjtSensor.mjSENS_GYRO, mujoco.mjtSensor.mjSENS_ACCELEROMETER)
    sensed = {sensor.objname for sensor in spec.sensors if sensor.type in kinds} - {""}
    sites = [site for site in spec.sites if site.parent != spec.worldbody]
    found = [site for site in sites if site.name in sensed]
    found = found or [site for site in sites if site.name.lower() == "imu"]
    return min(found, key=lambda site: len(ancestors(site.parent)), default=None)
