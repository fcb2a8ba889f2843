"""The appearance of all pictures: sky, light, fog, camera and captions."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

SKY_COLOR = (0.94, 0.955, 0.97)
DOWN, SUN_DIRECTION = np.array([0.0, 0.0, -1.0]), np.array([-0.318, 0.424, -0.848])
FIELD_OF_VIEW = 30.0  # vertical [deg]
FOG_START, FOG_END = 2.0, 5.5  # distances from the camera, in extents of the model
VISIBLE_GROUPS = (0, 1, 2)  # geom groups that MuJoCo shows by default


def set_appearance(spec: Any) -> None:
    """Set the lights, the sky and the visual options of a `mujoco.MjSpec`."""
    sky, visual = mujoco.mjtTexture.mjTEXTURE_SKYBOX, spec.visual
    for element in (*spec.lights, *(texture for texture in spec.textures if texture.type == sky)):
        spec.delete(element)
    texture = spec.add_texture(name="terrainkit_sky", type=sky, width=8, height=8)
    texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
    texture.rgb1 = texture.rgb2 = SKY_COLOR
    visual.rgba.fog = [*SKY_COLOR, 1]
    visual.headlight.active = 0
    lights = [(DOWN, 0.45, 0.15, 0.0, False), (SUN_DIRECTION, 0.0, 0.5, 0.08, True)]
    for direction, ambient, diffuse, specular, has_shadow in lights:
        light = spec.worldbody.add_light(pos=-10 * direction, dir=direction, castshadow=has_shadow)
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.ambient[:], light.diffuse[:], light.specular[:] = ambient, diffuse, specular
    visual.global_.fovy = FIELD_OF_VIEW
    visual.quality.shadowsize, visual.quality.offsamples, visual.quality.numslices = 2048, 4, 64
    visual.map.znear, visual.map.zfar, visual.map.shadowclip = 0.02, 400.0, 1.0
    visual.map.fogstart, visual.map.fogend = FOG_START, FOG_END


def make_renderer(model: Any, size: tuple[int, int], extent: float) -> Any:
    """Return a `mujoco.Renderer`; the model's extent [m] scales the fog and the shadows."""
    model.stat.extent = extent
    model.vis.global_.offwidth, model.vis.global_.offheight = size
    renderer = mujoco.Renderer(model, size[1], size[0], max_geom=30 * model.ngeom + 1000)
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 1
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = 0  # invisible in the fog
    return renderer


def update_scene(
    renderer: Any, data: Any, target: ArrayLike, distance: float, azimuth: float, elevation: float
) -> Any:
    """Update the scene of a renderer.

    Args:
        renderer: The `mujoco.Renderer`.
        data: The state to show.
        target: Point that the camera looks at [m], shape (3,).
        distance: Distance of the camera from the target [m].
        azimuth: Azimuth of the viewing direction [deg].
        elevation: Elevation of the viewing direction [deg].

    Returns:
        The `mujoco.MjvOption`.
    """
    camera = mujoco.MjvCamera()
    options = mujoco.MjvOption()
    scene = renderer.scene
    camera.lookat, camera.distance = target, distance
    camera.azimuth, camera.elevation = azimuth, elevation
    options.sitegroup[:] = 0
    options.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
    renderer.update_scene(data, camera, options)
    # Shadows are cast around the position of the sun.
    scene.lights[scene.nlight - 1].pos = target - 2 * renderer.model.stat.extent * SUN_DIRECTION
    return options


def add_caption(frame: NDArray[np.uint8], text: str, scale: float) -> None:
    """Write outlined text into the lower left corner of a frame."""
    import cv2

    x, y = round(20 * scale), round(len(frame) - 30 * scale)
    style = (cv2.FONT_HERSHEY_SIMPLEX, scale)
    outline = [(i, j, (238, 242, 247)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    for dx, dy, color in (*outline, (0, 0, (50, 60, 70))):
        cv2.putText(frame, text, (x + dx, y + dy), *style, color, 1, cv2.LINE_AA)
