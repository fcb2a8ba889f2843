"""Pictures of a robot on a floor with a grid, seen from three sides."""

import math
from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rendering.child_process import Frame, RenderError, stream_frames
from terrainkit_robots.rendering.renderer import (
    VISIBLE_GROUPS,
    add_box,
    add_caption,
    make_renderer,
    update_scene,
)
from terrainkit_robots.text import one_line

FloatArray = NDArray[np.float64]

DEFAULT_SIZE = (480, 420)
"""Width and height of a picture [pixels]."""

VIEWS = {"front": (180.0, -10.0), "side": (90.0, -10.0), "corner": (142.0, -24.0)}
"""Azimuth and elevation of the camera in each view [deg]."""

FIELD_OF_VIEW = 25.0
FILL_RATIO = 0.86
"""Share of the picture's width or height that the robot spans."""

FLOOR_COLOR, LINE_COLOR = (0.9, 0.91, 0.92), (0.72, 0.74, 0.77)
GRID_LINES = 24
"""Number of grid lines on each side of the robot."""

MUJOCO_RGBA = np.array([0.5, 0.5, 0.5, 1], np.float32)
DEFAULT_RGBA = np.array([0.72, 0.74, 0.78, 1], np.float32)
"""Color of geoms without one in the file: in MuJoCo, and here."""

BLACK_LEVEL = 0.1
"""Black surfaces are lightened to this value, so that shading remains visible on them."""

MAX_COORDINATE = 1e3
"""Largest coordinate of a robot that can be rendered [m]."""


def render_robot(file: Path, size: tuple[int, int] = DEFAULT_SIZE) -> dict[str, bytes]:
    """Return a PNG of each view of a robot, by the name of the view: front, side and corner.

    Args:
        file: The MJCF file; the robot is shown in its first keyframe, or in qpos0.
        size: Width and height of a picture [pixels].

    Raises:
        RenderError: if MuJoCo cannot render on this machine, or cannot render this robot.
    """
    import cv2

    frames = stream_frames(partial(robot_frames, file.absolute(), size))
    return {
        name: cv2.imencode(".png", frame[:, :, ::-1])[1].tobytes()
        for name, frame in zip(VIEWS, frames, strict=True)
    }


def robot_frames(file: Path, size: tuple[int, int]) -> Iterator[Frame]:
    """Yield a frame of each view of a robot.

    Raises:
        RenderError: if the file cannot be loaded, or the robot is empty or too large.
    """
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        raise RenderError(f"MuJoCo cannot load {file.name}: {one_line(str(error))}") from None
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    points = geom_points(model, data, show_robot_geoms(model))
    if not len(points):
        raise RenderError(f"{file.name} has no geoms to render")
    if not np.abs(points).max() < MAX_COORDINATE:  # also rejects NaN
        raise RenderError(f"{file.name} has geoms more than {MAX_COORDINATE:g} m from the origin")
    low, high = points.min(axis=0), points.max(axis=0)
    center, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-3)
    cell = grid_spacing(radius)
    fog = (3.0, 6.0)
    with make_renderer(
        model, size, extent=2 * radius, fog=fog, field_of_view=FIELD_OF_VIEW
    ) as renderer:
        for azimuth, elevation in VIEWS.values():
            target, distance = fit_camera(points, azimuth, elevation, size[0] / size[1])
            view = {"distance": distance, "azimuth": azimuth, "elevation": elevation}
            update_scene(renderer, data, target=target, geom_groups=(0,), **view)
            _add_floor(renderer.scene, np.array([*center[:2], low[2]]), radius, cell)
            frame = renderer.render()
            add_caption(frame, f"grid {cell:g} m", size[1] / 1100)
            yield frame


