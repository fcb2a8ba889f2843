"""Videos of policies: MuJoCo renders robots on a terrain, and ffmpeg encodes them as H.264."""

import copy
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, ExportError, one_line
from terrainkit.files.atomic_write import atomic_write, check_target
from terrainkit_robots.rendering import appearance
from terrainkit_robots.rendering.child_process import Frame, stream_frames

FloatArray = NDArray[np.floating[Any]]

DEFAULT_SIZE, MIN_SIZE, MAX_SIZE = (640, 360), 64, 4096  # [pixels]
AZIMUTH, AZIMUTH_SWING, ELEVATION = 128.0, 10.0, -16.0  # angles of the camera [deg]
MAX_OTHER_ROBOTS, MAX_OTHER_DISTANCE = 24, 14.0  # limits of the robots that are rendered, [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class Shot:
    """A part of a video in which the camera follows one robot, from its first recorded frame."""

    robot: int  # index of the robot
    captions: tuple[str, ...]  # text at the bottom of each frame


@dataclass(frozen=True, kw_only=True, eq=False)
class VideoSpec:
    """The content and the format of a video."""

    model: Any  # the `mujoco.MjModel` of the scene, with one robot
    poses: NDArray[np.float32]  # qpos of robots in recorded frames, shape (frames, robots, nq)
    shots: tuple[Shot, ...]
    fps: float  # frames per second
    size: tuple[int, int] = DEFAULT_SIZE  # width and height [pixels]

    def __post_init__(self) -> None:
        check_video_size(self.size)
        if not self.num_frames:
            raise ConfigError("frames of the video: got 0; expected 1 or more")

    @property
    def num_frames(self) -> int:
        """Number of frames of all shots."""
        return sum(len(shot.captions) for shot in self.shots)


def check_video_size(size: tuple[int, int]) -> None:
    """Check the size of a video.

    Args:
        size: Width and height [pixels].

    Raises:
        ConfigError: if a side is odd or out of range.
    """
    if any(n % 2 or not MIN_SIZE <= n <= MAX_SIZE for n in size):
        expected = f"two even numbers from {MIN_SIZE} to {MAX_SIZE}"
        raise ConfigError(f"size of the video: got {size}; expected {expected}")


def check_video_path(path: Path, *, overwrite: bool = False) -> None:
    """Check that a video can be written to a path.

    Args:
        path: The file.
        overwrite: Whether an existing file may be replaced.

    Raises:
        ConfigError: if the suffix is not .mp4.
        ExportError: if the file cannot be written.
    """
    if path.suffix != ".mp4":
        raise ConfigError(f"video file: got {path.name}; expected a name that ends in .mp4")
    check_target(path, overwrite=overwrite)


def write_video(spec: VideoSpec, path: Path, *, overwrite: bool = False) -> Iterator[int]:
    """Render and write a video, and yield the index of each frame after it is rendered.

    Raises:
        ConfigError: if the suffix of the path is not .mp4.
        ExportError: if the file exists and `overwrite` is False, or cannot be encoded or written.
        RenderError: if MuJoCo cannot render on this machine.
    """
    from imageio_ffmpeg import count_frames_and_secs, write_frames

    check_video_path(path, overwrite=overwrite)
    with atomic_write(path, overwrite=overwrite) as target:
        options = ["-f", "mp4", "-preset", "veryfast", "-movflags", "+faststart"]
        settings = {"macro_block_size": 1, "ffmpeg_log_level": "quiet", "output_params": options}
        encoder = write_frames(str(target), spec.size, fps=spec.fps, **settings)
        try:
            encoder.send(None)
            for index, frame in enumerate(stream_frames(partial(video_frames, spec))):
                encoder.send(frame)
                yield index
            encoder.close()
            # The encoder does not report errors at the end of the file, such as a full disk.
            num_frames, _ = count_frames_and_secs(str(target))
            if num_frames != spec.num_frames:
                raise OSError(f"{num_frames} of {spec.num_frames} frames are in the file")
        except (OSError, RuntimeError) as error:
            reason = one_line(str(error).partition("\n\n")[0])
            raise ExportError(f"{path} cannot be encoded by ffmpeg: {reason}") from None
        finally:
            encoder.close()


def video_frames(spec: VideoSpec) -> Iterator[Frame]:
    """Yield the frames of all shots of a video."""
    distance = prepare_model(spec.model)
    for shot in spec.shots:
        yield from _shot_frames(spec, shot, distance)


