"""Frames of a video: robots on a terrain, with a camera that follows one of them."""

import copy
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rendering.child_process import Frame
from terrainkit_robots.rendering.renderer import (
    VISIBLE_GROUPS,
    add_caption,
    make_renderer,
    update_scene,
)
from terrainkit_robots.rendering.video import Shot, VideoSpec

FloatArray = NDArray[np.floating[Any]]

FIELD_OF_VIEW, AZIMUTH, AZIMUTH_SWING, ELEVATION = 35.0, 128.0, 10.0, -18.0
"""Angles of the camera [deg]; its azimuth swings to both sides."""

DISTANCE_IN_RADII = 7.0
"""Distance of the camera, in radii of the robot."""

FOG = (2.0, 6.0)
"""Start and end of the fog, in distances of the camera."""

MAX_OTHER_ROBOTS, MAX_OTHER_DISTANCE = 24, 14.0
"""Other robots are rendered up to this number, and up to this distance [m]."""

SMOOTHING_TIME = 0.4
"""Standard deviation of the filter that smooths the path of the camera [s]."""

COPLANAR_OFFSET = 0.001
"""Vertical distance between overlapping box tops that OpenGL can resolve [m]."""


def video_frames(spec: VideoSpec) -> Iterator[Frame]:
    """Yield the frames of all shots of a video."""
    offset_box_tops(spec.model)
    for shot in spec.shots:
        yield from _shot_frames(spec, shot)


def _shot_frames(spec: VideoSpec, shot: Shot) -> Iterator[Frame]:
    import mujoco

    poses, (width, height) = spec.poses[shot.start : shot.stop], spec.size
    robot_geoms = spec.model.body_weldid[spec.model.geom_bodyid] != 0
    has_visuals = np.isin(spec.model.geom_group[robot_geoms], VISIBLE_GROUPS).any()
    geom_groups = VISIBLE_GROUPS if has_visuals else tuple(range(6))
    distance = DISTANCE_IN_RADII * _robot_radius(spec.model, robot_geoms)
    targets = smooth_path(poses[:, shot.robot, :3], SMOOTHING_TIME * spec.fps)

    half_width = math.degrees(math.atan(width / height * math.tan(math.radians(FIELD_OF_VIEW / 2))))
    angles = np.radians(AZIMUTH + (half_width + AZIMUTH_SWING) * np.linspace(-1, 1, 5))
    rays = distance * np.column_stack([np.cos(angles), np.sin(angles)])
    view = np.concatenate([-1.2 * rays, FOG[1] * rays])
    model = cut_heightfields(spec.model, (targets[:, None, :2] + view).reshape(-1, 2))

    data, other_data, unchanged = mujoco.MjData(model), mujoco.MjData(model), mujoco.MjvPerturb()
    max_geom = MAX_OTHER_ROBOTS * int(robot_geoms.sum())
    with make_renderer(
        model, spec.size, extent=distance, fog=FOG, field_of_view=FIELD_OF_VIEW, max_geom=max_geom
    ) as renderer:
        for k, caption in enumerate(shot.captions):
            _set_pose(model, data, poses[k, shot.robot])
            azimuth = AZIMUTH + AZIMUTH_SWING * math.sin(0.4 * k / spec.fps)
            options = update_scene(
                renderer,
                data,
                target=targets[k],
                distance=distance,
                azimuth=azimuth,
                elevation=ELEVATION,
                geom_groups=geom_groups,
            )
            away = np.linalg.norm(poses[k, :, :2] - poses[k, shot.robot, :2], axis=1)
            away[shot.robot] = np.inf
            for robot in np.argsort(away, kind="stable")[:MAX_OTHER_ROBOTS]:
                if away[robot] < MAX_OTHER_DISTANCE:
                    _set_pose(model, other_data, poses[k, robot])
                    mask = mujoco.mjtCatBit.mjCAT_DYNAMIC
                    mujoco.mjv_addGeoms(model, other_data, options, unchanged, mask, renderer.scene)
            frame = renderer.render()
            add_caption(frame, caption, height / 750)
            yield frame


def _set_pose(model: Any, data: Any, qpos: FloatArray) -> None:
    import mujoco

    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


