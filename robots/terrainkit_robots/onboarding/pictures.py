"""Pictures: a robot in its pose, from three sides, drawn by MuJoCo without a window.

They are drawn in a process of their own: see `graphics_library`.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from terrainkit.errors import TerrainkitError
from terrainkit_robots import gl_backend
from terrainkit_robots.onboarding.picture_process import ANSWER

SIZE = (480, 420)
"""Width and height of a picture [pixels]."""

SECONDS = 60.0
"""How long all pictures may take [s]; large robots take 3 s without a graphics card."""


class PicturesError(TerrainkitError):
    """There can be no pictures; says why in one line."""


def draw(
    file: Path,
    qpos: Sequence[float] | None = None,
    *,
    size: tuple[int, int] = SIZE,
    seconds: float = SECONDS,
) -> dict[str, bytes]:
    """Return the PNG of each view of a robot, by its name: front, side and corner.

    The environment variable MUJOCO_GL says how MuJoCo is to draw; without it, EGL and then OSMesa
    are tried on Linux.

    Args:
        file: The robot's MJCF, or a model that MuJoCo has compiled (.mjb).
        qpos: Its pose, as MuJoCo has it; unless given, its first keyframe, or its initial pose.
        size: Width and height of a picture [pixels].
        seconds: How long all may take [s].

    Raises:
        PicturesError: if MuJoCo cannot draw here, or not this robot.
    """
    deadline = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="terrainkit-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        request = {
            "folder": name,
            "model": str(file.absolute()),
            "qpos": None if qpos is None else [float(each) for each in qpos],
            "size": list(size),
        }
        complaints = {}
        for library in gl_backend.libraries():
            answer = _ask(request, library, deadline, folder)
            if "pictures" in answer:
                return {view: (folder / f"{view}.png").read_bytes() for view in answer["pictures"]}
            if "undrawable" in answer:
                raise PicturesError(f"MuJoCo cannot draw it: {answer['undrawable']}")
            complaints[library] = answer["failed"]
    raise PicturesError(gl_backend.cannot_draw(complaints))


def _ask(request: Mapping[str, Any], library: str, deadline: float, folder: Path) -> dict[str, Any]:
    """Return what the other process answers, or how it failed."""
    left = deadline - time.monotonic()
    try:
        process = subprocess.run(
            [sys.executable, "-P", "-m", "terrainkit_robots.onboarding.picture_process"],
            input=json.dumps(request).encode(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=gl_backend.environment(library),
            cwd=folder,
            timeout=max(left, 0.0),
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise PicturesError(f"MuJoCo did not draw it in time ({library or 'default'})") from None
    crash = f"it crashed (exit code {process.returncode})"
    return gl_backend.take_answer(folder / ANSWER, crash)
