"""Render frames in a child process, since a broken OpenGL library may crash or block a process."""

import faulthandler
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import TerrainkitError
from terrainkit.settings.text import truncate
from terrainkit_robots import gl_backend
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.text import one_line

Frame = NDArray[np.uint8]  # an RGB image, shape (height, width, 3)
FRAME_TIMEOUT = 120.0  # maximum time for a single frame [s]


class RenderError(TerrainkitError):
    """Rendering failed; the message gives the reason in one line."""


def stream_frames(
    render: Callable[..., Iterator[Frame]], inputs: Iterator[Any] | None = None
) -> Iterator[Frame]:
    """Yield the frames that a picklable function renders in a child process.

    The backends of `gl_backend.backends()` are tried in order until one renders a frame.

    Args:
        render: Called without arguments, or with an iterator of the inputs.
        inputs: Endless picklable inputs. Each frame takes the next one, when it is requested.

    Raises:
        RenderError: if no backend works, a frame takes too long, or `render` raises this error.
    """
    reasons: list[str] = []
    for backend in gl_backend.backends():
        reason = yield from _run_child(render, inputs, backend)
        if not reason:
            return
        reasons.append(f"{backend or 'default backend'}: {truncate(one_line(reason), 160)}")
    advice = gl_backend.installation_advice()
    raise RenderError(f"MuJoCo cannot render here ({'; '.join(reasons)}); {advice}")


def _run_child(
    render: Callable[..., Iterator[Frame]], inputs: Iterator[Any] | None, backend: str
) -> Generator[Frame, None, str]:
    """Yield frames, and return why the backend failed, or an empty string."""
    command = [sys.executable, "-P", "-c", f"from {__name__} import main; main({FRAME_TIMEOUT})"]
    environment, count = gl_backend.child_environment(backend), 0
    # MuJoCo may write a log into its working directory, which is therefore a temporary one.
    with tempfile.TemporaryDirectory(prefix="terrainkit-", ignore_cleanup_errors=True) as folder:
        Path(folder, "request").write_bytes(pickle.dumps((render, inputs is not None)))
        pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        pipes["stderr"] = subprocess.DEVNULL
        process = subprocess.Popen(command, env=environment, cwd=folder, **pipes)
        try:
            while isinstance(message := _next_message(process, inputs), np.ndarray):
                yield message
                count += 1
        except (EOFError, pickle.UnpicklingError):
            message = f"no frame within {FRAME_TIMEOUT:g} s or crash, exit code {process.wait()}"
        finally:
            process.kill()
            process.communicate()
    if isinstance(message, RenderError):
        raise message
    if message and count:  # another backend would start again with the first frame
        raise RenderError(f"rendering failed after {count} frames: {one_line(message)}")
    return str(message)


def _next_message(process: Any, inputs: Iterator[Any] | None) -> Any:
    """Send the next input, if any, and return what the child process answers."""
    if inputs is not None:
        with suppress(BrokenPipeError):  # a child that ended has written why
            pickle.dump(next(inputs), process.stdin)
            process.stdin.flush()
    return pickle.load(process.stdout)


def _received_inputs(timeout: float) -> Iterator[Any]:
    """Yield the inputs from stdin, without a limit of the time until they arrive."""
    with suppress(EOFError):
        while True:
            faulthandler.cancel_dump_traceback_later()
            received = pickle.load(sys.stdin.buffer)
            faulthandler.dump_traceback_later(timeout, exit=True)
            yield received


def main(timeout: float) -> None:
    """Call the pickled function, and write its frames and then an error or "" to stdout."""
    message: Any = ""
    with os.fdopen(os.dup(1), "wb") as output:
        os.dup2(2, 1)  # OpenGL libraries print to stdout
        faulthandler.dump_traceback_later(timeout, exit=True)
        try:
            render, has_inputs = pickle.loads(Path("request").read_bytes())
            with quiet_mujoco():
                for frame in render(_received_inputs(timeout)) if has_inputs else render():
                    faulthandler.cancel_dump_traceback_later()  # the reader may take its time
                    pickle.dump(frame, output)
                    output.flush()
                    faulthandler.dump_traceback_later(timeout, exit=True)
        except RenderError as error:
            message = error
        except Exception as error:  # OpenGL bindings raise errors of any type
            message = f"{type(error).__name__}: {error}"
        pickle.dump(message, output)
