"""Pictures: a robot in its pose, from three sides, drawn by MuJoCo without a window.

They are drawn in a process of their own: which graphics library MuJoCo takes is settled when it is
imported, and a broken one may crash.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from terrainkit.errors import TerrainkitError
from terrainkit_robots.onboard.picture_process import ANSWER
from terrainkit_robots.wording import short

SIZE = (480, 420)
"""Width and height of a picture [pixels]."""

SECONDS = 60.0
"""How long all pictures may take [s]; large robots take 3 s without a graphics card."""

_MOST_WORDS = 160
"""So many characters of a graphics library's complaint are passed on."""


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
        complaints = []
        for library in _libraries():
            answer = _ask(request, library, deadline, folder)
            if "pictures" in answer:
                return {view: (folder / f"{view}.png").read_bytes() for view in answer["pictures"]}
            if "undrawable" in answer:
                raise PicturesError(f"MuJoCo cannot draw it: {answer['undrawable']}")
            complaints.append(f"{library or 'its default'}: {answer['failed']}")
    raise PicturesError(f"MuJoCo cannot draw here ({'; '.join(complaints)}); {_advice()}")


def _asked() -> str:
    """Return the library that the environment names; the command line puts that variable aside."""
    return (os.environ.get("TERRAINKIT_MUJOCO_GL") or os.environ.get("MUJOCO_GL", "")).strip()


def _libraries() -> tuple[str, ...]:
    """Return what to try as MUJOCO_GL, in this order."""
    asked = _asked()
    if asked:
        return (asked,)
    return ("egl", "osmesa") if sys.platform == "linux" else ("",)


def _advice() -> str:
    if _asked():
        return "MUJOCO_GL says so; unset it to have EGL and OSMesa tried"
    return "install EGL or OSMesa (Debian: libegl1 libgl1-mesa-dri, or libosmesa6)"


def _ask(request: Mapping[str, Any], library: str, deadline: float, folder: Path) -> dict[str, Any]:
    """Return what the other process answers, or how it failed."""
    left = deadline - time.monotonic()
    try:
        process = subprocess.run(
            [sys.executable, "-P", "-m", "terrainkit_robots.onboard.picture_process"],
            input=json.dumps(request).encode(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=_environment(library),
            cwd=folder,
            timeout=max(left, 0.0),
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise PicturesError(f"MuJoCo did not draw it in time ({library or 'default'})") from None
    try:
        answer: dict[str, Any] = json.loads((folder / ANSWER).read_bytes())
    except (OSError, ValueError):
        return {"failed": f"it crashed (exit code {process.returncode})"}
    (folder / ANSWER).unlink()
    for key in answer.keys() & {"failed", "undrawable"}:
        answer[key] = short(" ".join(answer[key].split()), _MOST_WORDS)
    return answer


def _environment(library: str) -> dict[str, str]:
    """Return the environment of the other process, which finds modules where this one does."""
    environment = dict(os.environ)
    environment.pop("PYOPENGL_PLATFORM", None)  # which MuJoCo sets, here to another library
    environment.pop("MUJOCO_GL", None)
    if library:
        environment["MUJOCO_GL"] = library
    # Nothing is to be left on this machine.
    environment.setdefault("MESA_SHADER_CACHE_DISABLE", "true")
    environment.setdefault("__GL_SHADER_DISK_CACHE", "0")
    environment["PYTHONPATH"] = os.pathsep.join(
        str(Path(entry).absolute()) for entry in sys.path if entry
    )
    return environment
