"""Bringing a robot in against what MuJoCo alone takes: import, compile, simulate the same seconds."""

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from clock import process, ratio

from terrainkit_robots import bundled

_SHARED = Path(__file__).resolve().parents[2] / "shared" / "robots"

_SIMULATE = """
import sys, mujoco
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
while data.time < 5:
    mujoco.mj_step(model, data)
"""


def run() -> Iterator[tuple[str, float]]:
    robots = Path(os.environ.get("TERRAINKIT_ROBOTS", _SHARED))
    program = str(Path(sys.executable).with_name("terrainkit"))
    for name, path in {
        "go2": robots / "go2" / "urdf" / "go2.urdf",
        "quadruped": bundled.find("quadruped"),
    }.items():
        if path is None or not path.exists():
            continue
        with tempfile.TemporaryDirectory() as folder:
            target = Path(folder) / "robot"
            command = [program, "onboard", str(path), "-o", str(target), "--overwrite"]
            process(command)()
            alone = process([sys.executable, "-c", _SIMULATE, str(target / "scene.xml")])
            limit = "at most 3" if name == "go2" else "no limit"
            for words in ([], ["--no-pictures"]):
                beside = "without_pictures_" if words else ""
                yield (
                    f"{name}_{beside}over_mujoco_alone ({limit})",
                    ratio(process(command + words), alone, 9),
                )
