"""The tops of boxes that a video shows: where several share one plane, they are set apart.

The sun's light is added to every surface that nothing is in front of. Where two boxes overlap and
have one top, as at the corners of stairs, it is added twice, and they shine white.
"""

from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

_APART = 0.001
"""Difference that the graphics library can tell and an eye cannot [m]."""


def set_box_tops_apart(model: Any) -> None:
    """Lower boxes of the ground by millimeters, until no two that overlap have the same top.

    Args:
        model: The `mujoco.MjModel`; its upright boxes that are fixed to the world are moved.
    """
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    fixed = (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX) & (
        model.body_weldid[model.geom_bodyid] == 0
    )
    upright = np.isclose(data.geom_xmat, np.eye(3).ravel()).all(axis=1)
    boxes = np.flatnonzero(fixed & upright)
    low = (data.geom_xpos - model.geom_size)[boxes]
    high = (data.geom_xpos + model.geom_size)[boxes]
    tops = np.round(high[:, 2] / _APART)
    for top in np.unique(tops):
        same = np.flatnonzero(tops == top)
        layers = _layers(low[same, :2], high[same, :2])
        up = data.xmat[model.geom_bodyid[boxes[same]], 6:]  # of the world, in the body's frame
        model.geom_pos[boxes[same]] -= _APART * layers[:, None] * up
    model.geom_sameframe[boxes] = 0  # or the place of one at the origin would not be looked at


def _layers(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return a number for each rectangle, the least that none has which it overlaps, shape (n,)."""
    layers = np.zeros(len(low), np.int64)
    for k in range(len(low)):
        overlap = ((low[:k] < high[k] - _APART) & (low[k] < high[:k] - _APART)).all(axis=1)
        taken = layers[:k][overlap]
        layers[k] = next(n for n in count() if n not in taken)
    return layers
