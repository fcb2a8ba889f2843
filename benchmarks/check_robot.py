"""Time of a static check of a robot, relative to importing the libraries it needs."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from clock import process, ratio

from terrainkit_robots.description import bundled

_SHARED = Path(__file__).resolve().parents[2] / "shared" / "robots"


def run() -> Iterator[tuple[str, float]]:
    imports = process([sys.executable, "-c", "import mujoco, lxml.etree, numpy"])
    robots = Path(os.environ.get("TERRAINKIT_ROBOTS", _SHARED))
    for name, path in {
        "go2": robots / "go2" / "urdf" / "go2.urdf",
        "quadruped": bundled.urdf_path("quadruped"),
    }.items():
        if path is None or not path.exists():
            continue
        command = [str(Path(sys.executable).with_name("terrainkit")), "check-robot"]
        command += [str(path), "--no-simulation"]
        yield f"{name}_over_imports (at most 2)", ratio(process(command), imports, 15)