def prepare_model(model: Any) -> float:
    """Adjust what a model shows, and return the distance of a camera from its robot [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    is_robot = model.body_weldid[model.geom_bodyid] != 0
    away = np.linalg.norm(data.geom_xpos - data.qpos[:3], axis=1) + model.geom_rbound
    distance = 8 * float(away[is_robot].max(initial=0.05))
    if not np.isin(model.geom_group[is_robot], appearance.VISIBLE_GROUPS).any():
        model.geom_group[is_robot] = 0
    # OpenGL adds the light of coplanar surfaces, such as the overlapping boxes of stairs.
    boxes = np.flatnonzero(~is_robot & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX))
    model.geom_pos[boxes, 2] -= 1e-4 * (np.arange(len(boxes)) % 31)
    return distance


def visible_area(
    targets: FloatArray, distance: float, size: tuple[int, int]
) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corner of the ground that cameras see, shape (2,) each [m].

    Args:
        targets: Points that the cameras look at [m], shape (frames, 3).
        distance: Distance of the cameras [m].
        size: Width and height of the frames [pixels].
    """
    slope = math.tan(math.radians(appearance.FIELD_OF_VIEW / 2))
    half_width = AZIMUTH_SWING + math.degrees(math.atan(size[0] / size[1] * slope))
    angles = np.radians(AZIMUTH + half_width * np.linspace(-1, 1, 5))
    rays = distance * np.column_stack([np.cos(angles), np.sin(angles)])
    view = targets[:, None, :2] + np.concatenate([-1.2 * rays, appearance.FOG_END * rays])
    return view.min(axis=(0, 1)), view.max(axis=(0, 1))


def _shot_frames(spec: VideoSpec, shot: Shot, distance: float) -> Iterator[Frame]:
    poses = spec.poses[: len(shot.captions)]
    targets = smooth_path(poses[:, shot.robot, :3], 0.4 * spec.fps)
    model = cut_heightfields(spec.model, *visible_area(targets, distance, spec.size))
    data, other_data, unchanged = mujoco.MjData(model), mujoco.MjData(model), mujoco.MjvPerturb()
    moving = mujoco.mjtCatBit.mjCAT_DYNAMIC
    with appearance.make_renderer(model, spec.size, distance) as renderer:
        for k, caption in enumerate(shot.captions):
            data.qpos[:] = poses[k, shot.robot]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_camlight(model, data)
            camera = distance, AZIMUTH + AZIMUTH_SWING * math.sin(0.4 * k / spec.fps), ELEVATION
            options = appearance.update_scene(renderer, data, targets[k], *camera)
            away = np.linalg.norm(poses[k, :, :2] - poses[k, shot.robot, :2], axis=1)
            away[shot.robot] = -1
            others = np.argsort(away)[1 : MAX_OTHER_ROBOTS + 1]
            for robot in others[away[others] < MAX_OTHER_DISTANCE]:
                other_data.qpos[:] = poses[k, robot]
                mujoco.mj_kinematics(model, other_data)
                mujoco.mjv_addGeoms(model, other_data, options, unchanged, moving, renderer.scene)
            frame = renderer.render()
            appearance.add_caption(frame, caption, spec.size[1] / 750)
            yield frame


def smooth_path(path: FloatArray, sigma: float) -> FloatArray:
    """Return a path after a Gaussian filter.

    Args:
        path: Positions [m], shape (frames, 3).
        sigma: Standard deviation of the filter [frames].

    Returns:
        Positions [m], shape (frames, 3).
    """
    from scipy.ndimage import gaussian_filter1d

    # The deviation from a straight line is filtered, so that the camera has no lag at the ends.
    line = np.linspace(path[0], path[-1], len(path))
    return np.asarray(line + gaussian_filter1d(path - line, sigma, axis=0, mode="nearest"))


def cut_heightfields(model: Any, lower: FloatArray, upper: FloatArray) -> Any:
    """Return a copy of a model whose heightfields cover a rectangle, given by its corners [m].

    Without a GPU, most of the time would be spent on the triangles of a large heightfield.
    """
    model, data = copy.copy(model), mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    model.geom_sameframe[:] = 0  # otherwise MuJoCo ignores changes of geom_pos
    is_level = np.isclose(data.geom_xmat, np.eye(3).ravel()).all(axis=1)
    for geom in np.flatnonzero(is_level & (model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD)):
        field = model.hfield(model.geom_dataid[geom])
        heights = field.data.reshape(field.nrow[0], field.ncol[0])  # along y, along x
        last, half = np.array(heights.shape[::-1]) - 1, field.size[:2].copy()
        step, corner = 2 * half / last, data.geom_xpos[geom, :2] - half
        low = np.clip((lower - corner) // step, 0, last - 1).astype(int)
        high = np.clip(-((corner - upper) // step), low + 1, last).astype(int)
        part = heights[low[1] : high[1] + 1, low[0] : high[0] + 1].copy()
        field.data.flat[: part.size] = part.flat
        field.nrow[:], field.ncol[:] = part.shape
        field.size[:2] = (high - low) * step / 2
        model.geom_pos[geom, :2] += (low + high) * step / 2 - half
    return model
