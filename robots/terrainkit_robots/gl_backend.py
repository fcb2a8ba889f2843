"""The graphics library that MuJoCo draws with, where there is no window.

Which one it takes is settled when MuJoCo is imported, by the variable MUJOCO_GL. So pictures are
drawn in processes of their own, one for each library that is tried; a broken one may crash.
"""

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from terrainkit_robots.text import short

_MOST_WORDS = 160
"""So many characters of a complaint are passed on."""


def libraries() -> tuple[str, ...]:
    """Return what to try as MUJOCO_GL, in this order; an empty one is MuJoCo's default.

    What the user asks for is all that is tried. Otherwise, on Linux, EGL and then OSMesa are.
    """
    asked = _asked()
    if asked:
        return (asked,)
    return ("egl", "osmesa") if sys.platform == "linux" else ("",)


def environment(library: str) -> dict[str, str]:
    """Return the environment of a process that draws, which finds modules where this one does.

    Args:
        library: One of `libraries()`.
    """
    variables = dict(os.environ)
    variables.pop("PYOPENGL_PLATFORM", None)  # which MuJoCo sets, here to another library
    variables.pop("MUJOCO_GL", None)
    if library:
        variables["MUJOCO_GL"] = library
    # Nothing is to be left on this machine.
    variables.setdefault("MESA_SHADER_CACHE_DISABLE", "true")
    variables.setdefault("__GL_SHADER_DISK_CACHE", "0")
    variables["PYTHONPATH"] = os.pathsep.join(
        str(Path(entry).absolute()) for entry in sys.path if entry
    )
    return variables


def take_answer(file: Path, crash: str) -> dict[str, Any]:
    """Return what a process that draws has answered, complaints in one line, and take it away.

    Args:
        file: The JSON that it was to write.
        crash: What has `failed` if it wrote none.
    """
    try:
        answer: dict[str, Any] = json.loads(file.read_bytes())
    except (OSError, ValueError):
        return {"failed": crash}
    file.unlink()
    for key, told in answer.items():
        if isinstance(told, str):
            answer[key] = short(" ".join(told.split()), _MOST_WORDS)
    return answer


def cannot_draw(complaints: Mapping[str, str]) -> str:
    """Return that none of the libraries draws, and what a user can do.

    Args:
        complaints: How each library that was tried failed.
    """
    told = "; ".join(f"{name or 'its default'}: {how}" for name, how in complaints.items())
    return f"MuJoCo cannot draw here ({told}); {advice()}"


def advice() -> str:
    """Return what a user can do when none of the libraries draws."""
    if _asked():
        return "MUJOCO_GL says so; unset it to have EGL and OSMesa tried"
    return "install EGL or OSMesa (Debian: libegl1 libgl1-mesa-dri, or libosmesa6)"


def _asked() -> str:
    """Return the library that the environment names; the command line puts that variable aside."""
    return (os.environ.get("TERRAINKIT_MUJOCO_GL") or os.environ.get("MUJOCO_GL", "")).strip()
