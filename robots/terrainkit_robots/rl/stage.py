"""The stage: the scene of a video, with its light, its camera, and any number of robots.

`python -m` this module is the process that draws: a request on stdin, an answer and a video as
files; see `video`.
"""

import json
import math
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit_robots.rl.box_tops import set_box_tops_apart
from terrainkit_robots.rl.hfield_window import HeightfieldWindows
from terrainkit_robots.rl.mp4 import Mp4Error, Mp4Writer
from terrainkit_robots.rl.video import ANSWER, DONE, VIDEO, Shot

FloatArray = NDArray[np.float32]

_SKY = np.array([0.93, 0.95, 0.97], np.float32)
"""Color of what is far away."""

_HAZE = (2.0, 6.0)
"""From where to where things fade into it, in distances of the camera."""

_FAR = 400.0
"""How far the picture reaches, in distances of the camera. The tolerance with which shadows are
told from light grows with it; with less, slopes are speckled."""

_FIELD_OF_VIEW = 35.0
"""Angle between the lower and the upper edge of a picture [deg]."""

_TOWARD, _SWING = 128.0, 10.0
"""Direction of the camera on the map, and how far it swings to either side [deg]."""

_AWAY = 7.0
"""Distance of the camera, in sizes of the robot."""

_NEAR_BY = 14.0
"""Other robots are drawn so far from the one that is followed [m]."""

_CROWD = 24
"""So many robots are drawn, at most."""

_SUN = np.array([-0.45, 0.6, -1.2])
"""Direction of the light that casts shadows."""

_INK, _PAPER = (50, 60, 70), (238, 242, 247)
"""Colors of captions and of the rim around their letters: red, green and blue."""

_CALM = 0.4
"""Time over which the way of the camera is smoothed [s]."""


def main() -> None:
    """Answer one request."""
    request = json.load(sys.stdin)
    folder = Path(request["folder"])
    try:
        answer: dict[str, Any] = {"frames": _draw(request, folder)}
    except Mp4Error as error:
        answer = {"unwritten": str(error)}
    except Exception as error:  # graphics libraries raise whatever they like
        answer = {"failed": f"{type(error).__name__}: {error}"}
    (folder / ANSWER).write_text(json.dumps(answer))


def _draw(request: Mapping[str, Any], folder: Path) -> int:
    """Draw the video, and return how many frames it has."""
    import mujoco

    from terrainkit_robots.quiet_mujoco import quiet_mujoco

    size, fps = tuple(request["size"]), float(request["fps"])
    poses = np.load(folder / "poses.npy", mmap_mode="r")
    shots = [Shot(**shot) for shot in request["shots"]]
    with quiet_mujoco(), (folder / DONE).open("wb", buffering=0) as done:
        stage = Stage(mujoco.MjModel.from_binary_path(str(folder / "scene.mjb")), size)
        with Mp4Writer(folder / VIDEO, size, fps) as video:
            frames = 0
            for shot in shots:
                for picture in stage.frames(poses, shot, fps):
                    video.write(picture)
                    done.write(b".")
                    frames += 1
    return frames


