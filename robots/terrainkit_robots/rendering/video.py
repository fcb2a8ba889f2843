"""Videos of policies: MuJoCo renders the frames, and ffmpeg encodes them as H.264."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots.text import one_line

DEFAULT_SIZE = (640, 360)
"""Width and height of a video [pixels]; without a GPU a frame takes 0.2 s."""

MIN_SIZE, MAX_SIZE = 64, 4096


@dataclass(frozen=True, kw_only=True)
class Shot:
    """A part of a video in which the camera follows one robot."""

    robot: int
    """Index of the robot."""

    start: int
    """First recorded frame."""

    stop: int
    """One past the last recorded frame."""

    captions: tuple[str, ...]
    """Text at the bottom of each frame, shape (stop - start,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class VideoSpec:
    """The content and the format of a video."""

    model: Any
    """The `mujoco.MjModel` of the scene, with one robot."""

    poses: NDArray[np.float32]
    """qpos of each robot in each recorded frame, shape (frames, robots, nq)."""

    shots: tuple[Shot, ...]
    """Shots in the order of the video."""

    fps: float
    """Frames per second."""

    size: tuple[int, int] = DEFAULT_SIZE
    """Width and height [pixels]."""

    def __post_init__(self) -> None:
        check_video_size(self.size)
        if not self.num_frames:
            raise ConfigError("frames of the video: got 0; expected 1 or more")

    @property
    def num_frames(self) -> int:
        """Number of frames of all shots."""
        return sum(shot.stop - shot.start for shot in self.shots)


def check_video_size(size: tuple[int, int]) -> None:
    """Raise a ConfigError unless both sides are even numbers in the supported range."""
    if any(n % 2 or not MIN_SIZE <= n <= MAX_SIZE for n in size):
        expected = f"two even numbers from {MIN_SIZE} to {MAX_SIZE}"
        raise ConfigError(f"size of the video: got {size}; expected {expected}")


def check_video_path(path: Path, *, overwrite: bool = False) -> None:
    """Check that a video can be written to a path.

    Raises:
        ConfigError: if the suffix is not .mp4.
        ExportError: if the file exists and `overwrite` is False, or cannot be written.
    """
    from terrainkit.atomic_write import check_target

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

    from terrainkit.atomic_write import atomic_write
    from terrainkit_robots.rendering.child_process import stream_frames
    from terrainkit_robots.rendering.video_frames import video_frames

    check_video_path(path, overwrite=overwrite)
    with atomic_write(path, overwrite=overwrite) as target:
        options = ["-f", "mp4", "-preset", "veryfast", "-movflags", "+faststart"]
        encoder = write_frames(
            str(target),
            spec.size,
            fps=spec.fps,
            codec="libx264",
            macro_block_size=1,
            ffmpeg_log_level="quiet",
            output_params=options,
        )
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
