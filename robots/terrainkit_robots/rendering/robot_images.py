"""Pictures of a robot on a floor with a grid, seen from three sides."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import one_line
from terrainkit_robots.rendering import appearance
from terrainkit_robots.rendering.child_process import RenderError, stream_frames
from terrainkit_robots.simulation.geoms import box_corners, lowest_point

DEFAULT_SIZE = (480, 420)  # [pixels]
VIEWS = {"front": (180.0, -10.0), "side": (90.0, -10.0), "corner": (142.0, -24.0)}
"""Azimuth and elevation of the camera in each view [deg]."""

FILL_RATIO = 0.95  # maximum share of the width and the height that the robot spans
FLOOR = "terrainkit_floor"
MUJOCO_RGBA = np.array((0.5, 0.5, 0.5, 1))  # default color


def render_robot(file: Path, size: tuple[int, int] = DEFAULT_SIZE) -> Iterator[tuple[str, bytes]]:
    """Start to render a robot, and yield name and PNG of each view: front, side and corner.

    The robot of the MJCF file is shown in its first keyframe, or in qpos0.

    Raises:
        RenderError: if MuJoCo cannot render on this machine, or cannot render this robot.
    """
    images = stream_frames(partial(render_views, file.absolute(), size))
    return ((name, image.tobytes()) for name, image in zip(VIEWS, images, strict=True))


def render_views(file: Path, size: tuple[int, int]) -> Iterator[NDArray[np.uint8]]:
    """Yield a PNG of each view of a robot.

    Args:
        file: MJCF file of the robot.
        size: Width and height [pixels].

    Yields:
        Bytes of each PNG, in the order of `VIEWS`.

    Raises:
        RenderError: if MuJoCo cannot load the robot.
    """
    import cv2

    try:
        model = _load_model(file)
    except ValueError as error:
        raise RenderError(f"MuJoCo cannot load {file.name}: {one_line(str(error))}") from None
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    geoms = show_robot_geoms(model)
    if not len(geoms):
        raise RenderError(f"{file.name} has no geoms to render")
    points = box_corners(model, data, geoms)
    if not np.abs(points).max() < 1000:  # also rejects NaN
        raise RenderError(f"{file.name} has geoms more than 1000 m from the origin")
    radius = max(float(np.linalg.norm(np.ptp(points, axis=0))) / 2, 1e-3)
    cell = grid_spacing(radius)
    model.material(FLOOR).texrepeat = 2 / cell  # the texture of a plane spans 2 units
    data.geom(FLOOR).xpos[2] = min(lowest_point(model, data, geom) for geom in geoms)
    with appearance.make_renderer(model, size, 2.5 * radius) as renderer:
        for view in VIEWS.values():
            target, distance = fit_camera(points, *view, size[0] / size[1])
            appearance.update_scene(renderer, data, target, distance, *view)
            frame = renderer.render()
            appearance.add_caption(frame, f"grid {cell:g} m", size[1] / 1100)
            yield cv2.imencode(".png", frame[:, :, ::-1])[1]


def _load_model(file: Path) -> Any:
    """Return the model of a robot with a floor, whose height and grid spacing are set later."""
    spec = mujoco.MjSpec.from_file(str(file))
    appearance.set_appearance(spec)
    texture = spec.add_texture(name=FLOOR, type=mujoco.mjtTexture.mjTEXTURE_2D)
    texture.builtin, texture.mark = mujoco.mjtBuiltin.mjBUILTIN_FLAT, mujoco.mjtMark.mjMARK_EDGE
    texture.rgb1, texture.markrgb = (0.9, 0.91, 0.92), (0.72, 0.74, 0.77)
    texture.width = texture.height = 80
    material = spec.add_material(name=FLOOR, texuniform=True, specular=0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = FLOOR
    plane = spec.worldbody.add_geom(name=FLOOR, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    plane.material, plane.rgba = FLOOR, MUJOCO_RGBA
    return spec.compile()


def show_robot_geoms(model: Any) -> NDArray[np.int64]:
    """Show only the robot and the floor, set their colors, and return the ids of its geoms.

    The geoms that MuJoCo shows by default are rendered. A robot without such geoms is represented
    by its collision geoms, and a transparent robot by all of its geoms. Planes and heightfields
    are not part of a robot.
    """
    rgba, solid = model.geom_rgba, model.geom_type > int(mujoco.mjtGeom.mjGEOM_HFIELD)
    is_uncolored = (rgba == MUJOCO_RGBA).all(axis=1)  # the material shows, if there is one
    has_material = is_uncolored & (model.geom_matid >= 0)
    rgba[has_material] = model.mat_rgba[model.geom_matid[has_material]]
    opaque = solid & (rgba[:, 3] > 0)
    visible = opaque & np.isin(model.geom_group, appearance.VISIBLE_GROUPS)
    shown = next((mask for mask in (visible, opaque) if mask.any()), solid)
    rgba[solid & ((is_uncolored & ~has_material) | ~opaque)] = (0.72, 0.74, 0.78, 1)
    rgba[solid, :3] = 0.1 + 0.9 * rgba[solid, :3]  # shading is invisible on black surfaces
    model.geom_group[:] = np.where(shown, 0, 5)
    model.geom(FLOOR).group = 0
    return np.flatnonzero(shown)


def fit_camera(
    points: NDArray[np.float64], azimuth: float, elevation: float, aspect_ratio: float
) -> tuple[NDArray[np.float64], float]:
    """Return a camera that shows all points.

    Args:
        points: Points [m], shape (n, 3).
        azimuth: Azimuth of the viewing direction [deg].
        elevation: Elevation of the viewing direction [deg].
        aspect_ratio: Width over height of the image.

    Returns:
        Target, shape (3,), and distance of the camera [m].
    """
    a, e = np.radians([azimuth, elevation])
    forward = np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    offsets, slope = points - target, FILL_RATIO * np.tan(np.radians(appearance.FIELD_OF_VIEW) / 2)
    # A point is in the image if its distance along the view is at least |x| and |y|.
    x, y = offsets @ right / (slope * aspect_ratio), offsets @ np.cross(right, forward) / slope
    return target, 1e-4 + float((np.maximum(abs(x), abs(y)) - offsets @ forward).max())


def grid_spacing(radius: float) -> float:
    """Return the width of the floor's cells [m]: 1, 2 or 5 times a power of ten."""
    cells = [float(f"{digit}e{power}") for power in range(-4, 4) for digit in (1, 2, 5)]
    return max(cell for cell in cells if cell <= 0.40001 * radius)
