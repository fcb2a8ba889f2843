"""The studio in which a robot is pictured: a light floor with a grid, a sun and a soft lamp.

Nothing is added to the model: floor and lights are put into MuJoCo's scene beside the robot. What
is far away fades into one color, so that the floor has no end.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from terrainkit_robots.onboarding.camera import FIELD_OF_VIEW, View, framed
from terrainkit_robots.onboarding.visible import UNPAINTED, clear_shapes, outline, visible_shapes
from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    import mujoco

_FINER = 2
"""Each pixel is drawn as so many by so many and their mean is taken, which smooths edges."""

_SKY = (0.955, 0.965, 0.975)
"""Color of what is far away."""

_FLOOR = (0.93, 0.94, 0.95)
_LINE = (0.76, 0.78, 0.81)
_INK = (0.5, 0.52, 0.55)

_PAINT = (0.72, 0.74, 0.78, 1)
"""Color of shapes that were given none; MuJoCo's gray looks dirty in this light."""

_LIFT = 0.08
"""Black is drawn so light that its forms can be told."""

_SUN = np.array([-0.5, 0.55, -1.3])
"""Direction of the light that casts shadows; in front and at the side there is less of it."""

_LINES = 24
"""Lines of the grid on each side of the robot."""

_LARGEST = 1e3
"""A larger robot is not drawn [m]; its numbers would not fit those of the graphics library."""


class UndrawableError(Exception):
    """A robot of which no picture can be made; says why."""


class Studio:
    """A robot in a pose, ready to be pictured."""

    def __init__(self, model: "mujoco.MjModel", qpos: Matrix, size: tuple[int, int]) -> None:
        """Put a robot into the studio.

        Args:
            model: The robot; what it looks like is changed.
            qpos: Its pose, as MuJoCo has it.
            size: Width and height of each picture.

        Raises:
            UndrawableError: if there is nothing to be seen, or without end.
        """
        import mujoco

        self._model, self._data, self._size = model, mujoco.MjData(model), size
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(model, self._data)
        mujoco.mj_comPos(model, self._data)
        shapes = visible_shapes(model)
        self._points = outline(model, self._data, shapes)
        self._check()
        low, high = self._points.min(axis=0), self._points.max(axis=0)
        self._middle, self._lowest = (low + high) / 2, float(low[2])
        self._radius = max(float(np.linalg.norm(high - low)) / 2, 1e-3)
        self._dress(shapes)
        self._context = self._open()

    def _check(self) -> None:
        if not len(self._points):
            raise UndrawableError("the robot has no shape to be seen")
        if not (np.isfinite(self._points).all() and np.abs(self._points).max() < _LARGEST):
            raise UndrawableError(f"the robot reaches beyond {_LARGEST:g} m")

    def _dress(self, shapes: list[int]) -> None:
        """Have these shapes drawn and no others, and the sizes of the studio fit the robot's."""
        model, (width, height) = self._model, self._size
        model.geom_group[:] = 1
        model.geom_group[shapes] = 0
        bare = clear_shapes(model)  # there are some among `shapes` only if there is nothing else
        model.geom_matid[bare], model.geom_rgba[bare] = -1, UNPAINTED
        plain = (model.geom_rgba == UNPAINTED).all(axis=1)
        model.geom_rgba[~plain, :3] = _lifted(model.geom_rgba[~plain, :3])
        model.mat_rgba[:, :3] = _lifted(model.mat_rgba[:, :3])
        model.geom_rgba[plain & (model.geom_matid < 0)] = _PAINT
        model.stat.extent, model.stat.center = 2 * self._radius, self._middle
        model.vis.quality.shadowsize, model.vis.quality.offsamples = 4096, 0
        model.vis.quality.numslices = 64
        model.vis.global_.offwidth, model.vis.global_.offheight = width * _FINER, height * _FINER
        model.vis.global_.fovy = FIELD_OF_VIEW
        # Shadows are told from light with a tolerance that grows with this.
        model.vis.map.zfar = 1000.0

    def _open(self) -> "mujoco.MjrContext":
        """Return what pictures are drawn on; the graphics library is asked here first."""
        import mujoco

        width, height = self._size
        self._library = mujoco.GLContext(width * _FINER, height * _FINER)
        self._library.make_current()
        context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        return context

    def picture(self, view: View) -> Matrix:
        """Return a picture in red, green and blue, shape (height, width, 3), as uint8."""
        import cv2
        import mujoco

        width, height = self._size
        rectangle = mujoco.MjrRect(0, 0, width * _FINER, height * _FINER)
        scene, distance = self._scene(view)
        pixels = np.empty((height * _FINER, width * _FINER, 3), dtype=np.uint8)
        depths = np.empty(pixels.shape[:2], dtype=np.float32)
        mujoco.mjr_render(rectangle, scene, self._context)
        mujoco.mjr_readPixels(pixels, depths, rectangle, self._context)
        camera = scene.camera[0]
        away = _distances(depths, float(camera.frustum_near), float(camera.frustum_far))
        haze = np.clip((away - distance - 1.5 * self._radius) / (5 * self._radius), 0, 1)
        haze = (haze * haze * (3 - 2 * haze))[..., None].astype(np.float32)
        sky = np.array(_SKY, dtype=np.float32) * 255
        fine = (pixels * (1 - haze) + sky * haze)[::-1]
        small = cv2.resize(
            np.ascontiguousarray(fine), (width, height), interpolation=cv2.INTER_AREA
        )
        return self._captioned(np.round(small).astype(np.uint8))

    def _captioned(self, picture: Matrix) -> Matrix:
        """Return a picture with the width of the grid's squares in a corner."""
        import cv2

        height = picture.shape[0]
        ink = tuple(round(255 * share) for share in _INK)
        place, scale = (round(0.02 * height), round(0.975 * height)), height / 1100
        words = f"grid {_spacing(self._radius):g} m"
        cv2.putText(picture, words, place, cv2.FONT_HERSHEY_SIMPLEX, scale, ink, 1, cv2.LINE_AA)
        return picture

    def _scene(self, view: View) -> tuple["mujoco.MjvScene", float]:
        """Return what is seen from a side, and how far the camera is away [m]."""
        import mujoco

        model, (width, height) = self._model, self._size
        placing = framed(self._points, view, width / height)
        camera, options = mujoco.MjvCamera(), mujoco.MjvOption()
        camera.lookat, camera.distance = placing.target, placing.distance
        camera.azimuth, camera.elevation = view.azimuth, view.elevation
        options.geomgroup[:] = [1, 0, 0, 0, 0, 0]
        options.sitegroup[:] = 0
        options.flags[mujoco.mjtVisFlag.mjVIS_RANGEFINDER] = False
        model.vis.map.znear = placing.distance / 20 / model.stat.extent
        scene = mujoco.MjvScene(model, maxgeom=2 * model.ngeom + 1000)
        kinds = mujoco.mjtCatBit.mjCAT_STATIC | mujoco.mjtCatBit.mjCAT_DYNAMIC
        pert = mujoco.MjvPerturb()
        mujoco.mjv_updateScene(model, self._data, options, pert, camera, kinds, scene)
        self._lay_floor(scene)
        _light(scene, self._middle, 6 * self._radius, view.axes[0])
        scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = False
        scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = False
        return scene, placing.distance

    def _lay_floor(self, scene: "mujoco.MjvScene") -> None:
        import mujoco

        cell, radius = _spacing(self._radius), self._radius
        center = np.array([*np.round(self._middle[:2] / cell) * cell, self._lowest])
        _add(scene, mujoco.mjtGeom.mjGEOM_PLANE, [200 * radius, 200 * radius, 1], center, _FLOOR)
        thin, flat, length = 0.004 * radius, 2e-4 * radius, _LINES * cell
        for k in range(-_LINES, _LINES + 1):
            for along in (0, 1):
                half, place = [thin, thin, flat], center.copy()
                half[along] = length
                place[1 - along] += k * cell
                _add(scene, mujoco.mjtGeom.mjGEOM_BOX, half, place, _LINE)


