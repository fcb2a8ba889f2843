"""The process in which MuJoCo draws a robot: a request on stdin, pictures and an answer as files.

A missing or broken graphics library may end a process, or never come back; this one is apart, so
that only the pictures are lost.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terrainkit_robots.transforms import Matrix

if TYPE_CHECKING:
    import mujoco

ANSWER = "answer.json"
"""File with the names of the pictures, or what was wrong."""


def main() -> None:
    """Answer one request."""
    request = json.load(sys.stdin)
    folder = Path(request["folder"])
    try:
        answer = _answer(request, folder)
    except Exception as error:  # graphics libraries raise whatever they like
        answer = {"failed": f"{type(error).__name__}: {error}"}
    (folder / ANSWER).write_text(json.dumps(answer))


def _answer(request: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    import cv2

    from terrainkit_robots.onboarding.camera import VIEWS
    from terrainkit_robots.onboarding.studio import Studio, UndrawableError
    from terrainkit_robots.quiet_mujoco import quiet_mujoco

    width, height = request["size"]
    with quiet_mujoco():
        try:
            model, qpos = _robot(Path(request["model"]), request["qpos"])
            studio = Studio(model, qpos, (width, height))
        except UndrawableError as error:
            return {"undrawable": str(error)}
        for name, view in VIEWS.items():
            encoded = cv2.imencode(".png", studio.picture(view)[:, :, ::-1])[1]
            (folder / f"{name}.png").write_bytes(encoded.tobytes())
    return {"pictures": list(VIEWS)}


def _robot(file: Path, qpos: Sequence[float] | None) -> tuple["mujoco.MjModel", Matrix]:
    """Return a model and its pose.

    Raises:
        UndrawableError: if MuJoCo refuses the file, or the pose is of another robot.
    """
    import mujoco

    from terrainkit_robots.onboarding.studio import UndrawableError

    reader = mujoco.MjModel
    load = reader.from_binary_path if file.suffix == ".mjb" else reader.from_xml_path
    try:
        model = load(str(file))
    except ValueError as error:
        raise UndrawableError(str(error)) from None
    if qpos is None:
        return model, np.array(model.key_qpos[0] if model.nkey else model.qpos0)
    if len(qpos) != model.nq:
        raise UndrawableError(f"its pose has {len(qpos)} numbers; wanted {model.nq}")
    return model, np.array(qpos)


if __name__ == "__main__":
    main()
