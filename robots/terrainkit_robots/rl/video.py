"""The video: robots on their ground, drawn by MuJoCo without a window, as an mp4.

It is drawn in a process of its own, which is `stage`: see `graphics_library`.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.atomic_write import atomic_write
from terrainkit.errors import ConfigError, ExportError
from terrainkit_robots import gl_backend
from terrainkit_robots.onboarding.pictures import PicturesError

FloatArray = NDArray[np.float32]

SUFFIX = ".mp4"

SIZE = (640, 360)
"""Width and height of a video unless told [pixels]; without a graphics card a frame takes 0.2 s."""

_REQUEST, ANSWER, DONE, VIDEO = "request.json", "answer.json", "done", "video.mp4"
"""Files of the other process: what it is asked, its answer, a byte for each frame that is drawn,
and the video."""

_PATIENCE = 120.0
"""A frame that takes longer will never come [s]."""


@dataclass(frozen=True, kw_only=True)
class Shot:
    """A part of a video, in which the camera follows a robot."""

    robot: int
    """Which it follows."""

    start: int
    """First of the recorded frames."""

    stop: int
    """The one after the last."""

    captions: tuple[str, ...]
    """What is written below each frame, shape (stop - start,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Film:
    """What is to be drawn."""

    model: Any
    """The `mujoco.MjModel` of the scene, with one robot."""

    poses: FloatArray
    """qpos of each robot in each frame, shape (frames, n, nq)."""

    shots: tuple[Shot, ...]
    """What is shown, in this order."""

    fps: float
    """Frames per second."""

    size: tuple[int, int] = SIZE
    """Width and height [pixels]."""

    def __post_init__(self) -> None:
        check_size(self.size)
        if not len(self):
            raise ConfigError("the video has no frames; wanted one or more")

    def __len__(self) -> int:
        """Return how many frames there will be."""
        return sum(shot.stop - shot.start for shot in self.shots)


def check_size(size: tuple[int, int]) -> None:
    """Raise a ConfigError if a video cannot be so large; odd numbers do not fit its colors."""
    if any(n % 2 or not 64 <= n <= 4096 for n in size):
        raise ConfigError(f"size is {size}; wanted two even numbers from 64 to 4096")


def check_video(path: Path, *, overwrite: bool = False) -> None:
    """Raise an error if a video cannot or may not be written at `path`.

    Raises:
        ConfigError: if it is not an mp4.
        ExportError: if the file is there and `overwrite` is not set, or cannot be written.
    """
    from terrainkit.atomic_write import check_target

    if path.suffix != SUFFIX:
        raise ConfigError(f"a video {path.name}; wanted a name that ends in {SUFFIX}")
    check_target(path, overwrite=overwrite)


def film_frames(film: Film, path: Path, *, overwrite: bool = False) -> Iterator[int]:
    """Draw a video and write it, and yield the number of each frame once it is drawn.

    Raises:
        ConfigError: if it is not an mp4.
        ExportError: if the file is there and `overwrite` is not set, or it cannot be written.
        PicturesError: if MuJoCo cannot draw here.
    """
    check_video(path, overwrite=overwrite)
    with (
        tempfile.TemporaryDirectory(prefix="terrainkit-", ignore_cleanup_errors=True) as name,
        atomic_write(path, overwrite=overwrite) as target,
    ):
        folder = Path(name)
        _ask(film, folder)
        complaints = {}
        for library in gl_backend.libraries():
            yield from _drawn(library, folder, len(film))
            answer = gl_backend.take_answer(folder / ANSWER, "it crashed")
            if "frames" in answer:
                shutil.copyfile(folder / VIDEO, target)
                return
            if "unwritten" in answer:
                raise ExportError(f"{path} cannot be written: {answer['unwritten']}")
            complaints[library] = answer["failed"]
        raise PicturesError(gl_backend.cannot_draw(complaints))


def _ask(film: Film, folder: Path) -> None:
    """Write what the other process needs."""
    import mujoco

    mujoco.mj_saveModel(film.model, str(folder / "scene.mjb"))
    np.save(folder / "poses.npy", film.poses)
    request = {
        "folder": str(folder),
        "shots": [vars(shot) for shot in film.shots],
        "fps": film.fps,
        "size": list(film.size),
    }
    (folder / _REQUEST).write_text(json.dumps(request))


def _drawn(library: str, folder: Path, frames: int) -> Iterator[int]:
    """Let the other process draw, and yield the number of each frame once it is done."""
    with (folder / _REQUEST).open("rb") as request:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "terrainkit_robots.rl.stage"],
            stdin=request,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=gl_backend.environment(library),
            cwd=folder,
            start_new_session=True,
        )
    try:
        done, last = 0, time.monotonic()
        while process.poll() is None:
            time.sleep(0.05)
            now = _size(folder / DONE)
            yield from range(done, min(now, frames))
            if now > done:
                done, last = now, time.monotonic()
            elif time.monotonic() - last > _PATIENCE:
                raise PicturesError(f"MuJoCo did not draw in time ({library or 'its default'})")
        yield from range(done, min(_size(folder / DONE), frames))
    finally:
        _end(process)
        (folder / DONE).unlink(missing_ok=True)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End it if it runs, and ffmpeg with it."""
    if process.poll() is None:
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        process.kill()
    process.wait()


def _size(file: Path) -> int:
    try:
        return file.stat().st_size
    except OSError:
        return 0