def _add(
    scene: "mujoco.MjvScene", kind: int, size: list[float], place: Matrix, color: tuple[float, ...]
) -> None:
    import mujoco

    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        geom,
        kind,
        np.array(size),
        place,
        np.eye(3).ravel(),
        np.array([*color, 1], dtype=np.float32),
    )
    geom.category = mujoco.mjtCatBit.mjCAT_STATIC
    geom.matid = geom.objid = geom.segid = -1  # which the function leaves as they were
    geom.specular, geom.reflectance, geom.emission = 0.0, 0.0, 0.15
    scene.ngeom += 1


def _light(scene: "mujoco.MjvScene", middle: Matrix, far: float, forward: Matrix) -> None:
    """Put two lights into a scene: a sun with shadows, and a lamp beside the camera."""
    import mujoco

    sun = _SUN / np.linalg.norm(_SUN)
    lights = [(forward, 0.42, 0.2, 0.03, False), (sun, 0.0, 0.46, 0.1, True)]
    scene.nlight = len(lights)
    for light, (toward, ambient, diffuse, specular, shadow) in zip(
        scene.lights, lights, strict=False
    ):
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.pos, light.dir = middle - far * toward, toward
        light.ambient[:], light.diffuse[:], light.specular[:] = ambient, diffuse, specular
        light.castshadow, light.headlight = shadow, False
        light.attenuation[:] = [1, 0, 0]


def _lifted(colors: Matrix) -> Matrix:
    return np.asarray(_LIFT + (1 - _LIFT) * colors)


def _distances(depths: Matrix, near: float, far: float) -> Matrix:
    """Return how far away what is in each pixel is [m], from a depth that is 0 at `far`."""
    return near * far / (near + depths * (far - near))


def _spacing(radius: float) -> float:
    """Return the width of the grid's squares [m]: 1, 2 or 5 times a power of ten."""
    wanted = 0.4 * radius
    power = 10.0 ** math.floor(math.log10(wanted))
    return float(f"{power * max(n for n in (1, 2, 5) if n * power <= wanted * 1.0001):.3g}")
