"""The robots of the benchmarks: the bundled ones, and others in TERRAINKIT_ROBOTS."""

import os
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_FOLDERS = {
    "bundled": ROOT / "robots/terrainkit_robots/description/bundled",
    "shared": Path(os.environ.get("TERRAINKIT_ROBOTS", ROOT.parent / "shared" / "robots")),
}
_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())
ROBOT_FILES = {
    name: folder / path
    for group, folder in _FOLDERS.items()
    for name, path in _TABLES[group].items()
}
"""Files by name; those of others may be missing."""


def robot_folder(file: Path) -> Path:
    """Return the folder with a robot and its meshes."""
    return file.parents[1] if file.parent.name == "urdf" else file.parent
