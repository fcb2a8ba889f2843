"""Time of onboarding a robot, relative to MuJoCo alone.

The reference imports MuJoCo, compiles the model and simulates for the same time. With pictures, it
renders the same number of pictures of the same size.
"""

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from clock import process, ratio
from mutants.robot_files import ROBOT_FILES

_SIMULATE = """
import sys, mujoco
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
while data.time < 5:
    mujoco.mj_step(model, data)
"""

_DRAW = """
renderer = mujoco.Renderer(model, 420, 480)
for azimuth in (0, 90, 45):
    camera = mujoco.MjvCamera()
    camera.azimuth = azimuth
    renderer.update_scene(data, camera)
    renderer.render()
"""


def run() -> Iterator[tuple[str, float]]:
    os.environ.setdefault("MUJOCO_GL", "egl")
    program = str(Path(sys.executable).with_name("terrainkit"))
    for name in ("go2", "quadruped"):
        if not (path := ROBOT_FILES[name]).exists():
            continue
        with tempfile.TemporaryDirectory() as folder:
            target = Path(folder) / "robot"
            command = [program, "onboard", str(path), "-o", str(target), "--overwrite"]
            process([*command, "--no-pictures"])()
            for what, words, code in (
                ("without_pictures", ["--no-pictures"], _SIMULATE),
                ("with_pictures", [], _SIMULATE + _DRAW),
            ):
                alone = process([sys.executable, "-c", code, str(target / "scene.xml")])
                limit = "at most 3" if name == "go2" else "no limit"
                yield f"{name}_{what} ({limit})", ratio(process([*command, *words]), alone, 9)
