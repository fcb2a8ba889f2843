"""The part of heightfields that a video shows: all of a large map would be drawn for each frame.

Without a graphics card, that is most of the work.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

_UPRIGHT = 0.999
"""Cosine of the largest tilt with which a heightfield is cut."""


class HeightfieldWindows:
    """The heightfields of a model, of which a part is left at a time."""

    def __init__(self, model: Any) -> None:
        """Remember them whole.

        Args:
            model: The `mujoco.MjModel`; its heightfields are changed.
        """
        import mujoco

        self._model = model
        self._data, self._sizes = model.hfield_data.copy(), model.hfield_size.copy()
        self._shapes = np.column_stack([model.hfield_nrow, model.hfield_ncol])
        self._places = model.geom_pos.copy()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self._where, self._axes = data.geom_xpos.copy(), data.geom_xmat.reshape(-1, 3, 3).copy()
        self._geoms = {
            int(model.geom_dataid[geom]): int(geom)
            for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD)
            if self._can_be_cut(int(geom))
        }

    def _can_be_cut(self, geom: int) -> bool:
        """Return whether it stays where it is, upright, and no other has the same heights."""
        import mujoco

        model = self._model
        fields = model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD
        alone = (model.geom_dataid[fields] == model.geom_dataid[geom]).sum() == 1
        still = model.body_weldid[model.geom_bodyid[geom]] == 0
        return bool(alone and still and self._axes[geom][2, 2] > _UPRIGHT)

    def show(self, points: NDArray[np.floating[Any]]) -> list[int]:
        """Cut off what is beyond the rectangle around some points, and return what was cut.

        Args:
            points: Where there has to be ground, x and y [m], shape (k, 2).

        Returns:
            The heightfields that have to be given to the graphics library again.
        """
        for field, geom in self._geoms.items():
            axes, where = self._axes[geom][:2, :2], self._where[geom][:2]
            inside = (points - where) @ axes
            self._cut(field, geom, inside.min(axis=0), inside.max(axis=0))
        return list(self._geoms)

    def _cut(
        self,
        field: int,
        geom: int,
        low: NDArray[np.floating[Any]],
        high: NDArray[np.floating[Any]],
    ) -> None:
        """Leave the samples of a heightfield from `low` to `high` in its own frame [m]."""
        model = self._model
        shape, half = self._shapes[field], self._sizes[field][:2]
        most = shape[::-1] - 1  # samples go along y in rows, and along x in columns
        step = 2 * half / most
        first = np.clip(np.floor((low + half) / step), 0, most - 1).astype(int)
        last = np.clip(np.ceil((high + half) / step), first + 1, most).astype(int)
        start = int(model.hfield_adr[field])
        whole = self._data[start : start + shape.prod()].reshape(shape)
        part = whole[first[1] : last[1] + 1, first[0] : last[0] + 1]
        model.hfield_data[start : start + part.size] = part.ravel()
        model.hfield_nrow[field], model.hfield_ncol[field] = part.shape
        model.hfield_size[field, :2] = (last - first) * step / 2
        middle = (first + last) * step / 2 - half
        turned = _matrix(model.geom_quat[geom])[:, :2] @ middle
        model.geom_pos[geom] = self._places[geom] + turned
        model.geom_sameframe[geom] = 0  # or its place would not be looked at


def _matrix(quat: NDArray[np.float64]) -> NDArray[np.float64]:
    import mujoco

    flat = np.empty(9)
    mujoco.mju_quat2Mat(flat, quat)
    return flat.reshape(3, 3)
