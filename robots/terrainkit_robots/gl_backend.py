"""The OpenGL backend that MuJoCo renders with when there is no window.

MuJoCo chooses its backend at import, from the environment variable MUJOCO_GL. Rendering therefore
runs in a child process, one for each backend that is tried.
"""

import os
import sys


def backends() -> tuple[str, ...]:
    """Return the values of MUJOCO_GL to try, in order; an empty string is MuJoCo's default.

    A backend that the user has set is the only one tried. Otherwise Linux tries EGL, then OSMesa.
    """
    if requested := _requested_backend():
        return (requested,)
    return ("egl", "osmesa") if sys.platform == "linux" else ("",)


def child_environment(backend: str) -> dict[str, str]:
    """Return the environment variables of a child process that renders.

    Args:
        backend: One of `backends()`.
    """
    variables = dict(os.environ)
    variables.pop("PYOPENGL_PLATFORM", None)  # set by MuJoCo, here possibly to another backend
    variables.pop("MUJOCO_GL", None)
    if backend:
        variables["MUJOCO_GL"] = backend
    # Rendering must not leave files in the user's home folder.
    variables.setdefault("MESA_SHADER_CACHE_DISABLE", "true")
    variables.setdefault("__GL_SHADER_DISK_CACHE", "0")
    return variables


def installation_advice() -> str:
    """Return what the user can do when no backend works."""
    if _requested_backend():
        return "the backend is set by MUJOCO_GL; unset it to try EGL and OSMesa"
    return "install EGL or OSMesa (Debian: libegl1 libgl1-mesa-dri, or libosmesa6)"


def _requested_backend() -> str:
    # The command line renames MUJOCO_GL, so that `import mujoco` loads no graphics library.
    saved = os.environ.get("TERRAINKIT_MUJOCO_GL")
    return (os.environ.get("MUJOCO_GL", "") if saved is None else saved).strip()
