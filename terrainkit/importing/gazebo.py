"""Reject Gazebo worlds with the files that can be imported instead."""

import re
from pathlib import Path
from typing import Never

from terrainkit.errors import HeightFileError, listing
from terrainkit.importing.options import ReadOptions

SUFFIXES = (".sdf", ".world")


def read(path: Path, options: ReadOptions) -> Never:  # noqa: ARG001 - signature of all readers
    """Raise an error that names the files of a world: its models are placed by Gazebo only.

    Raises:
        HeightFileError: always.
    """
    found = re.findall(r"<uri>\s*([^<\s]+?)\s*</uri>", path.read_text("utf-8", errors="replace"))
    names = list(dict.fromkeys(found))
    hint = f": it refers to {listing(names)}" if names else ""
    raise HeightFileError(
        f"{path}: got a Gazebo file; expected one of its meshes (.dae, .stl, .obj) or heightmap "
        f"images{hint}"
    )
