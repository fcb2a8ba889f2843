"""Time of whole processes, relative to importing the libraries they need; the size of a map."""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from clock import cpu_ratio, process
from mutants.robot_files import ROBOT_FILES


def run() -> Iterator[tuple[str, float]]:
    program = str(Path(sys.executable).with_name("terrainkit"))
    numpy = process([sys.executable, "-c", "import numpy"])
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "map.npz"
        command = [program, "generate"]
        command += ["--rows", "10", "--cols", "10", "-o", str(target), "--overwrite"]
        yield "generate_over_import_numpy (at most 4)", cpu_ratio(process(command), numpy, 11)
        yield "map_megabytes (at most 16)", target.stat().st_size / 1e6
        command.append("--no-mesh")
        yield (
            "generate_no_mesh_over_import_numpy (at most 3.3)",
            cpu_ratio(process(command), numpy, 11),
        )
    overview = process([program, "--help"])
    yield "help_over_import_numpy (at most 1)", cpu_ratio(overview, numpy, 21)
    imported = process([sys.executable, "-c", "import terrainkit"])
    yield "import_over_import_numpy (at most 1.3)", cpu_ratio(imported, numpy, 31)
    imports = process([sys.executable, "-c", "import mujoco, lxml.etree, numpy"])
    for name in ("go2", "quadruped"):
        if (path := ROBOT_FILES[name]).exists():
            check = process([program, "check-robot", str(path), "--no-simulation"])
            yield f"check_robot_{name}_over_imports (at most 2.2)", cpu_ratio(check, imports, 15)