class Stage:
    """The scene, with any number of robots in it."""

    def __init__(self, model: Any, size: tuple[int, int]) -> None:
        """Set it up; what the model looks like is changed.

        Args:
            model: The `mujoco.MjModel` of the scene, with one robot.
            size: Width and height of the pictures.
        """
        import mujoco

        self._model, self._size = model, size
        self._main, self._other = mujoco.MjData(model), mujoco.MjData(model)
        self._own = np.flatnonzero(model.body_weldid[model.geom_bodyid] != 0)
        self._radius = _radius(model, self._own)
        width, height = size
        visual = model.vis
        visual.global_.offwidth, visual.global_.offheight = width, height
        visual.global_.fovy = _FIELD_OF_VIEW
        # Smoothing edges by several samples for each pixel would take twice the time.
        visual.quality.shadowsize, visual.quality.offsamples = 2048, 0
        self._windows = HeightfieldWindows(model)
        set_box_tops_apart(model)
        # Near, far and the reach of shadows are told in extents.
        model.stat.extent = _AWAY * self._radius
        visual.map.znear, visual.map.zfar = 0.02, _FAR
        visual.map.shadowclip = 1.0
        self._options = mujoco.MjvOption()
        self._options.sitegroup[:] = 0
        if not (model.geom_group[self._own] < 3).any():
            self._options.geomgroup[:] = 1
        self._library = mujoco.GLContext(width, height)
        self._library.make_current()
        self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + _CROWD * len(self._own) + 1000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = False
        self._scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = False

    def frames(self, poses: FloatArray, shot: Shot, fps: float) -> Iterator[NDArray[np.uint8]]:
        """Yield the pictures of a shot in red, green and blue, shape (height, width, 3).

        Args:
            poses: qpos of each robot in each frame, shape (frames, n, nq).
            shot: What is shown.
            fps: Frames per second.
        """
        targets = _smooth(poses[shot.start : shot.stop, shot.robot, :3], _CALM * fps)
        self._show_ground(targets)
        for k, target in enumerate(targets):
            now = poses[shot.start + k]
            azimuth = _TOWARD + _SWING * math.sin(0.4 * k / fps)
            picture = self._picture(now, shot.robot, target, azimuth)
            yield _captioned(picture, shot.captions[k])

    def _show_ground(self, targets: FloatArray) -> None:
        """Leave of heightfields what the camera will see before haze hides it."""
        import mujoco

        width, height = self._size
        distance = _AWAY * self._radius
        across = math.degrees(
            math.atan(width / height * math.tan(math.radians(_FIELD_OF_VIEW) / 2))
        )
        edges = np.radians(_TOWARD + (across + _SWING) * np.linspace(-1, 1, 5))
        rays = np.column_stack([np.cos(edges), np.sin(edges)])
        corners = np.concatenate([-1.2 * distance * rays, _HAZE[1] * distance * rays])
        seen = (targets[:, None, :2] + corners).reshape(-1, 2)
        for field in self._windows.show(seen):
            mujoco.mjr_uploadHField(self._model, self._context, field)

    def _picture(
        self, poses: FloatArray, followed: int, target: FloatArray, azimuth: float
    ) -> NDArray[np.uint8]:
        import mujoco

        model, scene, camera = self._model, self._scene, mujoco.MjvCamera()
        camera.lookat[:], camera.distance = target, _AWAY * self._radius
        camera.azimuth, camera.elevation = azimuth, -18
        self._posed(self._main, poses[followed])
        category = mujoco.mjtCatBit
        everything = category.mjCAT_STATIC | category.mjCAT_DYNAMIC
        untouched = mujoco.MjvPerturb()
        mujoco.mjv_updateScene(
            model, self._main, self._options, untouched, camera, everything, scene
        )
        far = np.hypot(*(poses[:, :2] - poses[followed, :2]).T)
        for robot in np.argsort(far, kind="stable")[:_CROWD]:
            if robot != followed and far[robot] < _NEAR_BY:
                self._posed(self._other, poses[robot])
                mujoco.mjv_addGeoms(
                    model, self._other, self._options, untouched, category.mjCAT_DYNAMIC, scene
                )
        self._light(target)
        self._hang_sky()
        return self._rendered(camera.distance)

    def _posed(self, data: Any, qpos: FloatArray) -> None:
        import mujoco

        data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)

    def _light(self, target: FloatArray) -> None:
        """Put two lights into the scene: a sun with shadows, and the sky."""
        import mujoco

        sun = _SUN / np.linalg.norm(_SUN)
        down = np.array([0.0, 0.0, -1.0])
        lights = [(down, 0.38, 0.22, 0.0, False), (sun, 0.0, 0.55, 0.08, True)]
        self._scene.nlight = len(lights)
        for light, (toward, ambient, diffuse, specular, shadow) in zip(
            self._scene.lights, lights, strict=False
        ):
            light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
            light.pos, light.dir = target - _AWAY * self._radius * toward, toward
            light.ambient[:], light.diffuse[:], light.specular[:] = ambient, diffuse, specular
            light.castshadow, light.headlight = shadow, False
            light.attenuation[:] = [1, 0, 0]

    def _hang_sky(self) -> None:
        """Put a wall of the sky's color behind all, without which the edges of ground are black."""
        import mujoco

        camera, geom = self._scene.camera[0], self._scene.geoms[self._scene.ngeom]
        forward, up = np.array(camera.forward, float), np.array(camera.up, float)
        far = 0.9 * float(camera.frustum_far)
        mujoco.mjv_initGeom(
            geom,
            mujoco.mjtGeom.mjGEOM_BOX,
            np.array([far, far, 0.01 * far]),
            np.array(camera.pos, float) + far * forward,
            np.column_stack([np.cross(forward, up), up, -forward]).ravel(),
            np.array([*_SKY, 1], np.float32),
        )
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR
        geom.matid = geom.objid = geom.segid = -1  # which the function leaves as they were
        geom.emission, geom.specular, geom.reflectance = 1.0, 0.0, 0.0
        self._scene.ngeom += 1

    def _rendered(self, distance: float) -> NDArray[np.uint8]:
        """Return the scene as a picture, in which what is far away fades into the sky."""
        import mujoco

        width, height = self._size
        rectangle = mujoco.MjrRect(0, 0, width, height)
        pixels = np.empty((height, width, 3), np.uint8)
        depths = np.empty((height, width), np.float32)
        mujoco.mjr_render(rectangle, self._scene, self._context)
        mujoco.mjr_readPixels(pixels, depths, rectangle, self._context)
        near, far = (float(getattr(self._scene.camera[0], f"frustum_{k}")) for k in ("near", "far"))
        # Depth is 0 at `far` and 1 at `near`.
        away = near * far / (near + depths * (far - near))
        start, end = (each * distance for each in _HAZE)
        haze = np.clip((away - start) / (end - start), 0, 1)
        haze = (haze * haze * (3 - 2 * haze))[..., None]
        mixed = pixels * (1 - haze) + (255 * _SKY) * haze
        return np.round(mixed[::-1]).astype(np.uint8)