def show_robot_geoms(model: Any) -> NDArray[np.int64]:
    """Move the geoms to render into group 0 and the others into group 1, and set their colors.

    The geoms that MuJoCo shows by default are rendered. A robot without such geoms is represented
    by its collision geoms, and a transparent robot by all of its geoms. Planes and heightfields
    are not part of a robot.

    Returns:
        The indices of the geoms to render, shape (n,).
    """
    import mujoco

    is_uncolored = (model.geom_rgba == MUJOCO_RGBA).all(axis=1)
    has_material = is_uncolored & (model.geom_matid >= 0)
    alpha = model.geom_rgba[:, 3].copy()
    alpha[has_material] = model.mat_rgba[model.geom_matid[has_material], 3]
    ground = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    solid = ~np.isin(model.geom_type, [int(kind) for kind in ground])
    visible = solid & (alpha > 0) & np.isin(model.geom_group, VISIBLE_GROUPS)
    shown = next((mask for mask in (visible, solid & (alpha > 0)) if mask.any()), solid)
    model.geom_group[:] = ~shown
    for rgba in (model.geom_rgba, model.mat_rgba):
        rgba[:, :3] = BLACK_LEVEL + (1 - BLACK_LEVEL) * rgba[:, :3]
    model.geom_rgba[has_material] = MUJOCO_RGBA  # of this color, MuJoCo shows the material
    model.geom_matid[alpha == 0] = -1
    model.geom_rgba[(is_uncolored & ~has_material) | (alpha == 0)] = DEFAULT_RGBA
    return np.flatnonzero(shown)


def geom_points(model: Any, data: Any, geoms: NDArray[np.int64]) -> FloatArray:
    """Return points whose convex hull contains the geoms, in the world frame, shape (n, 3) [m]."""
    corners, points = np.array(list(product((-1.0, 1.0), repeat=3))), [np.zeros((0, 3))]
    for geom in geoms:
        local = model.geom_aabb[geom, :3] + corners * model.geom_aabb[geom, 3:]
        if (mesh := model.geom_dataid[geom]) >= 0:
            start = model.mesh_vertadr[mesh]
            local = model.mesh_vert[start : start + model.mesh_vertnum[mesh]]
        points.append(local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return np.concatenate(points)


def fit_camera(
    points: FloatArray, azimuth: float, elevation: float, aspect_ratio: float
) -> tuple[FloatArray, float]:
    """Return the target and the distance of the closest camera that shows all points [m].

    Args:
        points: Points to show, shape (n, 3) [m].
        azimuth: Angle of the viewing direction in the plane [deg].
        elevation: Angle of the viewing direction above the plane [deg].
        aspect_ratio: Width of the picture over its height.
    """
    a, e = np.radians([azimuth, elevation])
    forward = np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    offsets, slope = points - target, FILL_RATIO * np.tan(np.radians(FIELD_OF_VIEW) / 2)
    depth = offsets @ forward
    distance = 1e-3 - float(depth.min())
    for axis, s in ((right, slope * aspect_ratio), (np.cross(right, forward), slope)):
        # A point is in the picture if |offset - middle| <= s * (depth + distance).
        above, below = ((sign * (offsets @ axis) - s * depth).max() for sign in (1, -1))
        distance = max(distance, float(above + below) / (2 * s))
        target = target + (above - below) / 2 * axis
    return target, distance


def grid_spacing(radius: float) -> float:
    """Return the width of the floor's cells [m]: 1, 2 or 5 times a power of ten."""
    target = 0.4 * radius
    power = 10.0 ** math.floor(math.log10(target))
    return float(f"{power * max(n for n in (1, 2, 5) if n * power <= target * 1.0001):.3g}")


def _add_floor(scene: Any, position: FloatArray, radius: float, cell: float) -> None:
    center = np.array([*np.round(position[:2] / cell) * cell, position[2]])
    size = 200 * radius
    add_box(scene, [size, size, radius], center - [0, 0, radius], FLOOR_COLOR)
    for k in range(-GRID_LINES, GRID_LINES + 1):
        for axis in (0, 1):
            half_size, offset = np.array([0.004, 0.004, 2e-4]) * radius, np.zeros(3)
            half_size[axis], offset[1 - axis] = GRID_LINES * cell, k * cell
            add_box(scene, half_size, center + offset, LINE_COLOR)
