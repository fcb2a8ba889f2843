"""Rays along z in a model of MuJoCo."""

import mujoco
import numpy as np


def cast_rays(model, starts, direction=-1):
    """Return the z of the geom that each ray hits first, NaN without one, and its index."""
    data, normal = mujoco.MjData(model), np.zeros(3)
    mujoco.mj_forward(model, data)
    z, geoms, found = np.full(len(starts), np.nan), [], np.zeros(1, dtype=np.int32)
    for k, start in enumerate(starts):
        distance = mujoco.mj_ray(model, data, start, [0, 0, direction], None, 1, -1, found, normal)
        z[k] = start[2] + direction * distance if distance >= 0 else np.nan
        geoms.append(int(found[0]))
    return z, geoms
