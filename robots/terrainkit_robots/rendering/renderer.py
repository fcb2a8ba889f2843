"""The appearance of all pictures: camera, lights, fog, sky and text of a `mujoco.Renderer`."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

SKY_COLOR = (0.94, 0.955, 0.97)
SUN_DIRECTION = np.array([-0.318, 0.424, -0.848])
VISIBLE_GROUPS = (0, 1, 2)
"""Geom groups that MuJoCo shows by default."""


def make_renderer(
    model: Any,
    size: tuple[int, int],
    *,
    extent: float,
    fog: tuple[float, float],
    field_of_view: float,
    max_geom: int = 0,
) -> Any:
    """Return a `mujoco.Renderer`, and set the visual options of its model.

    Args:
        model: The `mujoco.MjModel`; its visual options are changed.
        size: Width and height of the frames [pixels].
        extent: Radius of the region in which shadows are cast [m].
        fog: Distances from the camera at which the fog starts and is opaque, in extents.
        field_of_view: Vertical field of view of the camera [deg].
        max_geom: Maximum number of geoms that are added to those of the model.
    """
    import mujoco

    visual, (width, height) = model.vis, size
    visual.global_.offwidth, visual.global_.offheight = size
    visual.global_.fovy = field_of_view
    visual.quality.shadowsize, visual.quality.offsamples, visual.quality.numslices = 2048, 4, 64
    model.stat.extent = extent
    visual.map.znear, visual.map.zfar, visual.map.shadowclip = 0.02, 400.0, 1.0
    visual.map.fogstart, visual.map.fogend = fog
    visual.rgba.fog[:] = [*SKY_COLOR, 1]
    renderer = mujoco.Renderer(model, height, width, max_geom=2 * model.ngeom + max_geom + 1000)
    flags = renderer.scene.flags
    for flag, value in (("SKYBOX", 0), ("HAZE", 0), ("FOG", 1)):
        flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = value
    return renderer


def update_scene(
    renderer: Any,
    data: Any,
    *,
    target: ArrayLike,
    distance: float,
    azimuth: float,
    elevation: float,
    geom_groups: tuple[int, ...] = VISIBLE_GROUPS,
) -> Any:
    """Put the geoms of a model, lights and a sky into a scene, and return its MjvOption.

    Args:
        renderer: The `mujoco.Renderer`.
        data: The `mujoco.MjData` with the pose of the robot.
        target: Point in the middle of the picture, shape (3,) [m].
        distance: Distance from the camera to the target [m].
        azimuth: Angle of the viewing direction in the plane, from +x to +y [deg].
        elevation: Angle of the viewing direction above the plane [deg].
        geom_groups: Groups of the geoms to render.
    """
    import mujoco

    camera, options, scene = mujoco.MjvCamera(), mujoco.MjvOption(), renderer.scene
    camera.lookat, camera.distance = target, distance
    camera.azimuth, camera.elevation = azimuth, elevation
    options.geomgroup[:] = [group in geom_groups for group in range(6)]
    options.sitegroup[:] = 0
    options.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
    renderer.update_scene(data, camera, options)

    eye = scene.camera[0]
    forward, up = np.array(eye.forward, float), np.array(eye.up, float)
    down = np.array([0.0, 0.0, -1.0])
    lights = [(down, 0.45, 0.15, 0.0, False), (SUN_DIRECTION, 0.0, 0.5, 0.08, True)]
    scene.nlight = len(lights)
    for light, (direction, ambient, diffuse, specular, has_shadow) in zip(
        scene.lights, lights, strict=False
    ):
        light.type, light.attenuation[:] = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, [1, 0, 0]
        light.pos, light.dir = target - 2 * renderer.model.stat.extent * direction, direction
        light.ambient[:], light.diffuse[:], light.specular[:] = ambient, diffuse, specular
        light.castshadow, light.headlight = has_shadow, False
    # The background is black; a wall behind everything has the color of the sky.
    far = 0.9 * float(eye.frustum_far)
    rotation = np.column_stack([np.cross(forward, up), up, -forward])
    position = np.array(eye.pos, float) + far * forward
    add_box(scene, [far, far, 0.01 * far], position, SKY_COLOR, rotation=rotation, emission=1.0)
    return options


def add_box(
    scene: Any,
    half_size: ArrayLike,
    position: ArrayLike,
    color: tuple[float, float, float],
    *,
    rotation: ArrayLike = (1, 0, 0, 0, 1, 0, 0, 0, 1),
    emission: float = 0.0,
) -> None:
    """Add a matte box to a scene; sizes and positions are in [m]."""
    import mujoco

    geom, rgba = scene.geoms[scene.ngeom], np.array([*color, 1], np.float32)
    vectors = (np.asarray(each, float).ravel() for each in (half_size, position, rotation))
    mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_BOX, *vectors, rgba)
    geom.category = mujoco.mjtCatBit.mjCAT_DECOR
    geom.matid = geom.objid = geom.segid = -1  # mjv_initGeom leaves these unset
    geom.specular, geom.reflectance, geom.emission = 0.0, 0.0, emission
    scene.ngeom += 1


def add_caption(frame: NDArray[np.uint8], text: str, scale: float) -> None:
    """Write outlined text into the lower left corner of a frame."""
    import cv2

    x, y = round(20 * scale), round(len(frame) - 30 * scale)
    style = (cv2.FONT_HERSHEY_SIMPLEX, scale)
    outline = [(i, j, (238, 242, 247)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    for dx, dy, color in (*outline, (0, 0, (50, 60, 70))):
        cv2.putText(frame, text, (x + dx, y + dy), *style, color, 1, cv2.LINE_AA)
