"""Render frames in a child process, since a broken OpenGL library may crash or block a process."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import TerrainkitError
from terrainkit.files.child_process import ChildProcess, ProcessError, ProcessLimits
from terrainkit.settings.text import truncate
from terrainkit_robots import gl_backend
from terrainkit_robots.quiet_mujoco import quiet_mujoco

Frame = NDArray[np.uint8]  # an RGB image, shape (height, width, 3)

LIMITS = ProcessLimits(seconds=120.0, memory=None)
"""Limits of a frame; drivers of graphics cards map more memory than there is."""


class RenderError(TerrainkitError):
    """Rendering failed; the message gives the reason in one line."""


def stream_frames(
    render: Callable[..., Iterator[Frame]], inputs: Iterator[Any] | None = None
) -> Iterator[Frame]:
    """Start to render in a child process, and yield the frames of a picklable function.

    The backends of `gl_backend.backends()` are tried in order until one renders a frame.

    Args:
        render: Called without arguments, or with an iterator of the inputs.
        inputs: Endless picklable inputs. Each frame takes the next one, when it is requested.

    Raises:
        RenderError: if no backend works, a frame takes too long, or `render` raises this error.
    """

    def start(backend: str) -> ChildProcess:
        environment = gl_backend.child_environment(backend)
        arguments = _frames, render, inputs is not None
        return ChildProcess(*arguments, limits=LIMITS, environment=environment)

    first, *others = gl_backend.backends()
    child = start(first)  # now, and not when the first frame is requested
    return _stream_frames(inputs, {first: lambda: child} | {b: partial(start, b) for b in others})


def _stream_frames(
    inputs: Iterator[Any] | None, processes: Mapping[str, Callable[[], ChildProcess]]
) -> Iterator[Frame]:
    """Yield the frames of the first process whose backend works, by name of the backend."""
    reasons: list[str] = []
    for backend, start in processes.items():
        count = 0
        try:
            with start() as child:
                while answer := _next_answer(child, inputs):
                    if "error" in answer:
                        raise RenderError(str(answer["error"]))
                    yield answer["frame"]
                    count += 1
            return
        except ProcessError as error:
            if count:  # another backend would start again with the first frame
                raise RenderError(f"rendering failed after {count} frames: {error}") from None
            reasons.append(f"{backend or 'default backend'}: {truncate(str(error), 160)}")
    advice = gl_backend.installation_advice()
    raise RenderError(f"MuJoCo cannot render here ({'; '.join(reasons)}); {advice}")


def _next_answer(child: ChildProcess, inputs: Iterator[Any] | None) -> dict[str, NDArray[Any]]:
    if inputs is not None:
        child.send(next(inputs))
    return child.receive()


def _frames(
    received: Iterator[Any], render: Callable[..., Iterator[Frame]], takes_inputs: bool
) -> Iterator[dict[str, Any]]:
    """Yield each frame of `render`, and the message of its RenderError."""
    try:
        with quiet_mujoco():
            for frame in render(received) if takes_inputs else render():
                yield {"frame": frame}
    except RenderError as error:
        yield {"error": str(error)}
