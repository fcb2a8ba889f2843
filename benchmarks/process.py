"""Time of whole processes, relative to `python -c "import numpy"`, and the size of their files."""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from clock import process, ratio


def run() -> Iterator[tuple[str, float]]:
    numpy = process([sys.executable, "-c", "import numpy"])
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "map.npz"
        command = [str(Path(sys.executable).with_name("terrainkit")), "generate"]
        command += ["--rows", "10", "--cols", "10", "-o", str(target), "--overwrite"]
        yield "generate_over_import_numpy (at most 4)", ratio(process(command), numpy, 21)
        yield "map_megabytes (at most 16)", target.stat().st_size / 1e6
    imported = process([sys.executable, "-c", "import terrainkit"])
    yield "import_over_import_numpy (at most 1.3)", ratio(imported, numpy, 31)