def _captioned(picture: NDArray[np.uint8], caption: str) -> NDArray[np.uint8]:
    """Return a picture with words below, on the left."""
    import cv2

    height = len(picture)
    x, y, scale = round(0.03 * height), round(0.955 * height), height / 750
    font, smooth = cv2.FONT_HERSHEY_SIMPLEX, cv2.LINE_AA
    picture = np.ascontiguousarray(picture)
    rim = [((x + i, y + j), _PAPER) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    for place, color in [*rim, ((x, y), _INK)]:
        cv2.putText(picture, caption, place, font, scale, color, 1, smooth)
    return picture


def _radius(model: Any, own: NDArray[np.int64]) -> float:
    """Return how far a robot reaches from its base in the pose of the model [m]."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    away = np.linalg.norm(data.geom_xpos[own] - data.qpos[:3], axis=1) + model.geom_rbound[own]
    return max(0.05, float(away.max(initial=0.05)))


def _smooth(path: FloatArray, sigma: float) -> FloatArray:
    """Return a path without its shaking, shape (frames, 3)."""
    reach = max(1, round(3 * sigma))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sigma, 1e-3)) ** 2)
    weights /= weights.sum()
    # Beyond its ends a path goes on straight, so that the camera neither lags nor hurries there.
    before = 2 * path[0] - path[np.minimum(np.arange(reach, 0, -1), len(path) - 1)]
    after = 2 * path[-1] - path[np.maximum(len(path) - 1 - np.arange(1, reach + 1), 0)]
    whole = np.concatenate([before, path, after])
    return np.stack([np.convolve(axis, weights, "valid") for axis in whole.T], axis=1).astype(
        np.float32
    )


if __name__ == "__main__":
    main()