def _robot_radius(model: Any, robot_geoms: NDArray[np.bool_]) -> float:
    """Return the largest distance of the robot's geoms from its base at qpos0 [m]."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    away = np.linalg.norm(data.geom_xpos - data.qpos[:3], axis=1) + model.geom_rbound
    return max(0.05, float(away[robot_geoms].max(initial=0.0)))


def smooth_path(path: FloatArray, sigma: float) -> FloatArray:
    """Return a path after a Gaussian filter, shape (frames, 3) [m].

    Args:
        path: Positions, shape (frames, 3) [m].
        sigma: Standard deviation of the filter [frames].
    """
    from scipy.ndimage import gaussian_filter1d

    # The deviation from a straight line is filtered, so that the camera has no lag at the ends.
    line = np.linspace(path[0], path[-1], len(path))
    return np.asarray(line + gaussian_filter1d(path - line, sigma, axis=0, mode="nearest"))


def _static_geoms(model: Any, geom_type: int) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the static, unrotated geoms of a type, and their positions, shape (n, 3) [m]."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    identity = np.eye(3).ravel()
    is_unrotated = np.isclose(data.geom_xmat, identity).all(axis=1)
    is_unrotated &= np.isclose(data.xmat, identity).all(axis=1)[model.geom_bodyid]
    is_static = model.body_weldid[model.geom_bodyid] == 0
    geoms = np.flatnonzero((model.geom_type == geom_type) & is_static & is_unrotated)
    return geoms, data.geom_xpos[geoms]


def cut_heightfields(model: Any, points: FloatArray) -> Any:
    """Return a copy of a model whose heightfields cover only the bounding box of some points.

    Without a GPU, most of the time would be spent on the triangles of a large heightfield.

    Args:
        model: The `mujoco.MjModel`; each heightfield belongs to one geom.
        points: Points that must be covered, x and y in the world frame, shape (k, 2) [m].
    """
    import mujoco

    model = copy.copy(model)
    for geom, position in zip(*_static_geoms(model, mujoco.mjtGeom.mjGEOM_HFIELD), strict=True):
        field = model.geom_dataid[geom]
        shape = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
        last, half = np.array(shape[::-1]) - 1, model.hfield_size[field, :2].copy()
        step, local = 2 * half / last, points - position[:2] + half
        low = np.clip(np.floor(local.min(axis=0) / step), 0, last - 1).astype(int)
        high = np.clip(np.ceil(local.max(axis=0) / step), low + 1, last).astype(int)
        data = model.hfield_data[model.hfield_adr[field] :]
        # Rows are along y, columns along x.
        heights = data[: shape[0] * shape[1]].reshape(shape)
        part = heights[low[1] : high[1] + 1, low[0] : high[0] + 1].copy()
        data[: part.size] = part.ravel()
        model.hfield_nrow[field], model.hfield_ncol[field] = part.shape
        model.hfield_size[field, :2] = (high - low) * step / 2
        model.geom_pos[geom, :2] += (low + high) * step / 2 - half
        model.geom_sameframe[geom] = 0  # otherwise MuJoCo ignores geom_pos
    return model


def offset_box_tops(model: Any) -> None:
    """Lower boxes of the terrain by millimeters until overlapping boxes have no coplanar tops.

    OpenGL adds the light of a coplanar surface twice, which makes the corners of stairs too bright.
    """
    import mujoco

    boxes, positions = _static_geoms(model, mujoco.mjtGeom.mjGEOM_BOX)
    low, high = positions - model.geom_size[boxes], positions + model.geom_size[boxes]
    original = np.round(high[:, 2] / COPLANAR_OFFSET)
    tops, margin = original.copy(), COPLANAR_OFFSET
    for k in range(len(boxes)):
        overlap = (low[:k, :2] < high[k, :2] - margin) & (low[k, :2] < high[:k, :2] - margin)
        while tops[k] in tops[:k][overlap.all(axis=1)]:
            tops[k] -= 1
    model.geom_pos[boxes, 2] += COPLANAR_OFFSET * (tops - original)
    model.geom_sameframe[boxes] = 0  # otherwise MuJoCo ignores geom_pos
