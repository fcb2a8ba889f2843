"""Render frames in a child process, since a broken OpenGL library may crash or block a process."""

import os
import pickle
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Generator, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import TerrainkitError
from terrainkit.text import truncate
from terrainkit_robots import gl_backend
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.text import one_line

Frame = NDArray[np.uint8]
"""An RGB image, shape (height, width, 3)."""

FRAME_TIMEOUT = 120.0
"""Maximum time for a single frame [s]."""


class RenderError(TerrainkitError):
    """Rendering failed; the message gives the reason in one line."""


def stream_frames(render: Callable[[], Iterator[Frame]]) -> Iterator[Frame]:
    """Yield the frames that a function renders in a child process.

    The backends of `gl_backend.backends()` are tried in order until one renders a frame.

    Args:
        render: A picklable function without arguments that returns an iterator of frames.

    Raises:
        RenderError: if no backend works, a frame takes too long, or `render` raises this error.
    """
    reasons: list[str] = []
    for backend in gl_backend.backends():
        reason = yield from _run_child(render, backend)
        if not reason:
            return
        reasons.append(f"{backend or 'default backend'}: {truncate(one_line(reason), 160)}")
    advice = gl_backend.installation_advice()
    raise RenderError(f"MuJoCo cannot render here ({'; '.join(reasons)}); {advice}")


def _run_child(render: Callable[[], Iterator[Frame]], backend: str) -> Generator[Frame, None, str]:
    """Yield frames, and return why the backend failed, or an empty string."""
    command = [sys.executable, "-P", "-m", "terrainkit_robots.rendering"]
    environment, count = gl_backend.child_environment(backend), 0
    # MuJoCo may write a log into its working directory, which is therefore a temporary one.
    with (
        tempfile.TemporaryDirectory(prefix="terrainkit-", ignore_cleanup_errors=True) as folder,
        tempfile.TemporaryFile() as request,
    ):
        pickle.dump(render, request)
        request.seek(0)
        process = subprocess.Popen(
            command,
            env=environment,
            cwd=folder,
            stdin=request,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        try:
            while isinstance(message := _receive(process), np.ndarray):
                yield message
                count += 1
        finally:
            process.kill()
            process.communicate()
    if isinstance(message, RenderError):
        raise message
    if message and count:  # another backend would start again with the first frame
        raise RenderError(f"rendering failed after {count} frames: {one_line(message)}")
    return str(message)


def _receive(process: subprocess.Popen[bytes]) -> Any:
    """Return the next message: a frame, a RenderError, or a reason that is empty at the end."""
    assert process.stdout is not None
    timer = threading.Timer(FRAME_TIMEOUT, process.kill)
    timer.daemon = True
    timer.start()
    try:
        return pickle.load(process.stdout)
    except (EOFError, pickle.UnpicklingError):
        timer.join(0.1)
        if timer.finished.is_set():
            return RenderError(f"MuJoCo rendered no frame within {FRAME_TIMEOUT:g} s")
        return f"the process crashed (exit code {process.wait()})"
    finally:
        timer.cancel()


def main() -> None:
    """Read a pickled function from stdin, and write its frames to stdout as pickles."""
    message: Any = ""
    with os.fdopen(os.dup(1), "wb") as output:
        os.dup2(2, 1)  # OpenGL libraries print to stdout
        try:
            render = pickle.load(sys.stdin.buffer)
            with quiet_mujoco():
                for frame in render():
                    pickle.dump(frame, output)
                    output.flush()
        except RenderError as error:
            message = error
        except Exception as error:  # OpenGL bindings raise errors of any type
            message = f"{type(error).__name__}: {error}"
        pickle.dump(message, output)
