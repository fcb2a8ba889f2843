"""Validate exported maps with Gazebo's parser, libsdformat 12; `make integrations` runs it.

Debian's package libsdformat12-12 has the library, but no `gz` or `ign` command. This calls the
function behind `ign sdf --check`.
"""

import ctypes
import ctypes.util
import sys
from pathlib import Path

import terrainkit

library = ctypes.util.find_library("sdformat12")
if library is None:
    sys.exit("libsdformat 12 is not installed; install it with: apt install libsdformat12-12")
check = ctypes.CDLL(library).cmdCheck
check.argtypes, check.restype = [ctypes.c_char_p], ctypes.c_int


def is_valid(path):
    return check(str(path).encode()) == 0


for preset, rows in (("parkour", 4), ("legged_gym", 10)):
    terrain_map = terrainkit.generate(terrainkit.MapConfig(rows=rows, cols=10, preset=preset))
    path = terrain_map.save(Path(sys.argv[1]) / f"{preset}.sdf")
    assert is_valid(path), preset
    text = path.read_text()
    broken = path.with_name("broken.sdf")
    for valid, invalid in (("<mu>1</mu>", "<mu>a</mu>"), ("</link>", "</lnk>")):
        assert valid in text
        broken.write_text(text.replace(valid, invalid, 1))
        assert not is_valid(broken), invalid
    print(f"libsdformat 12: {preset} is valid; the errors above are from broken files")
